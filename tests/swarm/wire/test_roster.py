"""Who is waited for is named in the log."""

import logging
from unittest.mock import MagicMock

import pytest

from swarm.wire import roster
from swarm.wire.keys import Keys
from swarm.wire.roster import Roster


def test_the_log_names_who_is_awaited(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(roster, "TELL", (0.0, 3600.0))
    waiting = Roster(MagicMock(), Keys("swarm"), ("drone0", "drone1"))
    with caplog.at_level(logging.INFO, "swarm.wire.roster"):
        assert waiting.wait_for(["drone1", "drone0"], deadline=0.05) == {"drone0", "drone1"}
    (line,) = caplog.messages
    assert line.startswith("waiting for drone0, drone1, ")
