"""What the neighbours have said: filled by Zenoh's threads, emptied by the rounds."""

import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field

from swarm.wire.payload import Message, ParameterHeader

KEPT = 2  # messages kept per sender: neighbours in step are never further apart than one round


@dataclass(slots=True)
class Box:
    """What one sender has said: its newest messages by round, its newest header of all."""

    messages: dict[int, Message] = field(default_factory=dict)
    view: ParameterHeader | None = None
    heard: float = 0.0  # monotonic time of its last sign of life [s]

    def newest(self) -> int:
        """Newest round, -1 if none."""
        return max(self.messages, default=-1)

    def store(self, message: Message) -> None:
        """Keep a message; a new incarnation of the sender starts a new box."""
        lives = {other.header.incarnation for other in self.messages.values()}
        if lives and message.header.incarnation not in lives:
            self.messages.clear()
        self.messages.setdefault(message.header.round, message)
        for old in sorted(self.messages)[:-KEPT]:
            del self.messages[old]


class Inbox:
    """The boxes of all senders, for one reader and many writers."""

    def __init__(self) -> None:
        self._boxes: dict[str, Box] = {}
        self._news = threading.Condition()
        self._count = 0

    def store(self, message: Message) -> None:
        """Keep a message and wake the reader."""
        with self._news:
            box = self._boxes.setdefault(message.header.agent, Box())
            box.store(message)
            self._touch(box, message.header)

    def everything(self) -> list[Message]:
        """All messages that are kept."""
        with self._news:
            return [m for box in self._boxes.values() for m in box.messages.values()]

    def forget(self, message: Message) -> None:
        """Drop a message."""
        with self._news:
            self._boxes[message.header.agent].messages.pop(message.header.round, None)

    def touch(self, header: ParameterHeader) -> None:
        """Note a sign of life, and with whom its sender exchanges."""
        with self._news:
            self._touch(self._boxes.setdefault(header.agent, Box()), header)

    def _touch(self, box: Box, header: ParameterHeader) -> None:
        box.heard = time.monotonic()
        known = box.view
        if known is None or known.incarnation != header.incarnation or known.round <= header.round:
            box.view = header
        self._notify()

    def wake(self) -> None:
        """Wake the reader for another reason."""
        with self._news:
            self._notify()

    def _notify(self) -> None:
        self._count += 1
        self._news.notify_all()

    def wait(self, seen: int, timeout: float) -> None:
        """Wait for anything that came after :meth:`count` was ``seen``, at most ``timeout`` [s]."""
        with self._news:
            if self._count == seen:
                self._news.wait(timeout)

    @property
    def count(self) -> int:
        """Grows with everything that happens."""
        return self._count

    def of_round(self, round_: int, agents: Collection[str]) -> dict[str, Message]:
        """The messages of one round, by sender."""
        return self._select(agents, lambda box: round_ if round_ in box.messages else -1)

    def newest(self, agents: Collection[str]) -> dict[str, Message]:
        """The newest message of each sender, of whatever round."""
        return self._select(agents, lambda box: box.newest())

    def _select(self, agents: Collection[str], which: Callable[[Box], int]) -> dict[str, Message]:
        with self._news:
            boxes = {agent: self._boxes[agent] for agent in agents if agent in self._boxes}
            return {a: box.messages[which(box)] for a, box in boxes.items() if which(box) >= 0}

    def rounds(self) -> dict[str, int]:
        """Newest round of each sender."""
        with self._news:
            return {agent: box.newest() for agent, box in self._boxes.items()}

    def views(self) -> list[ParameterHeader]:
        """Newest header of each sender."""
        with self._news:
            return [box.view for box in self._boxes.values() if box.view is not None]

    def heard(self) -> dict[str, float]:
        """Monotonic time of each sender's last sign of life [s]."""
        with self._news:
            return {agent: box.heard for agent, box in self._boxes.items()}

    def ages(self) -> dict[str, tuple[int, float]]:
        """Newest round of each sender and the age of its last sign of life [s], of one moment."""
        with self._news:
            now = time.monotonic()
            return {agent: (box.newest(), now - box.heard) for agent, box in self._boxes.items()}
