"""The agent's branch of the exception tree.

::

    SwarmError
    ├── CheckpointError    a checkpoint is missing, torn, or of another run
    ├── DivergenceError    parameters, gradient or return have left all sense
    ├── TaskError          a task's world is unknown, refuses its arguments, or does not fit
    └── VehicleError       a drone is not there, refuses, or its flight was broken off
        ├── RefusedError     it answers a command with a refusal
        └── TakenOverError   a person flies it, or its own failsafe does
"""

from swarm.errors import ConfigError, SwarmError


class CheckpointError(SwarmError):
    """A checkpoint cannot be used; the message names the file."""

    exit_code = 4


class DivergenceError(SwarmError):
    """Learning has diverged; the message names the round and the cause."""

    exit_code = 6


class TaskError(ConfigError):
    """A task cannot be built, or the estimator or policy does not fit it."""


class VehicleError(SwarmError):
    """A drone is not there, refuses, or its flight was broken off; the message says why."""

    exit_code = 5


class RefusedError(VehicleError):
    """The vehicle has answered a command with a refusal; the message has its reasons."""


class TakenOverError(VehicleError):
    """The vehicle is in a mode that we did not ask for: it is not ours to fly, land or hold."""
