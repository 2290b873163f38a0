"""Finite worlds whose every quantity is known exactly: chains and grid worlds of the paper."""
