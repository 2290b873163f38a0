"""Chaos files: read strictly, planned in order, never longer than they say."""

import signal
from pathlib import Path

import pytest

from agent.config import load
from deploy.chaos import Chaos, Fault, host_of, load_faults, plan
from swarm.errors import ConfigError

FILE = Path(__file__).parents[2] / "deploy" / "swarms" / "gridworld-a.toml"
HOSTS = [
    f'agents.{i}={{id="d{i}",task={{env="sim:GridWorld-v0"}},namespace="h{i}",device="eth",'
    f'endpoint="tcp/10.0.0.{i}:7450"}}'
    for i in range(4)
]


def test_a_fault_is_one_action_or_two() -> None:
    (kill,) = plan(Fault(at=3.0, kind="kill", agents=("drone0",)), load(FILE))
    assert (kill.at, kill.label) == (0.0, "kill drone0")
    assert kill.signals == (("drone0", signal.SIGKILL),)
    freeze, thaw = plan(Fault(kind="freeze", agents=("drone1", "drone2"), seconds=4.0), load(FILE))
    assert freeze.signals == (("drone1", signal.SIGSTOP), ("drone2", signal.SIGSTOP))
    assert (thaw.at, thaw.label) == (4.0, "end of freeze drone1, drone2")


def test_slow_stops_for_all_but_one_factor_th_and_ends_running() -> None:
    fault = Fault(kind="slow", agents=("drone0",), seconds=1.0, factor=5.0)
    actions = plan(fault, load(FILE))
    stops = [a.at for a in actions if a.signals[0][1] == signal.SIGSTOP]
    goes = [a.at for a in actions if a.signals[0][1] == signal.SIGCONT]
    assert sum(goes) - sum(stops) == pytest.approx(0.8)
    assert actions[-1].signals[0][1] == signal.SIGCONT
    assert actions[-1].label == "end of slow drone0"


def test_a_partition_cuts_both_directions_to_everybody_else_and_mends_them() -> None:
    config = load(FILE, HOSTS)
    start, stop = plan(Fault(kind="partition", agents=("d0", "d1")), config)
    lines = [" ".join(command) for command in start.commands]
    assert "ip netns exec h0 iptables -A INPUT -s 10.0.0.2 -j DROP" in lines
    assert "ip netns exec h1 iptables -A OUTPUT -d 10.0.0.3 -j DROP" in lines
    assert len(lines) == 2 * 2 * 2
    undone = [" ".join(command).replace(" -D ", " -A ") for command in stop.commands]
    assert undone == lines


def test_nothing_happens_before_its_time_and_each_thing_once() -> None:
    faults = [
        Fault(at=1.0, kind="kill", agents=("drone0",)),
        Fault(round=50, kind="freeze", agents=("drone1",), seconds=2.0),
    ]
    chaos = Chaos(load(FILE), faults)
    assert chaos.advance(100.0, 70, {}) == []  # the clock has not started
    chaos.started = 100.0
    assert chaos.advance(100.9, 0, {}) == []
    assert chaos.advance(101.0, 10, {}) == ["kill drone0"]  # nobody to kill: it is not running
    assert chaos.advance(102.0, 50, {}) == ["freeze drone1"]
    assert chaos.advance(103.9, 60, {}) == []
    assert chaos.advance(104.0, 60, {}) == ["end of freeze drone1"]
    assert chaos.advance(999.0, 99, {}) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[fault]]\nat = 1\nkind = "flood"\nagents = ["drone0"]', '"flood": expected one of'),
        ('[[fault]]\nat = 1\nkind = "kill"\nagents = ["x"]', 'no agent "x"'),
        ('[[fault]]\nat = -1\nkind = "kill"\nagents = ["drone0"]', "fault.0.at = -1"),
        ('[[fault]]\nat = 1\nkind = "kill"\nagents = []', "length >= 1"),
        ('[[fault]]\nat = 1\nkind = "loss"\nagents = ["drone0"]', "needs a network namespace"),
        ("[fault]", "fault = "),
    ],
)
def test_a_mistake_is_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "chaos.toml"
    file.write_text(text)
    with pytest.raises(ConfigError) as error:
        load_faults(file, load(FILE))
    assert words in str(error.value)


def test_the_address_of_an_endpoint() -> None:
    assert host_of("tcp/10.77.0.1:7450") == "10.77.0.1"
    assert host_of("tls/[fe80::1]:7450") == "fe80::1"
    with pytest.raises(ConfigError, match="protocol/host:port"):
        host_of("10.77.0.1")
