"""One learner: rounds, estimators, policies, checkpoints.

Imports :mod:`swarm`.  Reaches a world only through Gymnasium ids and MAVLink.
"""
