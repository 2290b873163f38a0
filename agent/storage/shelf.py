"""An agent's checkpoints as they come: which are brought to the disk, which stay.

Every checkpoint is written before the next round begins, so a process that dies, however it dies,
loses at most the round under way.  Bringing a file to the disk takes some milliseconds, more than a
round of a table: where rounds are short it is done every :data:`OFTEN` to :data:`SELDOM` seconds
only, and a power cut costs so much.  The rounds for it are multiples of a power of two, so that
agents of one swarm on one machine bring the same rounds to the disk and a swarm goes on together.
What has been brought there stays until newer ones have.
"""

import time
from collections import deque
from collections.abc import Callable, Iterable
from pathlib import Path

from agent.storage import checkpoint
from agent.storage.appender import Trouble
from agent.storage.checkpoint import KEPT, KEPT_LARGE, LARGE, Checkpoint

OFTEN, SELDOM = 0.5, 2.0  # [s]
DURABLE = 4  # so many of those on the disk stay: the strides of two agents may differ by a factor


class Shelf:
    """Where one agent puts its checkpoints.

    Args:
        folder: of its checkpoints.
        clock: monotonic [s].
    """

    def __init__(self, folder: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._folder, self._clock = folder, clock
        self._trouble = Trouble(clock=clock)
        self._stride = 1
        self._durable: deque[int] = deque(maxlen=DURABLE)
        self._synced = -SELDOM

    def put(self, kept: Checkpoint, *, durable: bool = False) -> bool:
        """Write a checkpoint and remove old ones; whether that was possible.

        Args:
            kept: the checkpoint.
            durable: bring it to the disk in any case: it may be the last.
        """
        now, newest = self._clock(), self._durable[-1] if self._durable else 0
        due = now - self._synced >= SELDOM or kept.round // self._stride > newest // self._stride
        try:
            size = checkpoint.write(self._folder, kept, durable=durable or due).stat().st_size
            if durable or due:
                self._adapt(now - self._synced)
                self._durable.append(kept.round)
                self._synced = now
            self._remove_old(KEPT_LARGE if size > LARGE else KEPT)
        except OSError as error:
            self._trouble.met(f"checkpoint of round {kept.round}", error)
            return False
        self._trouble.over("the newest checkpoint")
        return True

    def put_all(self, kept: Iterable[Checkpoint]) -> bool:
        """Write the last ones and bring them to the disk; whether all of that was possible."""
        return min([self.put(each, durable=True) for each in kept])

    def _adapt(self, since: float) -> None:
        if since < OFTEN:
            self._stride *= 2
        elif since >= SELDOM:
            self._stride = max(1, self._stride // 2)

    def _remove_old(self, count: int) -> None:
        for round_ in checkpoint.rounds_in(self._folder)[:-count]:
            if round_ not in self._durable:
                checkpoint.path_of(self._folder, round_).unlink(missing_ok=True)
