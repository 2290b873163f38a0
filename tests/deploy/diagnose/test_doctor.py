"""What the doctor makes of what was seen: a table of facts and verdicts."""

import json
import socket
from dataclasses import replace
from pathlib import Path

import pytest

from agent.config.experiment import load
from deploy.diagnose.doctor import Check, Diagnosis, diagnose, judge, show, working
from deploy.diagnose.probe import Answer, Facts, Language, Outcome, Spoken, fits, own_port
from swarm.wire.security import Certificate

FILE = Path(__file__).parents[3] / "deploy" / "library" / "swarms" / "gridworld-a.toml"
CONFIG = load(FILE, ["name=s"])
SECURE = load(FILE, ["name=s", 'network.security={ca="c.pem",certificate="a.pem",key="a.key"}'])
NOW = 1.8e9  # [s] 2027-01-15
DAY = 86400.0  # [s]
OURS = Language(params=Spoken(1, "aaaa"), state=Spoken(1, "bbbb"))
MINE = Certificate("drone0", ("localhost", "127.0.0.1"), NOW + 100 * DAY)


def healthy(agent: str | None = None, secure: bool = False) -> Facts:
    config = SECURE if secure else CONFIG
    answers = {
        member: Answer(
            config.endpoint(member), "zenoh", "", (("s", member),), OURS.params, OURS.state, -0.004
        )
        for member in config.members
    }
    return Facts(
        config=config,
        agent=agent,
        now=NOW,
        ours=OURS,
        certificate=MINE if secure else None,
        port="taken" if agent else None,
        answers=answers,
        present=tuple(("s", member) for member in config.members),
    )


def but(facts: Facts, member: str = "drone1", **changes: object) -> Facts:
    """The same, with another answer of one member; who does not answer is not present either."""
    answer = replace(facts.answers[member], **changes)  # type: ignore[arg-type]
    present = tuple(token for token in facts.present if token[1] != member)
    return replace(facts, answers=facts.answers | {member: answer}, present=present)


def empty(facts: Facts, *tokens: tuple[str, str]) -> Facts:
    """Nobody answers; these are seen."""
    answers = {m: Answer(a.endpoint, "refused") for m, a in facts.answers.items()}
    return replace(facts, answers=answers, present=tokens)


def verdicts(facts: Facts, name: str) -> list[Check]:
    return [check for check in judge(facts) if check.name == name]


def only(facts: Facts, name: str) -> Check:
    (check,) = verdicts(facts, name)
    return check


@pytest.mark.parametrize("secure", [False, True])
@pytest.mark.parametrize("agent", [None, "drone0"])
def test_a_healthy_swarm_has_nothing_to_mend(agent: str | None, secure: bool) -> None:
    checks = list(judge(healthy(agent, secure)))
    assert all(check.ok is not False and not check.advice for check in checks)
    assert [check.ok for check in checks].count(None) == (0 if secure else 1)
    assert len(verdicts(healthy(agent, secure), "endpoint")) == (3 if agent else 4)
    assert working(healthy()) == tuple(CONFIG.endpoint(member) for member in CONFIG.members)


@pytest.mark.parametrize(
    ("certificate", "ok", "words"),
    [
        (MINE, True, "valid until 2027-04-25"),
        (replace(MINE, until=NOW + DAY), True, "renew"),
        (replace(MINE, hosts=("localhost",)), False, "--host drone0=127.0.0.1"),
        ('certificate "a.pem" has expired', False, "has expired"),
    ],
)
def test_certificate(certificate: Certificate | str, ok: bool, words: str) -> None:
    check = only(replace(healthy("drone0", secure=True), certificate=certificate), "certificate")
    assert check.ok is ok
    assert words in f"{check.found} {check.advice}"


@pytest.mark.parametrize(
    ("port", "tokens", "ok", "words"),
    [
        ("free", (), True, "drone0 does not run"),
        ("taken", (("s", "drone0"),), True, "held by drone0, which runs"),
        ("taken", (("s", "drone2"),), False, 'taken by drone2 of swarm "s"'),
        ("taken", (("t", "drone0"),), False, 'taken by drone0 of swarm "t"'),
        ("taken", (), False, "taken by a program that is no agent"),
        ("not here", (), False, "no address of this machine"),
        ("forbidden", (), False, "above 1023"),
    ],
)
def test_own_port(port: str, tokens: tuple[tuple[str, str], ...], ok: bool, words: str) -> None:
    facts = but(healthy("drone0"), "drone0", tokens=tokens)
    check = only(replace(facts, port=port), "own port")  # type: ignore[arg-type]
    assert check.ok is ok
    assert bool(check.advice) is not ok
    assert words in f"{check.found} {check.advice}"


@pytest.mark.parametrize(
    ("outcome", "words"),
    [
        ("unresolved", "host is not known"),
        ("refused", "start the agent"),
        ("silent", "open TCP port 7451"),
        ("unreachable", "not reachable"),
        ("tls only", "add [network.security]"),
        ("not tls", "does not speak TLS"),
        ("foreign", "swarm certs"),
        ("other host", "--host drone1=127.0.0.1"),
        ("rejects us", "refuses our certificate"),
        ("stranger", "another program"),
    ],
)
def test_an_endpoint_that_fails_says_why_and_what_to_do(outcome: Outcome, words: str) -> None:
    facts = but(healthy(), outcome=outcome, detail="because", tokens=())
    first, second, *_ = verdicts(facts, "endpoint")
    assert first.ok is True
    assert second.ok is False
    assert "drone1 at tcp/127.0.0.1:7451: " in second.found
    assert "(because)" in second.found
    assert words in f"{second.found} {second.advice}"
    assert second.advice
    assert facts.answers["drone1"].endpoint not in working(facts)
    assert only(facts, "members").ok is False


@pytest.mark.parametrize(
    ("tokens", "words"),
    [
        ((("s", "drone2"),), "the same file"),
        ((("t", "drone1"),), 'set name = "t" here, or name = "s" there'),
        ((), "no agent is announced"),
    ],
)
def test_somebody_else_at_an_endpoint(tokens: tuple[tuple[str, str], ...], words: str) -> None:
    check = verdicts(but(healthy(), tokens=tokens), "endpoint")[1]
    assert check.ok is False
    assert words in f"{check.found} {check.advice}"


def test_a_clock_that_is_not_set_is_said() -> None:
    facts = replace(healthy("drone0", secure=True), certificate="not valid yet", early=True)
    check = only(facts, "certificate")
    assert (check.ok, check.advice.split(" (")[0]) == (False, "set the clock")


def test_without_a_certificate_endpoints_and_members_are_left_open() -> None:
    facts = replace(empty(healthy(secure=True)), certificate="it is gone")
    answers = {m: Answer(a.endpoint, "untried") for m, a in facts.answers.items()}
    facts = replace(facts, answers=answers)
    assert [check.ok for check in judge(facts) if check.ok is not None] == [True, False]


def test_members_names_the_absent_and_other_swarms() -> None:
    check = only(but(healthy(), outcome="refused", tokens=()), "members")
    assert (check.ok, check.found) == (False, "drone0, drone2, drone3 present; drone1 absent")
    check = only(empty(healthy(), ("t", "drone0"), ("t", "drone5")), "members")
    assert check.ok is False
    assert 'other swarms here: drone0, drone5 of swarm "t"' in check.found
    assert 'set name = "t" here, or name = "s" there' in check.advice
    check = only(replace(healthy(), present=(*healthy().present, ("t", "x"))), "members")
    assert check.ok is True  # two swarms may share a network
    assert 'x of swarm "t"' in check.found


def test_the_agent_itself_need_not_run() -> None:
    facts = replace(but(healthy("drone1"), outcome="refused", tokens=()), port="free")
    assert all(check.ok is not False for check in judge(facts))


@pytest.mark.parametrize(
    ("params", "state", "ok", "words"),
    [
        (Spoken(2, "aaaa"), Spoken(2, "bbbb"), False, "drone1 speaks protocol 2, we 1"),
        (Spoken(1, "cccc"), Spoken(1, "bbbb"), False, "drone1 has layout cccc, we aaaa"),
        (Spoken(1, "cccc"), Spoken(1, "dddd"), False, "drone1 has layout dddd, we bbbb"),
        (None, Spoken(1, "bbbb"), True, "as this file"),
    ],
)
def test_layouts(params: Spoken | None, state: Spoken, ok: bool, words: str) -> None:
    check = only(but(healthy(), params=params, state=state), "layout")
    assert check.ok is ok
    assert words in check.found
    assert check.found.count("drone1") == 1
    assert bool(check.advice) is not ok


@pytest.mark.parametrize(("clock", "ok"), [(0.4, True), (-70.0, False), (70.0, False)])
def test_clocks(clock: float, ok: bool) -> None:
    check = only(but(healthy(), clock=clock), "clock")
    assert check.ok is ok
    assert f"drone1 {clock:+.1f} s" in check.found


def test_what_cannot_be_learned_is_neither_passed_nor_failed() -> None:
    assert only(empty(healthy()), "layout").ok is None
    assert only(empty(healthy()), "clock").ok is None


@pytest.mark.parametrize(
    ("echo", "hellos", "ok", "words"),
    [
        (True, ("tcp/10.0.0.7:7450",), True, "hello from tcp/10.0.0.7:7450"),
        (True, (), False, "the network drops multicast"),
        (False, (), False, 'network.discovery = "endpoints"'),
    ],
)
def test_multicast(echo: bool, hellos: tuple[str, ...], ok: bool, words: str) -> None:
    check = only(replace(healthy(), echo=echo, hellos=hellos), "multicast")
    assert check.ok is ok
    assert words in f"{check.found} {check.advice}"
    assert not verdicts(healthy(), "multicast")  # not used: not told


@pytest.mark.parametrize(
    ("host", "fit"), [("127.0.0.1", True), ("LAB.local", True), ("10.0.0.7", False)]
)
def test_names_of_a_certificate(host: str, fit: bool) -> None:
    assert fits(host, ("localhost", "127.0.0.1", "lab.local")) is fit


def test_own_port_looks_at_the_machine() -> None:
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        holder.listen()
        port = holder.getsockname()[1]
        assert own_port(f"tcp/127.0.0.1:{port}") == "taken"
    assert own_port(f"tcp/127.0.0.1:{port}") == "free"
    assert own_port("tcp/192.0.2.1:7450") == "not here"  # RFC 5737: nobody's
    assert own_port("tcp/no-such-host.invalid:7450") == "not here"


@pytest.mark.parametrize(
    ("settings", "agent", "words"),
    [
        (["rounds=x"], None, 'rounds = "x": expected int'),
        ([], "drone9", 'no agent "drone9"'),
        (["agents.1.endpoint=nonsense"], None, 'endpoint "nonsense"'),
        (["agents.0.task.kwargs.layout=z"], None, "expected one of a, b, c"),
    ],
)
def test_a_file_that_is_wrong_is_all_that_is_told(
    settings: list[str], agent: str | None, words: str
) -> None:
    diagnosis = diagnose(FILE, settings, agent, 1.0)
    (check,) = diagnosis.checks
    assert (check.name, check.ok, diagnosis.healthy) == ("file", False, False)
    assert words in check.found


def test_printing_marks_each_line_and_gives_each_advice_once(
    capsys: pytest.CaptureFixture[str],
) -> None:
    checks = (Check("a", True, "fine"), Check("b", False, "bad [x]", "mend [x]"))
    diagnosis = Diagnosis(
        swarm="s", agent=None, healthy=False, checks=(*checks, checks[1]), endpoints=("tcp/h:1",)
    )
    assert show(diagnosis, as_json=False) == 1
    assert capsys.readouterr().out.splitlines() == [
        "✓ a           fine",
        "✗ b           bad [x]",
        "✗ b           bad [x]",
        "working endpoints: tcp/h:1",
        "→ mend [x]",
    ]
    assert show(diagnosis, as_json=True) == 1
    assert json.loads(capsys.readouterr().out)["endpoints"] == ["tcp/h:1"]
