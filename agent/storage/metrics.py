"""The metrics file of an agent that goes on: without the rounds that it will play again."""

import logging
from pathlib import Path

import msgspec

from agent.storage.appender import Appender
from agent.storage.files import write_file
from swarm.reports.telemetry import RoundReport

log = logging.getLogger(__name__)


def open_metrics(path: Path, begin: int) -> Appender:
    """The file, open for appending.

    Lines that do not read are nobody's to delete, and stay.

    Args:
        path: of the file.
        begin: reports of this round and later ones are removed.

    Raises:
        OSError: it cannot be opened.
    """
    if path.exists():
        lines = path.read_bytes().splitlines(keepends=True)
        kept = [line for line in lines if _stays(line, begin)]
        if len(kept) < len(lines):
            try:
                write_file(path, b"".join(kept))
            except OSError as error:  # a reader takes the last report of a round
                log.warning("%s keeps rounds to be played again: %s", path, error.strerror)
    return Appender(path, lines=True)


_decoder = msgspec.json.Decoder(RoundReport)


def _stays(line: bytes, begin: int) -> bool:
    try:
        return _decoder.decode(line).round < begin
    except msgspec.MsgspecError:
        return True
