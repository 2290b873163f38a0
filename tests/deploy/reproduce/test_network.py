"""The fault table: what counts as kept, and a machine that cannot."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from deploy.chaos import namespaces
from deploy.reproduce import network
from deploy.reproduce.aftermath import Aftermath
from deploy.reproduce.claims import Options
from deploy.reproduce.network import FAULTS, FILES, UNDISTURBED, Finished, claim
from swarm.errors import SwarmError

WELL = Aftermath(
    usual=0.005, longest=0.1, following=0.05, slow=0, during=0.005, absence=3, reunion=5,
    reconnect=0.4, restarts=0, repeated=0, one_sided=0,
)  # fmt: skip
CALM = Finished(WELL, solved=4, share=0.985, lost=())


def kept(fault: str, end: Finished = CALM, **cost: Any) -> bool:
    return claim(fault, replace(end, aftermath=replace(WELL, **cost)), CALM, agents=4).holds


def test_a_file_a_fault() -> None:
    for_asynchronous_swarms = {"slow"}
    assert {file.stem for file in FILES.glob("*.toml")} == set(FAULTS) | for_asynchronous_swarms


@pytest.mark.parametrize("fault", [UNDISTURBED, *FAULTS])
def test_whatever_comes_all_tasks_are_solved_and_nobody_is_lost(fault: str) -> None:
    restarts = {"kill": 1, "restart": 4}.get(fault, 0)
    assert kept(fault, restarts=restarts)
    assert not kept(fault, replace(CALM, solved=3), restarts=restarts)
    assert not kept(fault, replace(CALM, lost=("drone1",)), restarts=restarts)
    assert not kept(fault, restarts=restarts, repeated=1)
    worse = replace(CALM, share=0.94)
    assert kept(fault, worse, restarts=restarts) == (fault == UNDISTURBED)
    assert kept(fault, restarts=1) == (fault == "kill")


def test_what_a_fault_may_cost() -> None:
    assert not kept("kill", longest=0.6)
    assert kept("freeze", longest=2.2, slow=1)
    assert not kept("freeze", longest=3.1, slow=1)
    assert not kept("freeze", longest=2.2, following=2.0, slow=2)
    assert kept("rate", longest=3.1, slow=9)


def test_a_partition_agrees_again_soon_after_its_parts_hear_each_other() -> None:
    assert kept("partition", reunion=20)
    assert not kept("partition", reunion=21)
    assert not kept("partition", reunion=None, reconnect=None, absence=None)


def test_without_root_one_line_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(namespaces, "why_not", lambda: "network namespaces need root")
    options = Options(tmp_path, 1, True, lambda *far: None)
    with pytest.raises(SwarmError, match="network namespaces need root"):
        network.study(options, 4, FAULTS)
