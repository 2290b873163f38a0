"""The agent's branch of the exception tree.

::

    SwarmError
    ├── CheckpointError    a checkpoint is missing, torn, or of another run
    ├── TaskError          a task's world is unknown, refuses its arguments, or does not fit
    └── VehicleError       a drone is not there, refuses, or its flight was broken off
"""

from swarm.errors import ConfigError, SwarmError


class CheckpointError(SwarmError):
    """A checkpoint cannot be used; the message names the file."""

    exit_code = 4


class TaskError(ConfigError):
    """A task cannot be built, or the estimator or policy does not fit it."""


class VehicleError(SwarmError):
    """A drone is not there, refuses, or its flight was broken off; the message says why."""

    exit_code = 5
