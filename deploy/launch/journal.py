"""What happened to a run's processes, as lines for the user and as ``events.jsonl`` for studies.

Programs read an event's ``kind`` and ``agents``; its text is for people and may change.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

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

    path: Path
    progress: Progress

    def say(self, kind: Kind, text: str, *agents: str) -> None:
        """Tell the user, and write it down."""
        self.progress.say(text)
        with self.path.open("ab") as file:
            file.write(msgspec.json.encode(Event(time.time(), kind, text, agents)) + b"\n")


def events(path: Path) -> list[Event]:
    """All lines of a journal, in order; none where there is no file."""
    if not path.exists():
        return []
    return [msgspec.json.decode(line, type=Event) for line in path.read_bytes().splitlines()]
