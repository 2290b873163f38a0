"""Before the agents of a swarm start: caches are filled once, for a new run and for one again."""

from pathlib import Path

import pytest

from agent.config.experiment import load
from agent.storage.runfolder import RunFolder
from deploy.launch import preparation
from tests.integration.harness import GRIDWORLD_A


@pytest.mark.parametrize("again", [False, True], ids=["new", "resumed"])
def test_caches_are_filled_before_the_agents_start(
    again: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = load(GRIDWORLD_A)
    folder = RunFolder(tmp_path / "run")
    if again:
        folder.write_config(config)
    warmed: list[str] = []
    monkeypatch.setattr(preparation, "check_tasks", lambda config: None)
    monkeypatch.setattr(preparation, "warm_up", lambda tasks: warmed.extend(t.env for t in tasks))
    begun = preparation.resume(folder.path, ()) if again else preparation.prepare(config, tmp_path)
    with begun as prepared:
        assert warmed == [entry.task.env for entry in config.agents]
        assert prepared.fresh is not again
