"""What a run's launcher says is kept beside the run."""

from pathlib import Path

import pytest

from agent.config.experiment import load
from agent.storage.appender import Appender
from deploy.launch.journal import Journal, events
from deploy.launch.progress import Progress

FILE = Path(__file__).parents[3] / "deploy" / "library" / "swarms" / "gridworld-a.toml"


def test_what_the_user_reads_is_written_down(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "events.jsonl"
    assert events(path) == []
    journal = Journal(Appender(path, lines=True), Progress(load(FILE)))
    journal.say("fault", "fault: kill drone1")
    journal.say("restarted", "drone1 starts again from its newest checkpoint", "drone1")
    first, second = events(path)
    assert (first.kind, first.text, first.agents) == ("fault", "fault: kill drone1", ())
    assert (second.kind, second.agents) == ("restarted", ("drone1",))
    assert second.time >= first.time
    assert "fault: kill drone1" in capsys.readouterr().out
