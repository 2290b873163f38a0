"""Logs of an agent: a file that is rotated, and standard error; as text or as JSON lines."""

import json
import logging
from logging.handlers import RotatingFileHandler
from pathlib import Path

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


def log_to(path: Path, agent: str, quiet: bool, as_json: bool) -> None:
    """Log to a file and, unless ``quiet``, to standard error."""
    handlers: list[logging.Handler] = [
        RotatingFileHandler(path, maxBytes=LOG_BYTES, backupCount=LOG_FILES)
    ]
    if not quiet:
        handlers.append(logging.StreamHandler())
    text = logging.Formatter(f"%(asctime)s {agent} %(levelname)s %(message)s")
    for handler in handlers:
        handler.setFormatter(JsonLines(agent) if as_json else text)
    logging.basicConfig(level=logging.INFO, handlers=handlers)
