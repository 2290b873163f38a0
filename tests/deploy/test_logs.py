"""A log line as JSON has what a line of text has."""

import json
import logging
import sys

from deploy.logs import JsonLines


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
