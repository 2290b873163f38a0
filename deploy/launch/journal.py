"""What happened to a run's processes, as lines for the user and as ``events.jsonl`` for studies."""

import time
from dataclasses import dataclass
from pathlib import Path

import msgspec

from deploy.launch.progress import Progress


class Event(msgspec.Struct, frozen=True):
    """One line.

    Attributes:
        time: Unix time [s], by the launcher's clock.
        text: what the user read.
    """

    time: float
    text: str


@dataclass(frozen=True, slots=True)
class Journal:
    """Says lines, and keeps them."""

    path: Path
    progress: Progress

    def say(self, text: str) -> None:
        """Tell the user, and write it down."""
        self.progress.say(text)
        with self.path.open("ab") as file:
            file.write(msgspec.json.encode(Event(time.time(), text)) + b"\n")


def events(path: Path) -> list[Event]:
    """All lines of a journal, in order; none where there is no file."""
    if not path.exists():
        return []
    return [msgspec.json.decode(line, type=Event) for line in path.read_bytes().splitlines()]
