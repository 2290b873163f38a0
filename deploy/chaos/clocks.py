"""Wall clocks that jump: an agent sees another time of day than its machine has.

Linux has no namespace for the wall clock, and the machine's own must stay as it is.  libfaketime
(https://github.com/wolfcw/libfaketime) is loaded into the agent's process before everything else;
whoever asks there for the time of day (Python, Zenoh, the file system's stamps) gets it shifted by
what a file says, and the file can be changed while the agent runs.  CLOCK_MONOTONIC stays true, as
it does on a host whose clock is set.

Traps of libfaketime 0.9.10: its remedy for old C libraries, on by default, makes timed waits return
at once, and an agent burns nine times the CPU (measured; off here).  ``time.sleep`` fails in Python
3.11 (its issue 426); agents never sleep, they wait for events.
"""

from dataclasses import dataclass, field
from pathlib import Path

from agent.storage.files import write_file

LIBRARIES = (
    "/usr/lib/*/faketime/libfaketimeMT.so.1",
    "/usr/lib*/faketime/libfaketimeMT.so.1",
    "/usr/local/lib/faketime/libfaketimeMT.so.1",
)
LOOK_EVERY = 1  # [s] the agent notices a jump so much later at most


def library() -> Path | None:
    """Where libfaketime is, if it is."""
    found = (path for pattern in LIBRARIES for path in sorted(Path("/").glob(pattern[1:])))
    return next(found, None)


def why_not() -> str | None:
    """Why no clock can jump on this machine, or None."""
    return None if library() else "libfaketime is not installed (Debian: libfaketime)"


@dataclass(slots=True)
class Clocks:
    """The wall clocks of those agents whose clock is going to jump.

    Attributes:
        folder: where a file an agent says by how much its clock is wrong.
        agents: whose.
        wrong: by how much [s], by agent.
    """

    folder: Path
    agents: frozenset[str]
    wrong: dict[str, float] = field(default_factory=dict)

    def environment(self, agent: str) -> dict[str, str]:
        """Variables with which to start an agent; none for one whose clock stays right."""
        found = library()
        if agent not in self.agents or found is None:
            return {}
        self.jump(agent, 0.0)
        return {
            "LD_PRELOAD": str(found),
            "FAKETIME_TIMESTAMP_FILE": str(self._file(agent).resolve()),
            "FAKETIME_CACHE_DURATION": f"{LOOK_EVERY}",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",
            "FAKETIME_FORCE_MONOTONIC_FIX": "0",
            "FAKETIME_DISABLE_SHM": "1",
        }

    def jump(self, agent: str, by: float) -> None:
        """Set an agent's clock forward, or back, ``by`` seconds."""
        self.wrong[agent] = self.wrong.get(agent, 0.0) + by
        self.folder.mkdir(parents=True, exist_ok=True)
        write_file(self._file(agent), f"{self.wrong[agent]:+.3f}\n".encode(), durable=False)

    def _file(self, agent: str) -> Path:
        return self.folder / agent
