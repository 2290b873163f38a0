"""The protocol in a virtual world: see :mod:`tests.swarm.simulation.world`."""
