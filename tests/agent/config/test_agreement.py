"""What two agents must have in common: all of an experiment, nothing of a machine."""

from pathlib import Path

import pytest

from agent.config.agreement import agreed
from agent.config.experiment import load
from swarm.errors import ConfigError
from swarm.wire.payload import Layout
from swarm.wire.refusals import differs, speech

FILE = Path(__file__).parents[3] / "deploy" / "library" / "swarms" / "gridworld-a.toml"
PARTS = (("theta", (4, 2)),)


def said(*settings: str) -> str:
    return speech(Layout("s", PARTS, agreed=agreed(load(FILE, settings))))


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        ("mixing.rule=extra", 'mixing.rule = "extra", we "dcpg"'),
        ("mixing.missing=stale", 'mixing.missing = "stale", we "symmetric"'),
        ("mixing.compression=int8", 'mixing.compression = "int8"'),
        ("mixing.robust={kind='clip',radius=0.01}", "mixing.robust.kind"),
        ("topology.kind=complete", 'topology.kind = "complete", we "ring"'),
        ("pace=async", 'pace = "async", we "sync"'),
        ("rounds=99", "rounds = 99, we 1000"),
        ("seed=77", "seed = 77, we 0"),
        ("optimizer.step=0.0001", "optimizer.step = 0.0001"),
        ("estimator.gamma=0.5", "estimator.gamma = 0.5"),
        ("policy.precision=float64", 'policy.precision = "float64"'),
        ("loss.probability=0.9", "loss.probability = 0.9"),
        ("agents.3.task.kwargs.layout=c", "tasks = #"),
        ("agents.3.id=other", "members = #"),
    ],
)
def test_a_difference_is_named(setting: str, named: str) -> None:
    assert named in differs(said(setting), said())
    assert said(setting) != said()


@pytest.mark.parametrize(
    "setting",
    [
        "network.lease_ms=5000",
        "timing.round=9",
        "checkpoint_every=7",
        'agents.0.endpoint="tcp/10.0.0.1:7450"',
        'modules=["/home/somebody"]',
    ],
)
def test_what_is_a_machines_own_may_differ(setting: str) -> None:
    assert said(setting) == said()


def test_a_file_is_known_by_its_name_wherever_it_lies() -> None:
    scene = "agents.0.task.kwargs.scene="
    assert said(f"{scene}/home/a/room.obj") == said(f"{scene}/etc/swarm/room.obj")
    assert said(f"{scene}/home/a/room.obj") != said(f"{scene}/home/a/hall.obj")


def test_it_fits_into_a_key_and_junk_is_no_meaning() -> None:
    assert len(said()) < 1500
    assert differs("4.junk", said()).startswith("differs in estimator.")
    assert differs("3.junk", said()) == "speaks protocol 3, we 4"


@pytest.mark.parametrize(
    "settings",
    [
        ("mixing.rule=extra", "mixing.missing=stale"),
        ("mixing.rule=exact-diffusion", "mixing.missing=give-back"),
        ("mixing.rule=gradient-tracking", "pace=async"),
        ("mixing.rule=extra", "mixing.robust={kind='trimmed-mean'}"),
    ],
)
def test_what_is_known_to_diverge_is_refused(settings: tuple[str, ...]) -> None:
    rule = settings[0].partition("=")[2]
    with pytest.raises(ConfigError, match=f'mixing.rule = "{rule}": expected .* with it'):
        load(FILE, settings)
    load(FILE, settings[:1])
