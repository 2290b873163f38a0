"""``swarm topology`` on 80 columns: the matrix of a few, a summary of many, all of it as JSON."""

import json

import msgspec
import pytest

from deploy.observe.topology import show_topology
from swarm.mixing.weights import Topology
from tests.deploy.observe.crowds import crowd


def test_a_small_graph_shows_its_matrix(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    show_topology(crowd(4), as_json=False)
    shown = capsys.readouterr().out
    assert "ring of 4 agents: 4 edges, 2 neighbours each, diameter 2" in shown
    assert "│ drone00 │   0.500 │   0.250 │       . │   0.250 │" in shown


@pytest.mark.parametrize("size", [16, 64])
def test_a_large_one_is_summed_up(
    size: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    show_topology(crowd(size), as_json=False)
    shown = capsys.readouterr().out
    assert max(map(len, shown.splitlines())) <= 80
    assert "…" not in shown
    assert f"W (lazy Metropolis): 0.250 on {size} edges; of itself each keeps 0.500" in shown
    assert f"drone00: drone01 drone{size - 1}" in shown
    assert len(shown.splitlines()) < 35


def test_degrees_that_differ_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    star = msgspec.structs.replace(crowd(16), topology=Topology(kind="star"))
    show_topology(star, as_json=False)
    assert "15 edges, 1 to 15 neighbours each, diameter 2" in capsys.readouterr().out


def test_json_has_all_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    show_topology(crowd(64), as_json=True)
    told = json.loads(capsys.readouterr().out)
    assert len(told["W"]) == len(told["spectrum"]["eigenvalues"]) == len(told["edges"]) == 64
