"""A log line as JSON has what a line of text has; a log does not grow for ever."""

import contextlib
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


def test_a_full_disk_costs_lines_and_one_word(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log that cannot be written raises nothing, says so once, and goes on when there is room."""
    monkeypatch.setattr(logging.root, "handlers", [])
    file = tmp_path / "agent.log"
    log_to(file, "drone0", quiet=True, as_json=False)
    (handler,) = logging.root.handlers
    try:
        room = handler.stream  # type: ignore[attr-defined]
        full = Path("/dev/full").open("w", encoding="utf-8")  # noqa: SIM115  (closed below)
        monkeypatch.setattr(handler, "stream", full)
        for k in range(3):
            logging.getLogger("test").warning("lost %d", k)
        monkeypatch.setattr(handler, "stream", room)
        logging.getLogger("test").warning("kept")
    finally:
        handler.close()
        with contextlib.suppress(OSError):
            full.close()
    assert "kept" in file.read_text() and "lost" not in file.read_text()
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    assert "agent.log cannot be written: No space left on device" in said[0]
    assert "is written again" in said[1]
