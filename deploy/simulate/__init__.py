"""A whole swarm in one process."""
