"""What an agent remembers of its own rounds, for a watcher who comes late.

Interface: :class:`History` (kept by the agent), :func:`serve_history`, :func:`ask_history`.  The
memory is bounded and covers the whole run: when it is full, every second report is forgotten and
from then on only every second round is kept, and so on.  Which rounds those are depends on their
numbers alone, so all agents remember the same ones and their sketches can be compared.
"""

import threading

import msgspec
import zenoh

from swarm.errors import PayloadError
from swarm.reports.telemetry import RoundReport
from swarm.wire.keys import Keys

LIMIT = 512  # most reports that are kept
REPLY = 4_194_304  # [bytes] longer answers are not read


class History:
    """Reports of one agent, in the order of their rounds; safe to read from another thread."""

    def __init__(self, limit: int = LIMIT) -> None:
        self._limit, self._stride = limit, 1
        self._reports: list[RoundReport] = []
        self._lock = threading.Lock()

    def due(self, round_: int) -> bool:
        """Whether this round's report would be kept."""
        return round_ % self._stride == 0

    def take(self, report: RoundReport) -> None:
        """Keep a report if it is due; what is remembered of later rounds did not happen."""
        if not self.due(report.round):
            return
        with self._lock:
            while self._reports and self._reports[-1].round >= report.round:
                self._reports.pop()
            self._reports.append(report)
            while len(self._reports) > self._limit:
                self._stride *= 2
                self._reports = [kept for kept in self._reports if self.due(kept.round)]

    def reports(self) -> list[RoundReport]:
        """What is remembered, oldest first."""
        with self._lock:
            return list(self._reports)


def serve_history(session: zenoh.Session, keys: Keys, agent: str, history: History) -> None:
    """Answer "what happened?" on Zenoh's thread."""

    def answer(query: zenoh.Query) -> None:
        query.reply(keys.history(agent), msgspec.msgpack.encode(history.reports()))

    session.declare_queryable(keys.history(agent), answer)


def ask_history(session: zenoh.Session, keys: Keys, timeout: float) -> dict[str, list[RoundReport]]:
    """What agents remember that answer within ``timeout`` [s]; a bad answer is none."""
    decoder = msgspec.msgpack.Decoder(list[RoundReport])
    answers: dict[str, list[RoundReport]] = {}
    for reply in session.get(
        keys.history(), timeout=timeout, consolidation=zenoh.ConsolidationMode.NONE
    ):
        if reply.ok is None or len(body := reply.ok.payload.to_bytes()) > REPLY:
            continue
        try:
            agent = Keys.identity(str(reply.ok.key_expr))[1]
            reports = decoder.decode(body)
        except (PayloadError, msgspec.MsgspecError, UnicodeDecodeError):
            continue
        if len(reports) <= LIMIT and all(report.agent == agent for report in reports):
            answers[agent] = reports
    return answers
