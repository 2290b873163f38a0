"""One agent as a process: joins its swarm, plays the rounds, keeps checkpoints, answers questions.

Interface: :func:`run_agent`.  Life of an agent: learn the swarm's newest state, announce itself,
wait for the others, play rounds, stay until the neighbours need nothing more, leave.  A former life
of the same id, a twin or one that comes back late, ends when it sees the new one.  Told to stop, it
ends with the checkpoint of the last whole round.
"""

import logging
import secrets
import threading
import time
from collections.abc import Callable, Collection
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import msgspec
import numpy as np

from agent.config.agreement import agreed
from agent.config.experiment import SwarmFile
from agent.daemon import answers
from agent.daemon.answers import Life
from agent.daemon.clock import await_clock
from agent.daemon.joining import serve_config
from agent.daemon.logbook import logbook_kept
from agent.daemon.metrics import serve_metrics
from agent.daemon.notify import Systemd
from agent.daemon.rounds import Outcome, Rounds
from agent.daemon.spotter import Spotter
from agent.learning.divergence import bound_of, check
from agent.learning.learner import Attendance, Learner
from agent.learning.learners import build_learner
from agent.storage import checkpoint
from agent.storage.appender import RETRY, Appender
from agent.storage.checkpoint import Checkpoint
from agent.storage.flights import FlightLog
from agent.storage.metrics import open_metrics
from agent.storage.runfolder import RunFolder
from agent.storage.shelf import Shelf
from swarm.errors import ConfigError
from swarm.exchange import Exchange
from swarm.mixing.consensus import sketch
from swarm.mixing.rules import RULES, Mixer
from swarm.mixing.weights import neighbours
from swarm.protocol.machine import Machine
from swarm.protocol.messages import LARGEST, ParameterHeader, life_after
from swarm.reports.history import serve_history
from swarm.reports.telemetry import RoundReport, TelemetryPublisher
from swarm.wire.allocator import settle_process
from swarm.wire.keys import Keys
from swarm.wire.payload import Layout
from swarm.wire.refusals import Refusals
from swarm.wire.roster import Roster
from swarm.wire.session import open_session

log = logging.getLogger(__name__)
SETTLING = 20  # rounds of mixing alone at the end of an asynchronous swarm
SKETCHES = 200  # sketches and routes in the metrics file of one run


def layout_of(config: SwarmFile, learner: Learner) -> Layout:
    """What the parameter vectors of this swarm mean."""
    return Layout(
        swarm=config.name,
        parts=learner.parts,
        precision=config.policy.precision,
        copies=RULES[config.mixing.rule].copies,
        codec=config.mixing.compression,
        agreed=agreed(config),
    )


def run_agent(
    config: SwarmFile,
    agent: str,
    folder: RunFolder,
    stop: threading.Event,
    announced: Callable[[], None] = lambda: None,
    resume: bool = False,
    begin: int | None = None,
    metrics_at: str | None = None,
) -> int:
    """Run one agent to the end of its rounds, or until it is told to stop.

    Args:
        config: the swarm file.
        agent: its id.
        folder: where it keeps what it makes.
        stop: set it, and the agent ends within a second with a checkpoint.
        announced: called before others see the agent; until then it may be ended as it is.
        resume: go on from its newest checkpoint.
        begin: with ``resume``, go on from the checkpoint of this round instead.
        metrics_at: ``HOST:PORT`` for :mod:`agent.daemon.metrics`.

    Returns:
        The round it reached.

    Raises:
        SwarmError: for everything that a user can mend.
    """
    index, systemd = config.index(agent), Systemd()
    folder.prepare(agent)
    if not await_clock(config.network.security, agent, stop, systemd):
        return 0
    learner = build_learner(config, agent)
    layout, keys = layout_of(config, learner), Keys(config.name)
    first = _first_checkpoint(learner, layout, folder, agent, resume, begin)
    mixer = Mixer(config.mixing)
    life = Life("waiting", first)
    endpoints = [config.endpoint(member) for member in config.members]
    listen = config.network.listen or endpoints[index]
    settle_process()
    with ExitStack() as resources:
        resources.callback(learner.close)
        session = resources.enter_context(
            open_session(config.network, config.party(agent), [listen], endpoints[:index])
        )
        refusals = resources.enter_context(Refusals(session, keys, agent, layout))
        roster = resources.enter_context(Roster(session, keys, config.members, refusals.refused))
        machine = _machine_of(config, agent, roster.earlier(agent), layout, first)
        exchange = resources.enter_context(
            Exchange(
                session, keys, machine, layout, mixer.codec, roster,
                waits=config.pace == "sync", shared_memory=config.network.shared_memory,
                last=config.rounds,
            )
        )  # fmt: skip
        telemetry = resources.enter_context(TelemetryPublisher(session, keys, agent))
        metrics = resources.enter_context(open_metrics(folder.metrics(agent), first.round))
        shelf = Shelf(folder.checkpoints(agent))
        rounds = Rounds(config, agent, learner, mixer, exchange, stop)
        kept = FlightLog(
            folder.flown(agent), first.round, config.rounds, lambda: config.progress(life.at)
        )
        spotter = Spotter(agent, lambda: life.at.round, telemetry, kept)
        learner.attendance = Attendance(stop.is_set, spotter.see)
        refusals.check()
        life.at = _catch_up(config, exchange, roster, first)
        mixer.state, learner_state = dict(life.at.mixing), learner.optimizer_state
        learner_state |= life.at.optimizer
        exchange.handover.serve(lambda: _state(life.at, rounds))
        for report in folder.reports(agent):
            life.history.take(report)
        serve_history(session, keys, agent, life.history)
        serve_config(session, keys, agent, config, lambda: life.at.round)
        answers.serve_status(session, keys, life, rounds)
        resources.enter_context(logbook_kept(partial(answers.status_of, life, rounds)))
        if metrics_at is not None:
            ask = partial(answers.health, life, rounds)
            resources.enter_context(serve_metrics(metrics_at, config.name, ask))
        announced()
        roster.announce(agent, machine.life)
        systemd.ready()
        log.info("round %d: announced as %s on %s", life.at.round, machine.life, listen)
        # Who comes back alone goes on when enough are here; a swarm begins, or resumes, together.
        exchange.on_wait = lambda: systemd.alive(f"round {life.at.round}: waiting")
        exchange.start(life.at.round, begin is not None or life.at.round == 0, stop)
        absent = [member for member, peer in machine.peers.items() if not peer.here]
        if absent and not stop.is_set():
            log.warning("round %d: going on without %s", life.at.round, ", ".join(absent))
        life.state = "learning"
        while config.progress(life.at) < config.rounds and not stop.is_set():
            _play(config, rounds, life, shelf, telemetry, metrics)
            systemd.alive(f"round {life.at.round} of {config.rounds}")
        systemd.stopping()
        if stop.is_set():
            if shelf.put_all((*life.unwritten, life.at)):
                log.info("round %d: told to stop, checkpoint written", life.at.round)
        else:
            life.state = "finished"
            if life.report is not None:
                telemetry.put(life.report, always=True)
            if config.pace == "async":
                _follow_neighbours(rounds, life)
            else:
                _see_neighbours_finish(rounds, life)
            while not shelf.put(life.at, durable=True) and not stop.wait(RETRY):
                pass  # all is learned: wait for room to keep it
            log.info("round %d: finished", life.at.round)
    return life.at.round


def _play(
    config: SwarmFile,
    rounds: Rounds,
    life: Life,
    shelf: Shelf,
    telemetry: TelemetryPublisher,
    metrics: Appender,
) -> None:
    """Play one round; keep and tell what it gave.

    Raises:
        DivergenceError: it gave nothing to go on from.
    """
    at, start = life.at, time.monotonic()
    outcome = rounds.play(at.round, at.theta, at.learned)
    if outcome is None:
        return
    _check(rounds, at.round, outcome)
    if outcome.next_round > at.round + 1:
        log.warning("round %d: behind, jumping to round %d", at.round, outcome.next_round)
    life.at = Checkpoint(
        round=outcome.next_round,
        fingerprint=at.fingerprint,
        theta=outcome.theta,
        mixing=dict(rounds.mixer.state),
        optimizer=dict(rounds.learner.optimizer_state),
        episodes=at.episodes + outcome.step.episodes,
        steps=at.steps + outcome.step.steps,
        learned=outcome.learned,
        run=rounds.exchange.machine.membership.run,
        accounts=outcome.accounts,
    )
    last = config.progress(life.at) >= config.rounds
    if last or life.at.round % config.checkpoint_every == 0:
        written = shelf.put(life.at, durable=last)
    else:
        written = False
    if written:
        life.unwritten.clear()
    else:
        life.unwritten.append(life.at)
    sparse = last or at.round % max(1, config.rounds // SKETCHES) == 0
    detailed = sparse or telemetry.due() or life.history.due(at.round)
    report = _report(rounds, at, outcome, time.monotonic() - start, detailed)
    life.report, life.reported = report, time.monotonic()
    life.history.take(report)
    telemetry.put(report)
    kept = report if sparse else msgspec.structs.replace(report, sketch=(), route=())
    metrics.write(msgspec.json.encode(kept) + b"\n")


def _check(rounds: Rounds, round_: int, outcome: Outcome) -> None:
    """Raises DivergenceError where a round gave nothing to go on from."""
    step = outcome.step
    bound = bound_of(rounds.config.policy, rounds.learner.parts)
    numbers = {"gradient's norm": step.gradient_norm, "mean return": step.value}
    check(round_, bound, outcome.theta, numbers, rounds.agent)


def _report(
    rounds: Rounds, at: Checkpoint, outcome: Outcome, seconds: float, detailed: bool
) -> RoundReport:
    step = outcome.step
    return RoundReport(
        agent=rounds.agent,
        round=at.round,
        time=time.time(),
        seconds=seconds,
        waited=outcome.waited,
        value=step.value,
        episodes=at.episodes + step.episodes,
        steps=at.steps + step.steps,
        gradient_norm=step.gradient_norm,
        distance=step.distance,
        disagreement=outcome.disagreement,
        weights=outcome.weights,
        missing=outcome.missing,
        one_sided=rounds.exchange.one_sided,
        sketch=tuple(sketch(at.theta).tolist()) if detailed else (),
        route=rounds.learner.route(at.theta) if detailed else (),
        learned=outcome.learned,
    )


def _first_checkpoint(
    learner: Learner,
    layout: Layout,
    folder: RunFolder,
    agent: str,
    resume: bool,
    begin: int | None,
) -> Checkpoint:
    """Where to begin: round 0, or a checkpoint.

    Raises:
        ConfigError: there are checkpoints, and nobody said what to do with them.
        CheckpointError: the one asked for does not fit.
    """
    kept = folder.checkpoints(agent)
    held = checkpoint.rounds_in(kept)
    if not resume and held:
        raise ConfigError(
            f'run folder "{folder.path}" has checkpoints of "{agent}" (newest: round {held[-1]}): '
            "expected --resume to go on, or --run with another folder"
        )
    round_ = begin or 0
    if resume and begin is None and (newest := checkpoint.newest(kept)) is not None:
        round_ = newest.round
    first = Checkpoint(0, layout.shape, learner.initial())
    if round_:
        first = checkpoint.read(checkpoint.path_of(kept, round_), layout.shape)
    checkpoint.drop_after(kept, round_)
    return first


def _machine_of(
    config: SwarmFile, agent: str, earlier: list[str], layout: Layout, first: Checkpoint
) -> Machine:
    """The agent's protocol, in a new life and where its checkpoint has it."""

    def topology(here: tuple[str, ...]) -> tuple[str, ...]:
        return neighbours(config.topology, here, agent)

    machine = Machine(
        agent,
        life_after(time.time(), secrets.randbelow(4096), earlier),
        config.members,
        topology,
        layout.fingerprint,
        config.rounds if config.pace == "sync" else LARGEST,
        config.timing,
        config.quorum,
        first.run,
    )
    for member, account in first.accounts.items():
        if member in machine.peers:
            machine.peers[member].account = account
    return machine


def _catch_up(config: SwarmFile, exchange: Exchange, roster: Roster, own: Checkpoint) -> Checkpoint:
    """Join the swarm where it is: parameters and round of a member whom others confirm."""

    def lives(answered: Collection[str]) -> dict[str, str]:
        roster.wait_for(answered, config.timing.state)
        return roster.present()

    reached = config.progress(own)
    newest = exchange.handover.fetch(config.timing.state, lives, own.run, reached)
    if newest is None:
        return own
    header = newest.header
    log.info(
        "round %d: joining at round %d with the parameters of %s",
        own.round,
        header.round,
        header.agent,
    )
    exchange.machine.adopt(header.run)
    # What the mixing rule remembers belongs to the old parameters: begin it anew.
    return replace(
        own,
        round=max(own.round, header.round),
        theta=newest.vector.copy(),
        mixing={},
        learned=header.learned,
        run=header.run,
        accounts={},
    )


def _state(at: Checkpoint, rounds: Rounds) -> tuple[ParameterHeader, bytes]:
    """What a joiner asks for, all of one round although the rounds go on meanwhile."""
    norm = float(np.linalg.norm(at.theta))
    signed = rounds.exchange.machine.sign()
    header = msgspec.structs.replace(signed, round=at.round, learned=at.learned, norm=norm)
    return header, at.theta.tobytes()


def _see_neighbours_finish(rounds: Rounds, life: Life) -> None:
    """Publish the last parameters and stay until the neighbours have got as far."""
    theta, limit = life.at.theta, rounds.config.timing.finish
    body = rounds.mixer.outgoing(theta, theta * 0)
    rounds.exchange.publish(life.at.round, body, float(np.linalg.norm(theta)), limit=limit)
    rounds.exchange.gather(rounds.stop)


def _follow_neighbours(rounds: Rounds, life: Life) -> None:
    """Go on mixing until the neighbours have learned all, or learn no more, and a little longer."""
    learning, since, left = rounds.still_learning(), time.monotonic(), SETTLING
    while left and (outcome := rounds.play(life.at.round, life.at.theta, life.at.learned)):
        _check(rounds, life.at.round, outcome)
        life.at = replace(life.at, round=outcome.next_round, theta=outcome.theta)
        before, learning = learning, rounds.still_learning()
        if learning != before:
            since = time.monotonic()
        if not learning or time.monotonic() > since + rounds.config.timing.round:
            left -= 1
