"""Starting a swarm on this machine: preparation, supervision, progress, result."""
