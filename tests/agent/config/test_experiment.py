"""Swarm files: read strictly, overridden, and refused in one line that says why."""

import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import msgspec
import pytest
from msgspec import inspect as types

from agent.config.experiment import SwarmFile, load
from agent.learning.estimators import A2C, Exact
from agent.learning.optimizers import Sgd
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
        ("network.base_port=99999", ["network.base_port = 99999", "<= 65535"]),
        ("network.base_port=65533", ["network.base_port = 65533", "at most 65532 for 4"]),
        ("network.base_port=0", ["network.base_port = 0", ">= 1"]),
        ("network.lease_ms=-1", ["network.lease_ms = -1", ">= 100"]),
        ("network.host=tcp://10.0.0.1", ['network.host = "tcp://10.0.0.1"', '"10.0.0.1"']),
        ("network.listen=udp/0.0.0.0:7450", ["network.listen", "expected tcp/0.0.0.0:7450"]),
        ("agents.0.endpoint=tcp://a:1", ["agents.0.endpoint", "expected tcp/a:1"]),
        ("loss.probability=7", ["loss.probability = 7", "<= 1"]),
        ("loss.seed=-1", ["loss.seed = -1", ">= 0"]),
        ("timing.round=-1", ["timing.round = -1", "> 0"]),
        ("timing.beat=0", ["timing.beat = 0", "> 0"]),
        ("timing.round=inf", ["timing.round = inf", "finite"]),
        ("topology.radius=-1", ["topology.radius = -1", "> 0"]),
        ("optimizer.step=nan", ["optimizer.step = nan", "finite"]),
        ("optimizer.step=inf", ["optimizer.step = inf", "finite"]),
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


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    for name, content in (
        ("swarm.toml", FILE.read_bytes()),
        ("config.json", msgspec.json.encode(load(FILE))),
    ):
        (tmp_path / name).write_bytes(b"\xef\xbb\xbf" + content)
        assert load(tmp_path / name) == load(FILE)


def test_an_address_of_ipv6_gets_its_brackets() -> None:
    for host in ("::1", "[::1]"):
        assert load(FILE, [f'network.host="{host}"']).endpoint("drone1") == "tcp/[::1]:7451"


def numbers(kind: types.Type, key: str) -> Iterator[tuple[str, types.IntType | types.FloatType]]:
    """Every number of a type, by its key."""
    match kind:
        case types.IntType() | types.FloatType():
            yield key, kind
        case types.UnionType():
            for option in kind.types:
                yield from numbers(option, key)
        case types.StructType():
            for field in kind.fields:
                yield from numbers(field.type, f"{key}.{field.encode_name}".strip("."))
        case types.VarTupleType():
            yield from numbers(kind.item_type, key)


@pytest.mark.parametrize(
    ("key", "kind"),
    list(numbers(types.type_info(SwarmFile), "")),
    ids=lambda value: str(value)[:30],
)
def test_every_number_of_a_swarm_file_has_a_lower_bound(
    key: str, kind: types.IntType | types.FloatType
) -> None:
    assert kind.ge is not None or kind.gt is not None, key


def test_a_new_kind_drops_what_it_does_not_know_with_a_word(
    caplog: pytest.LogCaptureFixture,
) -> None:
    config = load(CARTPOLE, ["estimator.kind=a2c", "rounds=200"])
    assert isinstance(config.estimator, A2C)
    assert config.estimator.trace == 0.95  # what both kinds know stays
    assert [record.message for record in caplog.records] == [
        "estimator.kind = a2c: dropped epochs of ppo"
    ]
    caplog.clear()
    kinds = ["optimizer.kind=sgd", "policy.kind=c3f2", "estimator.kind=reinforce"]
    assert isinstance(load(CARTPOLE, kinds).optimizer, Sgd)
    assert [record.message for record in caplog.records] == [
        "estimator.kind = reinforce: dropped trace, epochs of ppo"
    ]


def test_keys_that_were_set_and_do_not_fit_are_mistakes() -> None:
    with pytest.raises(ConfigError, match=r'unknown key "estimator\.epochs"'):
        load(CARTPOLE, ["estimator.kind=a2c", "estimator.epochs=2"])
    with pytest.raises(ConfigError, match=r"estimator\.kind"):
        load(CARTPOLE, ["estimator.kind=nonsense"])
    with pytest.raises(ConfigError, match=r'unknown key "estimator\.epochs"'):
        load(CARTPOLE, ["estimator={kind='a2c', epochs=2}"])


TASKS = """\
name = "mine"
estimator = { kind = "a2c" }
policy = { kind = "network" }
[[agents]]
id = "a"
task = { env = "MODULE:Lift-v0", kwargs = { mesh = "rooms/one.obj", more = ["x.txt", "no.txt"] } }
"""


def test_paths_and_modules_count_from_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project, elsewhere = tmp_path / "project", tmp_path / "elsewhere"
    (project / "rooms").mkdir(parents=True)
    elsewhere.mkdir()
    for file in (project / "rooms" / "one.obj", elsewhere / "x.txt"):
        file.write_text("")
    (project / "lifts_of_this_test.py").write_text("")
    file = project / "mine.toml"
    file.write_text(TASKS.replace("MODULE", "lifts_of_this_test"))
    monkeypatch.chdir(elsewhere)
    monkeypatch.setattr("sys.path", list(sys.path))
    config = load(file)
    kwargs = config.agents[0].task.kwargs
    assert kwargs["mesh"] == str(project / "rooms" / "one.obj")
    assert kwargs["more"] == [str(elsewhere / "x.txt"), "no.txt"]
    assert config.modules == (str(project), str(elsewhere))
    assert sys.path[-2:] == [str(project), str(elsewhere)]  # nothing installed is hidden
    assert import_module("lifts_of_this_test").__file__ == str(project / "lifts_of_this_test.py")
    run = tmp_path / "run"
    run.mkdir()
    (run / "config.json").write_bytes(msgspec.json.encode(config))
    monkeypatch.chdir(tmp_path)
    assert load(run / "config.json") == config  # a run goes on from anywhere


def test_what_is_installed_is_not_looked_for_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    before = list(sys.path)
    assert load(CARTPOLE).modules == ()
    assert sys.path == before
