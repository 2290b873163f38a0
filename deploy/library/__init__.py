"""Swarm files, faults and policies that come with the package, found by name."""
