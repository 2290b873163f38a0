"""What ``swarm compose`` writes, and the one that is kept."""

import shlex
import shutil
import subprocess
from pathlib import Path

import msgspec
import pytest
import yaml

from agent.config.experiment import AgentEntry, SwarmFile, Task, load
from agent.learning.estimators import A2C, Exact
from agent.learning.policies import C3F2
from deploy.images.compose import BODY, compose_file, in_containers
from deploy.images.health import is_read
from swarm.errors import ConfigError
from swarm.wire.security import Security
from tests.integration.harness import ROOT

GRID = Task("sim:GridWorld-v0", {"layout": "a", "task": 0})


def swarm_of(*ids: str, task: Task = GRID) -> SwarmFile:
    agents = tuple(AgentEntry(name, task) for name in ids)
    return SwarmFile(name="Test.1", estimator=Exact(), agents=agents)


def inside(text: str, path: Path) -> SwarmFile:
    """The swarm file that travels in a compose file, as an agent reads it."""
    path.write_text(yaml.safe_load(text)["configs"]["swarm"]["content"].replace("$$", "$"))
    return load(path)


def test_the_one_that_is_kept_is_what_its_first_line_says() -> None:
    kept = (ROOT / "deploy" / "images" / "compose.yaml").read_text()
    words = shlex.split(kept.splitlines()[0].removeprefix("# Written by: swarm compose "))
    file, settings = words[0], [word for word in words[1:] if word != "--set"]
    source = shlex.join(words)
    assert compose_file(load(ROOT / file, settings), source, "../..") == kept


@pytest.mark.parametrize("count", [1, 4, 12])
def test_every_agent_has_a_container_and_a_name_to_be_dialled(count: int, tmp_path: Path) -> None:
    config = swarm_of(*(f"d{i}" for i in range(count)))
    text = compose_file(config, "test.toml", ".")
    tables = yaml.safe_load(text)
    services = tables["services"]
    assert set(services) == {*config.members, "viewer"}  # nobody flies, so there is no vehicle
    for member in config.members:
        assert services[member]["command"] == ["--id", member]
        assert services[member]["networks"]["swarm"]["aliases"] == [f"agent-{member}"]
        assert services[member]["image"] == "dcpg-swarm-agent:tabular"
    assert [name for name, service in services.items() if "build" in service] == ["d0", "viewer"]
    assert tables["name"] == "test-1"
    found = inside(text, tmp_path / "swarm.json")
    assert found == in_containers(config)
    assert found.endpoint("d0") == "tcp/agent-d0:7447"
    assert found.network.listen == "tcp/0.0.0.0:7447"
    assert found.network.gossip


WORDS = ("1", "n", "no", "on", "null", "0x10", "1e3", "1.5", "0755", "true", "0o17", "1_0", "NaN")


def test_ids_that_yaml_reads_as_something_else_stay_what_they_are(tmp_path: Path) -> None:
    config = swarm_of(*WORDS)
    text = compose_file(config, "test.toml", ".")
    tables = yaml.safe_load(text)  # of YAML 1.1; for that of 1.2, all of them are quoted
    assert set(tables["services"]) == {*WORDS, "viewer"}
    assert set(tables["volumes"]) == set(WORDS)
    for word in WORDS:
        assert f"\n  '{word}':\n" in text
        assert tables["services"][word]["command"] == ["--id", word]
        assert tables["services"][word]["volumes"][0]["source"] == word
    assert inside(text, tmp_path / "swarm.json").members == WORDS
    if shutil.which("docker"):
        (tmp_path / "compose.yaml").write_text(text)
        done = subprocess.run(
            ["docker", "compose", "-f", tmp_path / "compose.yaml", "config", "--services"],
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert set(done.stdout.split()) == {*WORDS, "viewer"}, done.stderr


def test_a_line_break_in_a_setting_stays_in_the_comment() -> None:
    text = compose_file(swarm_of("d0"), "a.toml --set 'x=1\nservices: {}'", ".")
    assert list(yaml.safe_load(text)["services"]) == ["d0", "viewer"]


@pytest.mark.parametrize(
    ("body", "options", "flavour"),
    [
        (BODY, {"vehicle": "udpin:0.0.0.0:14540", "speed": 0.5}, "px4"),
        ("mavlink", {"system": 7, "flavour": "ardupilot"}, "ardupilot"),
    ],
)
def test_who_flies_a_vehicle_flies_the_one_beside_it(
    body: str, options: dict[str, object], flavour: str
) -> None:
    kwargs = {"scene": "indoor-long", "body": body, "body_options": options}
    config = swarm_of("d0", task=Task("sim:IndoorFlight-v0", kwargs))
    flown = in_containers(config).agents[0].task.kwargs
    kept = {"speed": 0.5} if body == BODY else {}
    assert flown["body"] == BODY
    assert flown["body_options"] == kept | {"vehicle": "udpout:d0-vehicle:14580"}
    services = yaml.safe_load(compose_file(config, "test.toml", "."))["services"]
    assert services["d0"]["depends_on"] == ["d0-vehicle"]
    command = services["d0-vehicle"]["command"]
    assert command[-4:] == ["--flavour", flavour, "--scene", "indoor-long"]
    assert command[:2] == ["--sysid", "1"]
    assert services["d0-vehicle"]["build"]["target"] == "vehicle"
    assert services["d0"]["build"]["args"]["WORLDS"] == "indoor-long"


def test_a_network_gets_the_image_with_pytorch() -> None:
    config = msgspec.structs.replace(swarm_of("d0"), policy=C3F2(), estimator=A2C())
    text = compose_file(config, "test.toml", ".")
    assert "POLICY: neural" in text
    assert "dcpg-swarm-agent:neural" in text


def test_a_dollar_is_kept_from_compose(tmp_path: Path) -> None:
    config = swarm_of("d0", task=Task("sim:GridWorld-v0", {"layout": "${HOME}"}))
    text = compose_file(config, "test.toml", ".")
    assert "$${HOME}" in text
    assert inside(text, tmp_path / "swarm.json").agents[0].task.kwargs == {"layout": "${HOME}"}


FLIGHT = Task("sim:IndoorFlight-v0", {"scene": "indoor-long", "body": "mavlink"})


@pytest.mark.parametrize(("ids", "task"), [(("viewer",), GRID), (("a", "a-vehicle"), FLIGHT)])
def test_a_name_is_given_once(ids: tuple[str, ...], task: Task) -> None:
    with pytest.raises(ConfigError, match="no other service"):
        in_containers(swarm_of(*ids, task=task))


def test_security_is_not_lost_silently() -> None:
    config = swarm_of("d0")
    network = msgspec.structs.replace(config.network, security=Security(users="users.txt"))
    with pytest.raises(ConfigError, match=r"network\.security: expected none"):
        in_containers(msgspec.structs.replace(config, network=network))


def test_a_socket_is_well_while_it_is_read() -> None:
    table = (
        "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt\n"
        " 8644: 00000000:38F4 00000000:0000 07 00000000:{:08X} 00:00000000 00000000\n"
    )
    assert is_read(14580, table.format(0))
    assert not is_read(14580, table.format(200_000))
    assert not is_read(14540, table.format(0))
