"""A swarm file: its types, how it is read, and what it refuses."""
