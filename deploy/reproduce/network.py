"""What faults cost a swarm of real processes, each on a host of its own: a table, fault by fault.

Grid world (a); every host is a network namespace with an address, a cable and a firewall of its
own.  One run a chaos file of ``deploy/library/faults``, beside one that nobody disturbs, all with
the same seed.  Needs root, iproute2 and iptables; clocks that jump need libfaketime.
"""

import shutil
from dataclasses import asdict, dataclass
from pathlib import Path

import msgspec

from agent.config.experiment import SwarmFile
from agent.storage.files import write_file
from agent.storage.runfolder import RunFolder
from deploy.chaos.faults import load_faults
from deploy.chaos.namespaces import hosts, inside, settle
from deploy.launch.child import swarm_up
from deploy.launch.journal import events
from deploy.policies.result import read_result
from deploy.policies.tables import TabularScores
from deploy.reproduce import figures
from deploy.reproduce.aftermath import TOLERATED as TIMES
from deploy.reproduce.aftermath import Aftermath, Trace, examine, usual_disagreement
from deploy.reproduce.claims import Claim, Findings, Options
from deploy.reproduce.settings import grid_swarm
from swarm.mixing.weights import neighbours
from swarm.reports.telemetry import RoundReport

FILES = Path(__file__).parents[1] / "library" / "faults"
FAULTS = ("kill", "restart", "freeze", "partition", "loss", "rate", "clock")
UNDISTURBED = "none"
AGENTS = (4, 8)  # from, to
BEGIN = 0.4  # share of the run at which the faults begin (chaos files)
EACH = 1200  # rounds an agent: for it to be restarted, and to see what becomes of it
COSTS = {"kill": 0.5, "freeze": 3.0, "partition": 3.0}  # [s] most that a round may take, once
REUNION = 20  # rounds in which the parts of a swarm must agree again
MAY_RESTART = {"kill", "restart"}
LOSS = 0.03  # of V/V*
LIMIT = 900.0  # [s] for one run


@dataclass(frozen=True)
class Finished:
    """A run: what became of it, and how good the swarm is at its end.

    Attributes:
        aftermath: see there.
        solved: tasks solved by the worst agent's policy.
        share: its V/V*.
        lost: agents that did not come to the last round.
    """

    aftermath: Aftermath
    solved: int
    share: float
    lost: tuple[str, ...]


def study(options: Options, agents: int, faults: tuple[str, ...]) -> Findings:
    """See the module's docstring.

    Raises:
        SwarmError: this machine cannot make such hosts, or a run failed.
    """
    config = grid_swarm("a", agents, rounds=EACH * agents * 3 // (4 if options.quick else 3))
    first = int(BEGIN * config.rounds)
    runs = options.out / "runs"
    with hosts(agents + 1) as names:
        config = settle(config, names)
        traces = {}
        for k, fault in enumerate(cases := (UNDISTURBED, *faults)):
            detail = f"{agents} agents, {config.rounds} rounds, fault: {fault}"
            options.say(detail, k / len(cases))
            traces[fault] = _run(config, fault, runs / fault, names[-1])
    tolerated = TIMES * usual_disagreement(traces[UNDISTURBED], first)
    done = {
        fault: _judge(config, trace, RunFolder(runs / fault), tolerated)
        for fault, trace in traces.items()
    }
    calm = done[UNDISTURBED]
    return Findings(
        title=f"Faults of {agents} processes on {agents} hosts, grid world (a), "
        f"{config.rounds} rounds",
        claims=[claim(fault, end, calm, agents) for fault, end in done.items()],
        notes=_notes(done, first, tolerated),
        data={fault: asdict(end) for fault, end in done.items()},
        figures=[_draw(options.out, traces)],
    )


def _run(config: SwarmFile, fault: str, path: Path, host: str) -> Trace:
    """One run, launched and watched from a host without an agent."""
    shutil.rmtree(path, ignore_errors=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    file, chaos = path.with_suffix(".json"), FILES / f"{fault}.toml"
    write_file(file, msgspec.json.encode(config))
    found = () if fault == UNDISTURBED else load_faults(chaos, config)
    options = ("--chaos", chaos) if found else ()
    swarm_up(file, path, *options, limit=LIMIT, host=inside(host))
    folder = RunFolder(path)
    return Trace(
        {a: frozenset(neighbours(config.topology, config.members, a)) for a in config.members},
        {agent: _as_written(folder.metrics(agent)) for agent in config.members},
        found,
        tuple(events(folder.events)),
    )


def _as_written(path: Path) -> list[RoundReport]:
    decoder = msgspec.json.Decoder(RoundReport)
    return [decoder.decode(line) for line in path.read_bytes().splitlines()]


def _judge(config: SwarmFile, trace: Trace, folder: RunFolder, tolerated: float) -> Finished:
    result = read_result(folder)
    assert result is not None
    scores, last = result.scores, config.rounds - 1
    assert isinstance(scores, TabularScores)
    assert scores.optimum is not None
    return Finished(
        examine(trace, int(BEGIN * config.rounds), tolerated),
        solved=min(scores.solved),
        share=min(scores.value) / scores.optimum,
        lost=tuple(agent for agent, played in trace.reports.items() if played[-1].round != last),
    )


def claim(fault: str, end: Finished, calm: Finished, agents: int) -> Claim:
    """The line of a fault: what it cost, how long until all was well, what was learned."""
    was, cost = end.aftermath, COSTS.get(fault)
    required = [f"{agents} of {agents}", "nobody lost", "no round twice"]
    ours = [f"longest round {was.longest:.2f} s, next {was.following:.2f} s"]
    holds = end.solved == agents and not end.lost and not was.repeated
    if fault != UNDISTURBED:
        required.append(f"V/V* within {LOSS}")
        holds = holds and abs(end.share - calm.share) <= LOSS
        ours.append(f"{was.during * 1e3:.0f} ms a round meanwhile")
        ours.append(
            "never again as before" if was.absence is None else f"back in {was.absence} rounds"
        )
    if cost is not None:
        required.insert(0, f"< {cost:g} s once")
        holds = holds and was.longest < cost and was.slow <= 1
    if fault == "partition":
        required.insert(1, f"agreed within {REUNION} rounds of hearing each other")
        holds = holds and was.reunion is not None and was.reunion <= REUNION
        ours.append(f"linked {was.reconnect:.1f} s after, agreed {was.reunion} rounds on"
                    if was.reconnect is not None else "never linked again")  # fmt: skip
    if fault == "restart":
        required.insert(0, f"{agents} restarts")
        holds = holds and was.restarts == agents
    if fault not in MAY_RESTART:
        required.append("nobody restarted")
        holds = holds and was.restarts == 0
    ours.append(f"{end.solved} of {agents}, V/V* {end.share:.3f}")
    if was.restarts:
        ours.append(f"{was.restarts} restarts")
    if was.repeated or end.lost:
        ours.append(f"{was.repeated} rounds twice, lost: {', '.join(end.lost) or 'nobody'}")
    return Claim(fault, "", "; ".join(required), "; ".join(ours), holds)


def _notes(done: dict[str, Finished], first: int, tolerated: float) -> list[str]:
    usual = done[UNDISTURBED].aftermath.usual
    edges = ", ".join(f"{fault} {end.aftermath.one_sided}" for fault, end in done.items())
    return [
        f"Without faults a round takes {usual * 1e3:.1f} ms (median). Longest and next: of any one "
        f"agent that was not itself stopped, from round {first} on or from the fault.",
        "Back: rounds that the others play from the end of the fault (kill, restart: from its "
        "beginning, so the start of a process is in it) until every agent mixes with all its "
        f"neighbours and nobody is farther than {tolerated:.2f} from one, {TIMES} times what is "
        "usual without faults.  Agreed: likewise, as soon as what is mixed leads from every agent "
        "to every other; links come back one by one.",
        f"Edges of a round that one end mixed and the other did not: {edges}.",
    ]


def _draw(out: Path, traces: dict[str, Trace]) -> Path:
    """Every round of every agent: when, and how long it took."""
    columns = (len(traces) + 1) // 2
    figure, axes = figures.canvas(columns, 2, size=(3.0, 2.2))
    for panel, (fault, trace) in zip(axes.flat, traces.items(), strict=False):
        for colour, reports in zip(figures.COLOURS, trace.reports.values(), strict=False):
            rounds = [report.round for report in reports]
            panel.semilogy(rounds, [r.seconds for r in reports], ".", ms=2, color=colour)
        panel.set_ylim(1e-3, 10)
        figures.label(panel, fault, "round", "[s]")
    for panel in axes.flat[len(traces) :]:
        panel.set_visible(False)
    return figures.save(figure, out / "network.png")
