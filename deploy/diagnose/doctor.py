"""``swarm doctor``: why an agent sees nobody, and what to change.

:mod:`deploy.diagnose.probe` collects facts; :func:`judge` turns them into checks, one line each,
without looking at anything itself.  A check that cannot be made says so and is neither passed nor
failed.
"""

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import msgspec
from rich.console import Console
from rich.text import Text

from agent.config.experiment import SwarmFile
from deploy.diagnose.probe import Answer, Facts, Outcome, Token, examine, fits, language
from deploy.launch.preparation import check_tasks
from deploy.observe.status import find_config
from swarm.errors import ConfigError
from swarm.wire.endpoints import host_and_port

CLOCKS = 1.0  # [s] more than that is told: recordings are laid over each other by time; a guess
EXPIRES_SOON = 14 * 86400.0  # [s] said so long before
MARKS = {True: ("✓", "green"), False: ("✗", "red"), None: ("·", "dim")}


class Check(msgspec.Struct, frozen=True):
    """One line.

    Attributes:
        name: what was looked at.
        ok: passed, failed, or (None) not to be told.
        found: what was seen.
        advice: what to change.
    """

    name: str
    ok: bool | None
    found: str
    advice: str = ""


class Diagnosis(msgspec.Struct, frozen=True, kw_only=True):
    """What ``swarm doctor --json`` prints.

    Attributes:
        swarm: its name.
        agent: on whose behalf.
        healthy: no check failed.
        checks: every check.
        endpoints: those at which agents of this swarm answer.
    """

    swarm: str
    agent: str | None
    healthy: bool
    checks: tuple[Check, ...]
    endpoints: tuple[str, ...] = ()


def diagnose(
    path: Path | None, settings: Iterable[str], agent: str | None, timeout: float
) -> Diagnosis:
    """Look at a swarm file or run folder and its network."""
    try:
        config = find_config(path, settings).config
        if agent is not None:
            config.index(agent)
        for member in config.members:
            host_and_port(config.endpoint(member))
        check_tasks(config)
        ours = language(config)
    except ConfigError as error:
        check = Check("file", False, str(error), "correct it; the other checks come after")
        return Diagnosis(swarm="", agent=agent, healthy=False, checks=(check,))
    facts = examine(config, agent, ours, timeout)
    checks = tuple(judge(facts))
    return Diagnosis(
        swarm=config.name,
        agent=agent,
        healthy=all(check.ok is not False for check in checks),
        checks=checks,
        endpoints=working(facts),
    )


def working(facts: Facts) -> tuple[str, ...]:
    """Endpoints at which an agent of this swarm answered."""
    name = facts.config.name
    return tuple(
        answer.endpoint
        for answer in facts.answers.values()
        if any(swarm == name for swarm, _ in answer.tokens)
    )


def judge(facts: Facts) -> Iterator[Check]:
    """All checks, in the order in which they should be mended."""
    config, ours = facts.config, facts.ours.params
    what = f"protocol {ours.version}, layout {ours.fingerprint}"
    yield Check("file", True, f'swarm "{config.name}" of {len(config.members)} agents, {what}')
    yield judge_security(facts)
    if facts.agent is not None:
        yield judge_port(facts, facts.agent)
    for member, answer in facts.answers.items():
        if member != facts.agent:
            yield judge_endpoint(config, member, answer)
    if facts.echo is not None:
        yield judge_multicast(facts)
    yield judge_members(facts)
    yield judge_layouts(facts)
    yield judge_clocks(facts)


def judge_security(facts: Facts) -> Check:
    """The own certificate or password."""
    name, security, found = "certificate", facts.config.network.security, facts.certificate
    if isinstance(found, str):
        advice = "make it with swarm certs, or correct [network.security]"
        if facts.early:
            advice = "set the clock (timedatectl set-ntp true); an agent waits for it, then starts"
        return Check(name, False, found, advice)
    if found is None:
        text = (
            "passwords, no TLS" if security.users else "no TLS: whoever reaches a port takes part"
        )
        return Check(name, None, text)
    until = datetime.fromtimestamp(found.until, UTC)
    text = f'"{found.name}" of our authority, valid until {until:%Y-%m-%d}'
    if facts.agent is not None:
        host, _ = host_and_port(facts.config.endpoint(facts.agent))
        if not fits(host, found.hosts):
            return Check(
                name,
                False,
                f"{text}, but not for {host} (for {', '.join(found.hosts)})",
                f"swarm certs --force --host {facts.agent}={host}",
            )
    soon = found.until - facts.now < EXPIRES_SOON
    return Check(name, True, text, "soon: renew with swarm certs --force" if soon else "")


def judge_port(facts: Facts, agent: str) -> Check:
    """The agent's own endpoint: free, its own, or somebody else's."""
    name, answer = "own port", facts.answers[agent]
    endpoint, key = answer.endpoint, f"agents.{facts.config.index(agent)}.endpoint"
    if facts.port == "free":
        return Check(name, True, f"{endpoint} is free; {agent} does not run")
    if facts.port == "not here":
        advice = f"correct {key}, or give the --id of this machine's agent"
        return Check(name, False, f"{endpoint} is no address of this machine", advice)
    if facts.port == "forbidden":
        advice = "use a port above 1023: network.base_port"
        return Check(name, False, f"{endpoint} may not be opened by this user", advice)
    if (facts.config.name, agent) in answer.tokens:
        return Check(name, True, f"{endpoint} is held by {agent}, which runs")
    holder = _inhabitants(answer.tokens) or "a program that is no agent"
    _, port = host_and_port(endpoint)
    advice = f"stop it (ss -ltnp 'sport = :{port}'), or change network.base_port in all files"
    return Check(name, False, f"{endpoint} is taken by {holder}", advice)


REMEDIES: dict[Outcome, tuple[str, str]] = {
    "unresolved": ("host is not known", "correct the host, or write its address"),
    "refused": ("nobody listens there", "start the agent, or correct its endpoint"),
    "silent": (
        "no answer",
        "wrong address, machine off, or a firewall drops it: open TCP port {port}",
    ),
    "unreachable": ("not reachable", "join that network, or correct the address"),
    "tls only": ("speaks TLS, this file does not", "add [network.security], as there"),
    "not tls": (
        "does not speak TLS, this file demands it",
        "give that agent the same [network.security]; or another program listens there",
    ),
    "foreign": (
        "its certificate is not good for our authority",
        "make it with the same ca.key (swarm certs), and copy the same ca.pem to all",
    ),
    "other host": (
        "its certificate is for other hosts",
        "swarm certs --force --host {agent}={host}, and copy it there",
    ),
    "rejects us": (
        "refuses our certificate",
        "copy the same ca.pem to all machines, and compare their clocks",
    ),
    "stranger": (
        "listens, but opens no Zenoh session",
        "another program listens there, or passwords differ ([network.security] users)",
    ),
    "untried": ("listens; not asked for want of a certificate", ""),
}


def judge_endpoint(config: SwarmFile, member: str, answer: Answer) -> Check:
    """Whether the right agent answers where the file says."""
    name, place = "endpoint", f"{member} at {answer.endpoint}"
    host, port = host_and_port(answer.endpoint)
    if answer.outcome != "zenoh":
        what, remedy = REMEDIES[answer.outcome]
        detail = f" ({answer.detail})" if answer.detail else ""
        passed = None if answer.outcome == "untried" else False
        advice = remedy.format(agent=member, host=host, port=port)
        return Check(name, passed, f"{place}: {what}{detail}", advice)
    if (config.name, member) in answer.tokens:
        return Check(name, True, f"{place}: answers")
    if not answer.tokens:
        found = f"{place}: speaks Zenoh, but no agent is announced"
        return Check(name, False, found, "wait if it has just started; else another program")
    if any(swarm == config.name for swarm, _ in answer.tokens):
        advice = "give all agents the same file: their endpoints differ"
    else:
        advice = _rename(answer.tokens[0][0], config.name)
    return Check(name, False, f"{place}: {_inhabitants(answer.tokens)} lives there", advice)


def judge_multicast(facts: Facts) -> Check:
    """Whether scouting finds anybody on the chosen interface."""
    name, interface = "multicast", facts.config.network.multicast_interface
    instead = 'set network.discovery = "endpoints"'
    if facts.hellos:
        return Check(name, True, f"hello from {', '.join(facts.hellos)}")
    if facts.echo:
        advice = f"start the agents; if they run, the network drops multicast: {instead}"
        return Check(name, False, f'nobody says hello on interface "{interface}"', advice)
    advice = f"correct network.multicast_interface, or {instead}"
    return Check(name, False, f'blocked on "{interface}": not even our own hello came', advice)


def judge_members(facts: Facts) -> Check:
    """Who is present, under this swarm's name and under others."""
    config, name = facts.config, "members"
    seen = set(facts.present).union(*(answer.tokens for answer in facts.answers.values()))
    here = [member for member in config.members if (config.name, member) in seen]
    absent = [m for m in config.members if m not in here and m != facts.agent]
    others = sorted(token for token in seen if token[0] != config.name)
    text = f"{', '.join(here) or 'nobody'} present"
    if absent:
        text += f"; {', '.join(absent)} absent"
    if others:
        text += f"; other swarms here: {_inhabitants(others)}"
    if not absent:
        return Check(name, True, text)
    if isinstance(facts.certificate, str):
        return Check(name, None, "not asked for want of a certificate")
    # Why single agents are absent is said of their endpoints.
    advice = _rename(others[0][0], config.name) if others and not here else ""
    return Check(name, False, text, advice)


def judge_layouts(facts: Facts) -> Check:
    """Whether the others' messages mean the same as ours would."""
    name, wrong, ours = "layout", [], facts.ours
    heard = {m: a for m, a in facts.answers.items() if a.params or a.state}
    for member, answer in heard.items():
        for theirs, mine in ((answer.state, ours.state), (answer.params, ours.params)):
            if theirs is not None and theirs.version != mine.version:
                wrong.append(f"{member} speaks protocol {theirs.version}, we {mine.version}")
                break
            if theirs is not None and theirs.fingerprint != mine.fingerprint:
                wrong.append(f"{member} has layout {theirs.fingerprint}, we {mine.fingerprint}")
                break
    if not heard:
        return Check(name, None, "no agent of this swarm to compare with")
    if wrong:
        advice = "give all the same release and a file with the same policy, mixing and tasks"
        return Check(name, False, "; ".join(wrong), advice)
    return Check(name, True, f"{', '.join(heard)}: as this file")


def judge_clocks(facts: Facts) -> Check:
    """Whether the others' clocks agree with ours."""
    clocks = {m: a.clock for m, a in facts.answers.items() if a.clock is not None}
    if not clocks:
        return Check("clock", None, "no agent that learns now told its time")
    text = ", ".join(f"{m} {round(offset, 1) + 0.0:+.1f} s" for m, offset in clocks.items())
    if any(abs(offset) > CLOCKS for offset in clocks.values()):
        advice = "let all machines follow one time server; certificates go by the clock, too"
        return Check("clock", False, text, advice)
    return Check("clock", True, text)


def _rename(theirs: str, ours: str) -> str:
    return f'to be one swarm: set name = "{theirs}" here, or name = "{ours}" there'


def _inhabitants(tokens: Iterable[Token]) -> str:
    agents: dict[str, list[str]] = {}
    for swarm, agent in tokens:
        agents.setdefault(swarm, []).append(agent)
    return "; ".join(f'{", ".join(names)} of swarm "{swarm}"' for swarm, names in agents.items())


def show(diagnosis: Diagnosis, as_json: bool) -> int:
    """Print it; exit code 0 when all is well, else 1."""
    if as_json:
        print(msgspec.json.format(msgspec.json.encode(diagnosis), indent=2).decode())
        return 0 if diagnosis.healthy else 1
    console = Console(highlight=False, soft_wrap=True)
    for check in diagnosis.checks:
        mark, style = MARKS[check.ok]
        name = (f"{check.name:<12}", "bold")
        console.print(Text.assemble((f"{mark} ", style), name, check.found))
    if diagnosis.endpoints:
        console.print(f"working endpoints: {' '.join(diagnosis.endpoints)}", markup=False)
    for advice in dict.fromkeys(check.advice for check in diagnosis.checks if check.advice):
        console.print(Text.assemble(("→ ", "yellow"), advice))
    return 0 if diagnosis.healthy else 1
