"""Chaos files: read strictly, planned in order, never longer than they say."""

import math
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from agent.config.experiment import SwarmFile, load
from deploy.chaos import clocks
from deploy.chaos.actions import plan
from deploy.chaos.clocks import Clocks
from deploy.chaos.faults import Fault, load_faults
from deploy.chaos.runner import Chaos
from swarm.errors import ConfigError

DEPLOY = Path(__file__).parents[3] / "deploy"
FILE = DEPLOY / "library" / "swarms" / "gridworld-a.toml"
SWARMS = sorted((DEPLOY / "library" / "swarms").glob("*.toml"))
CHAOS_FILES = sorted((DEPLOY / "library" / "faults").glob("*.toml"))
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


def test_nothing_happens_before_its_time_and_each_thing_once(tmp_path: Path) -> None:
    faults = [
        Fault(at=1.0, kind="kill", agents=("drone0",)),
        Fault(round=50, kind="freeze", agents=("drone1",), seconds=2.0),
    ]
    chaos = Chaos(load(FILE), faults, Clocks(tmp_path, frozenset()))
    assert chaos.advance(100.0, 70, {}) == []  # the clock has not started
    chaos.started = 100.0
    assert chaos.advance(100.9, 0, {}) == []
    assert chaos.advance(101.0, 10, {}) == ["kill drone0"]  # nobody to kill: it is not running
    assert chaos.advance(102.0, 50, {}) == ["freeze drone1"]
    assert chaos.advance(103.9, 60, {}) == []
    assert chaos.advance(104.0, 60, {}) == ["end of freeze drone1"]
    assert chaos.advance(999.0, 99, {}) == []


def test_a_process_that_has_just_ended_takes_no_signal(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    chaos = Chaos(
        load(FILE),
        [Fault(kind="freeze", agents=("drone0",), seconds=2.0)],
        Clocks(tmp_path, frozenset()),
    )
    chaos.started = 100.0
    pids = {"drone0": ended.pid}
    assert chaos.advance(100.0, 0, pids) == ["freeze drone0"]
    chaos.undo(pids)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[fault]]\nat = 1\nkind = "flood"\nagents = ["drone0"]', '"flood": expected one of'),
        ('[[fault]]\nat = 1\nkind = "kill"\nagents = ["x"]', 'no agent "x"'),
        ('[[fault]]\nat = -1\nkind = "kill"\nagents = ["drone0"]', "fault.0.at = -1"),
        ('[[fault]]\nat = 1\nkind = "kill"\nagents = []', "length >= 1"),
        ('[[fault]]\nat = 1\nkind = "loss"\nagents = ["drone0"]', "needs a network namespace"),
        ("[fault]", "fault = "),
        ('[[fault]]\nat = "100%"\nkind = "kill"\nagents = ["*"]', 'at = "100%": expected a share'),
        ('[[fault]]\nat = "soon"\nkind = "kill"\nagents = ["*"]', 'at = "soon": expected a share'),
        ('[[fault]]\nround = 1000\nkind = "kill"\nagents = ["*"]', "round = 1000 is when"),
        ('[[fault]]\nkind = "kill"\nagents = ["@third"]', "one of *, @first, @last, @half"),
        (
            '[[fault]]\nat = "50%"\nuntil = "40%"\nkind = "kill"\nagents = ["*"]',
            'until = "40%" is round 400: expected after round 500',
        ),
        ('[[fault]]\nkind = "freeze"\nseconds = -1\nagents = ["*"]', "fault.0.seconds = -1"),
        ('[[fault]]\nkind = "freeze"\nseconds = nan\nagents = ["*"]', "fault.0.seconds = nan"),
    ],
)
def test_a_mistake_is_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "chaos.toml"
    file.write_text(text)
    with pytest.raises(ConfigError) as error:
        load_faults(file, load(FILE))
    assert words in str(error.value)


def on_hosts(config: SwarmFile) -> SwarmFile:
    """The swarm with every agent in a namespace of its own, where the network's faults need it."""
    agents = tuple(
        replace(agent, namespace=f"h{i}", device="eth", endpoint=f"tcp/10.0.0.{i}:7450")
        for i, agent in enumerate(config.agents)
    )
    return replace(config, agents=agents)


@pytest.mark.parametrize("swarm", SWARMS, ids=lambda file: file.stem)
@pytest.mark.parametrize("file", CHAOS_FILES, ids=lambda file: file.stem)
def test_every_chaos_file_does_something_to_every_swarm(
    file: Path, swarm: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clocks, "why_not", lambda: None)
    config = on_hosts(load(swarm))
    if file.stem == "partition" and len(config.members) == 1:
        with pytest.raises(ConfigError, match="expected one on the other side"):
            load_faults(file, config)
        return
    faults = load_faults(file, config)
    assert faults
    for fault in faults:
        assert fault.round < config.rounds
        assert fault.agents
        assert set(fault.agents) <= set(config.members)
        actions = plan(fault, config)
        assert any(action.signals or action.commands or action.jumps for action in actions)


@pytest.mark.parametrize(
    ("agents", "meant"),
    [
        (["*"], "drone0 drone1 drone2 drone3"),
        (["@first"], "drone0"),
        (["@last"], "drone3"),
        (["@half"], "drone0 drone1"),
        (["@half", "drone1", "@last"], "drone0 drone1 drone3"),
    ],
)
def test_places_name_agents_of_any_swarm(tmp_path: Path, agents: list[str], meant: str) -> None:
    file = tmp_path / "chaos.toml"
    file.write_text(f'[[fault]]\nkind = "freeze"\nagents = {agents}')
    (fault,) = load_faults(file, load(FILE))
    assert fault.agents == tuple(meant.split())


def test_until_takes_them_in_turn_and_shares_count_rounds(tmp_path: Path) -> None:
    file = tmp_path / "chaos.toml"
    file.write_text(
        '[[fault]]\nat = "10%"\nuntil = "40%"\nkind = "restart"\nagents = ["*"]\n'
        '[[fault]]\nat = "12.5 %"\nkind = "kill"\nagents = ["drone1"]'
    )
    *faults, kill = load_faults(file, load(FILE))
    assert [fault.agents for fault in faults] == [(f"drone{i}",) for i in range(4)]
    assert [fault.round for fault in faults] == [100, 200, 300, 400]
    assert (kill.round, kill.at) == (125, 0.0)


def test_a_launcher_that_is_late_keeps_the_times_between_stop_and_go(tmp_path: Path) -> None:
    faults = [Fault(kind="slow", agents=("drone0",), seconds=10.0, factor=5)]
    chaos = Chaos(load(FILE), faults, Clocks(tmp_path, frozenset()), started=0.0)
    assert chaos.wait(0.5) == math.inf
    chaos.advance(1.0, 0, {})  # stop
    assert chaos.wait(1.0) == pytest.approx(0.16)
    chaos.advance(1.3, 0, {})  # go, 0.14 s late, and no stop at once
    assert chaos.wait(1.3) == pytest.approx(0.04)
    chaos.advance(1.35, 0, {})
    assert chaos.wait(1.35) == pytest.approx(0.16)


def test_who_comes_back_late_puts_the_next_one_off(tmp_path: Path) -> None:
    faults = [
        Fault(round=100 + 50 * i, kind="restart", agents=(f"drone{i}",), apart=50) for i in range(3)
    ]
    chaos = Chaos(load(FILE), faults, Clocks(tmp_path, frozenset()), started=0.0)
    assert chaos.advance(1.0, 100, {}) == ["restart drone0"]
    assert chaos.advance(2.0, 190, {}) == ["restart drone1"]
    assert chaos.advance(3.0, 239, {}) == []
    assert chaos.advance(4.0, 240, {}) == ["restart drone2"]
    assert chaos.advance(5.0, 999, {}) == []


def test_of_those_that_are_due_at_once_only_the_first_comes(tmp_path: Path) -> None:
    faults = [
        Fault(round=100 + 50 * i, kind="restart", agents=(f"drone{i}",), apart=50) for i in range(3)
    ]
    chaos = Chaos(load(FILE), faults, Clocks(tmp_path, frozenset()), started=0.0)
    assert chaos.advance(1.0, 500, {}) == ["restart drone0"]
    assert chaos.advance(2.0, 600, {}) == ["restart drone1"]


def test_a_clock_jumps_from_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clocks, "library", lambda: Path("/lib/libfaketime.so"))
    held = Clocks(tmp_path / "clocks", frozenset({"drone1"}))
    assert held.environment("drone0") == {}
    variables = held.environment("drone1")
    assert variables["LD_PRELOAD"] == "/lib/libfaketime.so"
    assert variables["FAKETIME_DONT_FAKE_MONOTONIC"] == "1"
    faults = [Fault(kind="clock", agents=("drone1",), by=by) for by in (3600.0, -7200.0)]
    chaos = Chaos(load(FILE), faults, held, started=0.0)
    labels = chaos.advance(1.0, 0, {})
    assert labels == ["clock drone1 by +3600 s", "clock drone1 by -7200 s"]
    file = Path(variables["FAKETIME_TIMESTAMP_FILE"])
    assert float(file.read_text()) == -3600.0
    held.environment("drone1")  # started again, on the same host
    assert float(file.read_text()) == -3600.0


def test_without_libfaketime_one_line_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clocks, "library", lambda: None)
    file = tmp_path / "chaos.toml"
    file.write_text('[[fault]]\nkind = "clock"\nagents = ["drone0"]')
    with pytest.raises(ConfigError, match=r'"clock": libfaketime is not installed'):
        load_faults(file, load(FILE))
