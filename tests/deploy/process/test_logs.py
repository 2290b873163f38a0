"""A log line as JSON has what a line of text has; a log does not grow for ever."""

import json
import logging
import sys
from pathlib import Path

import pytest

from deploy.process import logs
from deploy.process.logs import LOG_FILES, JsonLines, log_to


def test_a_line_reads_back() -> None:
    try:
        raise ValueError("x")
    except ValueError:
        record = logging.LogRecord(
            "agent", logging.WARNING, "f", 1, 'round %d: "é"', (3,), sys.exc_info()
        )
    line = JsonLines("drone0").format(record)
    entry = json.loads(line)
    assert "\n" not in line
    assert entry["level"] == "WARNING"
    assert entry["agent"] == "drone0"
    assert entry["message"] == 'round 3: "é"'
    assert "ValueError" in entry["exception"]
    assert abs(entry["time"] - record.created) < 0.01


def test_a_log_is_rotated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "LOG_BYTES", 2000)
    monkeypatch.setattr(logging.root, "handlers", [])
    monkeypatch.setattr(logging.root, "level", logging.root.level)
    log_to(tmp_path / "drone0.log", "drone0", quiet=True, as_json=False)
    for round_ in range(500):
        logging.getLogger("agent").info("round %d: a line like any other", round_)
    for handler in logging.root.handlers:
        handler.close()
    files = list(tmp_path.iterdir())
    assert len(files) == 1 + LOG_FILES
    assert all(file.stat().st_size <= 2000 for file in files)
    assert "round 499" in (tmp_path / "drone0.log").read_text()
