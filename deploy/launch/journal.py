"""What happened to a run's processes, as lines for the user and as ``events.jsonl`` for studies.

Programs read an event's ``kind`` and ``agents``; its text is for people and may change.
"""

import contextlib
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from agent.storage.appender import Appender
from deploy.launch.progress import Progress

Kind = Literal["fault", "ended", "restarted", "given-up"]


class Event(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One line.

    Attributes:
        time: Unix time [s], by the launcher's clock.
        kind: ``fault``: injected on purpose, or its end; ``ended``: an agent's process, before its
            rounds were over; ``restarted``: it was started again; ``given-up``: it will not be.
        text: what the user read.
        agents: whose process it was; none for a fault, which its text describes.
    """

    time: float
    kind: Kind
    text: str
    agents: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Journal:
    """Says lines, and keeps them."""

    kept: Appender
    progress: Progress

    def say(self, kind: Kind, text: str, *agents: str) -> None:
        """Tell the user, and write it down."""
        self.progress.say(text)
        event = Event(time.time(), kind, text, agents)
        self.kept.write(msgspec.json.encode(event) + b"\n")


def events(path: Path) -> list[Event]:
    """All lines of a journal that read, in order; none where there is no file."""
    found: list[Event] = []
    for line in path.read_bytes().splitlines() if path.exists() else ():
        with contextlib.suppress(msgspec.MsgspecError):  # the launcher was killed in the middle
            found.append(msgspec.json.decode(line, type=Event))
    return found
