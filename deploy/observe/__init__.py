"""Watching a swarm without taking part: status."""
