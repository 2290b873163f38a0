"""Every key expression of a swarm, and what travels on it.

========================================  ======================================================
``dcpg/{swarm}/alive/{agent}/{inc}``      liveliness token; ``inc`` is the process's incarnation
``dcpg/{swarm}/speaks/{agent}/{what}``    likewise; what its parameters mean (``refusals``)
``dcpg/{swarm}/config/{agent}``           queryable: the swarm file, for one who has none
``dcpg/{swarm}/params/{agent}/{to}``      parameters of one round (``payload``), pushed
``dcpg/{swarm}/state/{agent}``            queryable: the newest parameters, for one who joins
``dcpg/{swarm}/status/{agent}``           queryable: :class:`swarm.reports.telemetry.AgentStatus`
``dcpg/{swarm}/history/{agent}``          queryable: recent reports (:mod:`swarm.reports.history`)
``dcpg/{swarm}/telemetry/{agent}/{what}``  ``reports.telemetry``, pushed, droppable: ``round`` has
                                          RoundReport, ``flight`` has FlightSample
========================================  ======================================================

Receivers subscribe with ``*`` in the agent's place and hold the key against the header: see the
"wrong key" trap in the notes to Zenoh 1.10.  Under :mod:`swarm.wire.security` nobody says
anything but under its own id, so every key names its agent in the fourth place.
"""

import re
from dataclasses import dataclass

from swarm.errors import ConfigError, PayloadError

ROOT = "dcpg"
SHOWN = 64  # letters of a strange key in an error
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")


def check_name(what: str, name: str) -> str:
    """Return ``name`` if it can be a part of a key.

    Raises:
        ConfigError: it is empty, too long or has characters that mean something to Zenoh.
    """
    if not _NAME.fullmatch(name):
        raise ConfigError(
            f'{what} = "{name}": expected 1 to 64 letters, digits, "_", "-" or ".", '
            "the first a letter or a digit"
        )
    return name


@dataclass(frozen=True, slots=True)
class Keys:
    """The key expressions of the swarm called ``swarm``."""

    swarm: str

    def alive(self, agent: str = "*", incarnation: str = "*") -> str:
        """Key of a liveliness token."""
        return f"{ROOT}/{self.swarm}/alive/{agent}/{incarnation}"

    def speaks(self, agent: str = "*", what: str = "*") -> str:
        """Key of the token that says what an agent's parameters mean."""
        return f"{ROOT}/{self.swarm}/speaks/{agent}/{what}"

    def config(self, agent: str = "*") -> str:
        """Key under which an agent answers with the swarm file."""
        return f"{ROOT}/{self.swarm}/config/{agent}"

    def params(self, agent: str = "*", receiver: str = "*") -> str:
        """Key on which an agent publishes its parameters to one of its neighbours."""
        return f"{ROOT}/{self.swarm}/params/{agent}/{receiver}"

    def state(self, agent: str = "*") -> str:
        """Key under which an agent answers with its newest parameters."""
        return f"{ROOT}/{self.swarm}/state/{agent}"

    def status(self, agent: str = "*") -> str:
        """Key under which an agent answers with its status."""
        return f"{ROOT}/{self.swarm}/status/{agent}"

    def history(self, agent: str = "*") -> str:
        """Key under which an agent answers with what it remembers of its rounds."""
        return f"{ROOT}/{self.swarm}/history/{agent}"

    def telemetry(self, agent: str = "*", what: str = "*") -> str:
        """Key of what an agent tells about itself; ``what`` names the message type."""
        return f"{ROOT}/{self.swarm}/telemetry/{agent}/{what}"

    def own(self, agent: str) -> str:
        """Everything that an agent says; all keys name the agent in the fourth place."""
        return f"{ROOT}/{self.swarm}/*/{agent}/**"

    def everything(self) -> str:
        """Everything that anybody says."""
        return f"{ROOT}/{self.swarm}/**"

    @staticmethod
    def token(key: str) -> tuple[str, str]:
        """(agent, incarnation) of a liveliness key.

        Raises:
            PayloadError: it is none; whoever can publish can publish on wild keys.
        """
        parts = key.split("/")
        if len(parts) != 5 or not all(_NAME.fullmatch(part) for part in parts[3:]):
            raise PayloadError("key", f"token on {key[:SHOWN]!r}: expected one of an agent")
        return parts[3], parts[4]

    @staticmethod
    def identity(key: str) -> tuple[str, str]:
        """(swarm, agent) of any key.

        Raises:
            PayloadError: it names none, for instance ``dcpg/**``, which reaches every subscriber.
        """
        parts = key.split("/")
        if len(parts) < 4 or not all(_NAME.fullmatch(part) for part in (parts[1], parts[3])):
            raise PayloadError("key", f"message on {key[:SHOWN]!r}: expected a key of an agent's")
        return parts[1], parts[3]

    @staticmethod
    def names(key: str, agent: str) -> bool:
        """Whether it is a key of this agent's."""
        try:
            return Keys.identity(key)[1] == agent
        except PayloadError:
            return False
