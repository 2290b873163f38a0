"""Logs of an agent: a file that is rotated, and standard error; as text or as JSON lines.

A disk that is full costs lines of the file, and one word a minute on standard error.
"""

import contextlib
import json
import logging
import sys
from logging.handlers import RotatingFileHandler
from pathlib import Path

from agent.storage.appender import Trouble

LOG_BYTES, LOG_FILES = 4_000_000, 3  # a log is rotated at this size; so many old ones stay


class JsonLines(logging.Formatter):
    """One JSON object a line: ``time`` (Unix, [s]), ``level``, ``agent``, ``message``."""

    def __init__(self, agent: str) -> None:
        super().__init__()
        self._agent = agent

    def format(self, record: logging.LogRecord) -> str:
        entry = {
            "time": round(record.created, 3),
            "level": record.levelname,
            "agent": self._agent,
            "message": record.getMessage(),
        }
        if record.exc_info:
            entry["exception"] = self.formatException(record.exc_info)
        return json.dumps(entry, ensure_ascii=False)


def _warn(words: str) -> None:
    """A word that does not go through the log; lost where standard error is full as well."""
    with contextlib.suppress(OSError):
        print(words, file=sys.stderr, flush=True)


class _LogFile(RotatingFileHandler):
    """Drops the lines that do not fit on the disk."""

    def __init__(self, path: Path) -> None:
        super().__init__(path, maxBytes=LOG_BYTES, backupCount=LOG_FILES)
        self._trouble = Trouble(_warn)

    def emit(self, record: logging.LogRecord) -> None:
        try:
            if self.shouldRollover(record):
                self.doRollover()
            self.stream = self.stream or self._open()
            self.stream.write(self.format(record) + self.terminator)
            self.stream.flush()
        except OSError as error:
            self._trouble.met(f"the log {self.baseFilename}", error)
        except ValueError:
            self.handleError(record)
        else:
            self._trouble.over(f"the log {self.baseFilename}")


def log_to(path: Path, agent: str, quiet: bool, as_json: bool) -> None:
    """Log to a file and, unless ``quiet``, to standard error."""
    handlers: list[logging.Handler] = [_LogFile(path)]
    if not quiet:
        handlers.append(logging.StreamHandler())
    text = logging.Formatter(f"%(asctime)s {agent} %(levelname)s %(message)s")
    for handler in handlers:
        handler.setFormatter(JsonLines(agent) if as_json else text)
    logging.basicConfig(level=logging.INFO, handlers=handlers)
