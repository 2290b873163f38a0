"""What can go wrong, as one tree.

::

    SwarmError                 base of everything that this project raises on purpose
    ├── ConfigError            a swarm file, an option or an argument of the user's
    │   └── TooEarlyError      a certificate that begins later; the clock may not be set yet
    ├── NetworkError           a session cannot be opened, an id is taken, nobody answers
    ├── SupersededError        a later life of this very agent has begun; this one ends
    ├── PayloadError           a received message is not acceptable; carries a short cause
    └── agent.errors, ...      the rooms above grow their own branches here

Every message is one line that names the thing, the value and what was expected; the command
line prints it and exits with the class's ``exit_code``.
"""


class SwarmError(Exception):
    """Base class.  ``exit_code`` is what a process that ends with this error returns."""

    exit_code = 1


class ConfigError(SwarmError):
    """A user's file, key, value or argument is wrong.  Starting again would not help."""

    exit_code = 2


class TooEarlyError(ConfigError):
    """By this machine's clock a certificate is not valid yet; waiting may help."""


class NetworkError(SwarmError):
    """The network does not do what it must: no session, an id in use, nobody there."""

    exit_code = 3


class SupersededError(SwarmError):
    """A later life of this agent takes part; starting this one again would end that one."""

    exit_code = 5


class PayloadError(SwarmError):
    """A received message must not be used.

    Attributes:
        cause: short stable name (``"fingerprint"``, ``"length"``, ...) under which it is counted.
    """

    def __init__(self, cause: str, message: str) -> None:
        super().__init__(message)
        self.cause = cause
