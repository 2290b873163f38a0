"""Swarm files: read strictly, overridden, and refused in one line that says why."""

from pathlib import Path

import msgspec
import pytest

from agent.config.experiment import load
from agent.learning.estimators import Exact
from swarm.errors import ConfigError

FILES = sorted((Path(__file__).parents[3] / "deploy" / "library" / "swarms").glob("*.toml"))
FILE = Path(__file__).parents[3] / "deploy" / "library" / "swarms" / "gridworld-a.toml"
CARTPOLE = FILE.with_name("cartpole.toml")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_swarm_file_of_the_project_is_good(file: Path) -> None:
    assert load(file).members


def test_overrides_reach_every_key() -> None:
    config = load(
        FILE,
        [
            "seed=7",
            "optimizer.step=0.25",
            "agents.1.id=other",
            "agents.2.task.kwargs.layout=b",
            'topology={kind="star"}',
            "network.discovery=multicast",
            "estimator={kind='exact'}",
        ],
    )
    assert config.seed == 7
    assert config.members[1] == "other"
    assert config.agents[2].task.kwargs["layout"] == "b"
    assert config.topology.kind == "star"
    assert config.network.discovery == "multicast"
    assert isinstance(config.estimator, Exact)


def test_the_copy_in_a_run_folder_reads_back_equal(tmp_path: Path) -> None:
    config = load(FILE)
    (tmp_path / "config.json").write_bytes(msgspec.json.encode(config))
    assert load(tmp_path / "config.json") == config


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("roundz=3", ['unknown key "roundz"', "rounds"]),
        ("optimizer.momentum=1", ['unknown key "optimizer.momentum"', "step"]),
        ("agents.0.tusk=1", ['unknown key "agents.0.tusk"', "task"]),
        ("rounds=abc", ['rounds = "abc"', "expected int"]),
        ("rounds=0", ["rounds = 0", ">= 1"]),
        ("rounds=1.5", ["rounds = 1.5", "int"]),
        ("estimator.gamma=1.0", ["estimator.gamma = 1.0", "< 1"]),
        ("estimator.kind=foo", ['estimator.kind = "foo"', '"exact"', '"reinforce"']),
        ("mixing.rule=foo", ['mixing.rule = "foo"', '"dcpg"', '"extra"']),
        ("topology.kind=foo", ['topology.kind = "foo"', '"ring"']),
        ("network=3", ["network = 3", "object"]),
        ("name=a/b", ['name = "a/b"', "letters"]),
        ("agents.1.id=drone0", ['agents.1.id = "drone0"', "also the id of agents.0"]),
        ("agents=[]", ["agents = []", "length >= 1"]),
        ("topology.kind=edges", ["topology.kind", "unconnected"]),
        ("seed", ["expected key=value"]),
        ("agents.9.id=x", ['no key "agents.9.id"']),
        ("optimizer.decay=1.5", ["optimizer.decay = 1.5", "<= 1"]),
        ("name.x=1", ['no key "name.x"']),
    ],
)
def test_a_mistake_is_one_line_with_key_value_and_what_was_expected(
    setting: str, words: list[str]
) -> None:
    with pytest.raises(ConfigError) as error:
        load(FILE, [setting])
    text = str(error.value)
    assert all(word in text for word in words), text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (
            ["optimizer.mix_moments=true"],
            "optimizer.mix_moments = true: expected estimator.mix_critic = true",
        ),
        (
            ["policy={kind='tabular'}", "training={}"],
            "estimator.mix_critic = false: expected policy.kind",
        ),
    ],
)
def test_a_critic_at_home_is_a_networks_and_so_are_its_moments(
    settings: list[str], says: str
) -> None:
    with pytest.raises(ConfigError) as error:
        load(CARTPOLE, ["estimator.mix_critic=false", *settings])
    assert says in str(error.value)


def test_no_decay_by_rounds_where_everybody_plays_its_own() -> None:
    with pytest.raises(ConfigError) as error:
        load(FILE, ["pace=async", "optimizer.decay=0.5"])
    assert 'optimizer.decay = 0.5: expected pace = "sync"' in str(error.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, ["does not exist"]),
        (b"name = ", ["is not TOML"]),
        (b"\xff\xfe", ["cannot be read"]),
        (b'name = "x"', ['"agents" is missing']),
    ],
)
def test_files_that_are_none(tmp_path: Path, content: bytes | None, words: list[str]) -> None:
    file = tmp_path / "swarm.toml"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(ConfigError) as error:
        load(file)
    assert str(file) in str(error.value)
    assert all(word in str(error.value) for word in words)
