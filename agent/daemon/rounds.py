"""One round of Algorithm 1.

::

    who are my neighbours now?  ->  publish theta_k (does not wait)
    ->  gradient at theta_k, while the exchange runs underneath
    ->  gather the neighbours' theta_k  ->  mix, add the step: theta_{k+1}
    ->  compare accounts with the neighbours

Rules that send what depends on the step (:mod:`swarm.mixing.rules`) publish after it instead.  In
an asynchronous swarm an agent takes the newest that is there and learns as much of its step as
:mod:`swarm.mixing.staleness` grants, or waits for news if it is nothing; there are no accounts to
compare.
"""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from agent.config.experiment import SwarmFile
from agent.learning.learner import Learner, Step, Stopped, Vector
from swarm.exchange import Exchange, Gathered
from swarm.mixing.consensus import disagreement
from swarm.mixing.loss import edge_counts
from swarm.mixing.rules import Mixer
from swarm.mixing.staleness import share_to_learn
from swarm.mixing.weights import lazy_metropolis, neighbours
from swarm.protocol.ledger import Ledger
from swarm.wire.roster import Roster


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a round gave.

    Attributes:
        theta: parameters of the next round.
        next_round: its number; more than one on after falling behind.
        learned: so far [rounds], in an asynchronous swarm.
        step: what was learned.
        weights: W_ij by neighbour whose parameters were mixed in.
        missing: neighbours without a message that counts.
        disagreement: largest distance to a neighbour.
        waited: time spent waiting for the exchange [s].
    """

    theta: Vector
    next_round: int
    learned: float
    step: Step
    weights: dict[str, float]
    missing: tuple[str, ...]
    disagreement: float
    waited: float


@dataclass(slots=True)
class Rounds:
    """An agent's part in the rounds of its swarm.

    Attributes:
        config: the swarm file.
        agent: own id.
        learner, mixer, exchange, roster: its parts.
        stop: set when the agent must end.
        ledger: what was used of whom.
        degrees: last known number of neighbours of each neighbour.
        last_step: what was learned last, without the vector.
    """

    config: SwarmFile
    agent: str
    learner: Learner
    mixer: Mixer
    exchange: Exchange
    roster: Roster
    stop: threading.Event
    ledger: Ledger = field(init=False)
    degrees: dict[str, int] = field(default_factory=dict)
    last_step: Step = field(default_factory=lambda: Step(np.zeros(0), 0.0, 0, 0, 0.0))

    def __post_init__(self) -> None:
        self.ledger = Ledger(self.agent)

    def neighbours(self) -> tuple[str, ...]:
        """Own neighbours in the topology over the members that are present (and oneself)."""
        present = self.roster.present()
        here = tuple(m for m in self.config.members if m == self.agent or m in present)
        return neighbours(self.config.topology, here, self.agent)

    def play(self, round_: int, theta: Vector, learned: float = 0.0) -> Outcome | None:
        """Play one round from ``theta``; None when told to stop in the middle of it.

        Args:
            round_: its number.
            theta: (d,) parameters.
            learned: so far [rounds], in an asynchronous swarm.
        """
        try:
            return self._play(round_, theta, learned)
        except Stopped:
            return None

    def _play(self, round_: int, theta: Vector, learned: float) -> Outcome | None:
        nearby, together = self.neighbours(), self.config.pace == "sync"
        share = 1.0 if together else self._share(nearby, learned)
        if self.mixer.rule.sends_after_step:
            step, waited = self._learn(round_, theta, share)
            self._publish(round_, nearby, theta, step.vector, learned)
        else:
            self._publish(round_, nearby, theta, theta, learned)
            step, waited = self._learn(round_, theta, share)
        gathered = self._gather(round_, nearby)
        if self.stop.is_set():
            return None
        arrived = self._counting(round_, gathered)
        weights = self._weights(nearby, gathered)
        if not together:
            weights = {sender: weights[sender] for sender in arrived}
        new = self.mixer.mix(theta, step.vector, arrived, weights)
        if together:
            used = {n: weights[n] for n in self.mixer.shares}
            self.ledger.record(round_, used, self.mixer.shares)
            new = self._settle(new, gathered)
        return Outcome(
            theta=new,
            next_round=max(round_ + 1, gathered.ahead or 0),
            learned=0.0 if together else learned + share,
            step=step,
            weights={neighbour: weights[neighbour] for neighbour in arrived},
            missing=tuple(n for n in nearby if n not in arrived),
            disagreement=disagreement(theta, [v[: theta.size] for v in arrived.values()]),
            waited=gathered.waited + waited,
        )

    def still_learning(self) -> dict[str, float]:
        """What those neighbours have learned that have not learned all yet [rounds]."""
        learned = self.exchange.learned(self.neighbours())
        return {agent: count for agent, count in learned.items() if count < self.config.rounds}

    def _share(self, nearby: tuple[str, ...], learned: float) -> float:
        """How much of the next step to take, given what each neighbour is known to have learned."""
        theirs = self.exchange.learned(nearby).values()
        share = share_to_learn(learned, theirs, self.config.staleness)
        return min(share, self.config.rounds - learned)

    def _learn(self, round_: int, theta: Vector, share: float) -> tuple[Step, float]:
        """A share of a step, and the time spent waiting [s] where there is none to take."""
        if share == 0.0:
            waited = self.exchange.wait_for_news()
            return replace(self.last_step, vector=np.zeros_like(theta)), waited
        step = self.learner.step(theta, round_)
        self.last_step = replace(step, vector=np.zeros(0), episodes=0, steps=0)
        if share != 1.0:
            step = replace(step, vector=step.vector * theta.dtype.type(share))
        return step, 0.0

    def _publish(
        self, round_: int, nearby: tuple[str, ...], theta: Vector, step: Vector, learned: float
    ) -> None:
        body = self.mixer.outgoing(theta, step)
        norm = float(np.linalg.norm(theta))
        self.exchange.publish(round_, nearby, body, self.ledger.used, norm, learned)

    def _gather(self, round_: int, nearby: tuple[str, ...]) -> Gathered:
        if self.config.pace == "async":
            return self.exchange.look(nearby)
        return self.exchange.gather(round_, nearby, self.stop)

    def _counting(self, round_: int, gathered: Gathered) -> dict[str, Vector]:
        """Messages of neighbours that also count us, less those lost on purpose."""
        loss, missing = self.config.loss, self.config.mixing.missing
        declined: set[str] = set()
        if missing == "stale":
            for sender, message in gathered.newest.items():
                if sender in gathered.missing:
                    self.mixer.heard[sender] = message.vector
        else:
            declined = self.ledger.declined(round_, (m.header for m in gathered.newest.values()))
        return {
            sender: message.vector
            for sender, message in gathered.arrived.items()
            if self.agent in message.header.neighbours
            and sender not in declined
            and edge_counts(loss, missing, round_, sender, self.agent)
        }

    def _weights(self, nearby: tuple[str, ...], gathered: Gathered) -> Mapping[str, float]:
        """Lazy Metropolis weight of every neighbour, from both sides' numbers of neighbours."""
        for sender, message in (gathered.newest | gathered.arrived).items():
            self.degrees[sender] = len(message.header.neighbours)
        own = len(nearby)
        return {n: lazy_metropolis(own, self.degrees.get(n, own)) for n in nearby}

    def _settle(self, theta: Vector, gathered: Gathered) -> Vector:
        """Take back shares of edges that turn out one-sided, where the drop must be symmetric."""
        for share in self.ledger.settle(m.header for m in gathered.newest.values()):
            if self.config.mixing.missing == "symmetric":
                theta = self.mixer.rule.retract(theta, share, self.mixer.state)
        return theta
