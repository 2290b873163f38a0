"""One round of Algorithm 1.

::

    who are my neighbours now?  ->  publish theta_k (does not wait)
    ->  gradient at theta_k, while the exchange runs underneath
    ->  gather the neighbours' theta_k  ->  mix, add the step: theta_{k+1}

Rules that send what depends on the step (:mod:`swarm.mixing.rules`) publish after it instead.  In
an asynchronous swarm an agent takes the newest that is there and learns as much of its step as
:mod:`swarm.mixing.staleness` grants, or waits for news if it is nothing.
"""

import threading
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from agent.config.experiment import SwarmFile
from agent.learning.learner import Learner, Step, Stopped, Vector
from swarm.exchange import Exchange
from swarm.mixing.consensus import disagreement
from swarm.mixing.loss import edge_counts
from swarm.mixing.rules import Mixer
from swarm.mixing.staleness import share_to_learn
from swarm.mixing.weights import lazy_metropolis
from swarm.protocol.accounts import Account
from swarm.protocol.actions import Mix
from swarm.protocol.machine import Machine
from swarm.protocol.peers import Delivery


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
        accounts: what was used of whom, for a checkpoint.
    """

    theta: Vector
    next_round: int
    learned: float
    step: Step
    weights: dict[str, float]
    missing: tuple[str, ...]
    disagreement: float
    waited: float
    accounts: dict[str, Account]


@dataclass(slots=True)
class Rounds:
    """An agent's part in the rounds of its swarm.

    Attributes:
        config: the swarm file.
        agent: own id.
        learner, mixer, exchange: its parts.
        stop: set when the agent must end.
        last_step: what was learned last, without the vector.
    """

    config: SwarmFile
    agent: str
    learner: Learner
    mixer: Mixer
    exchange: Exchange
    stop: threading.Event
    last_step: Step = field(default_factory=lambda: Step(np.zeros(0), 0.0, 0, 0, 0.0))

    @property
    def machine(self) -> Machine:
        """The protocol."""
        return self.exchange.machine

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
        together = self.config.pace == "sync"
        share = 1.0 if together else self._share(learned)
        if self.mixer.rule.sends_after_step:
            step, waited = self._learn(round_, theta, share)
            self._publish(round_, theta, step.vector, learned)
        else:
            self._publish(round_, theta, theta, learned)
            step, waited = self._learn(round_, theta, share)
        if together:
            return self._mix(theta, step, waited)
        arrived = self.exchange.look()
        weights = self._weights(arrived)
        vectors = {sender: delivery.vector for sender, delivery in arrived.items()}
        return Outcome(
            theta=self.mixer.mix(theta, step.vector, vectors, weights),
            next_round=round_ + 1,
            learned=learned + share,
            step=step,
            weights=weights,
            missing=tuple(n for n in self.machine.nearby if n not in arrived),
            disagreement=disagreement(theta, [v[: theta.size] for v in vectors.values()]),
            waited=waited,
            accounts={},
        )

    def _mix(self, theta: Vector, step: Step, waited: float) -> Outcome | None:
        """The end of a round that all play: what the protocol lets count, and takes back."""
        gathered = self.exchange.gather(self.stop)
        if gathered is None:
            return None
        mix, mixer = gathered.mix, self.mixer
        start = theta
        for neighbour, _ in mix.taken_back:
            start = mixer.take_back(neighbour, start)
        for neighbour in mix.void:
            mixer.forget(neighbour)
        counting = self._counting(mix)
        weights = self._weights(mix.used)
        if self.config.mixing.missing == "stale":
            weights |= self._stale(mix)
        new = mixer.mix(start, step.vector, counting, weights)
        return Outcome(
            theta=new,
            next_round=mix.next_round,
            learned=0.0,
            step=step,
            weights={neighbour: weights[neighbour] for neighbour in counting},
            missing=tuple(n for n in self.machine.nearby if n not in counting),
            disagreement=disagreement(theta, [v[: theta.size] for v in counting.values()]),
            waited=gathered.waited + waited,
            accounts=dict(mix.accounts),
        )

    def still_learning(self) -> dict[str, float]:
        """What those neighbours have learned that have not learned all yet [rounds]."""
        learned = self.exchange.learned()
        return {agent: count for agent, count in learned.items() if count < self.config.rounds}

    def _share(self, learned: float) -> float:
        """How much of the next step to take, given what each neighbour is known to have learned."""
        theirs = self.exchange.learned().values()
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

    def _publish(self, round_: int, theta: Vector, step: Vector, learned: float) -> None:
        body = self.mixer.outgoing(theta, step)
        self.exchange.publish(round_, body, float(np.linalg.norm(theta)), learned)

    def _counting(self, mix: Mix) -> dict[str, Vector]:
        """Vectors that count, less those lost on purpose: at both ends alike, or by policy."""
        loss, missing, round_ = self.config.loss, self.config.mixing.missing, self.machine.round
        counting = {
            sender: delivery.vector
            for sender, delivery in mix.used.items()
            if edge_counts(loss, missing, round_, sender, self.agent)
        }
        for sender in mix.used.keys() - counting.keys():
            self.mixer.unsettled.pop(sender, None)  # the round that may be taken back had no share
        return counting

    def _weights(self, used: Mapping[str, Delivery]) -> dict[str, float]:
        """Lazy Metropolis weights, from both sides' numbers of neighbours."""
        own = len(self.machine.nearby)
        degrees = {n: len(delivery.header.neighbours) for n, delivery in used.items()}
        return {n: lazy_metropolis(own, degree) for n, degree in degrees.items()}

    def _stale(self, mix: Mix) -> dict[str, float]:
        """Weights of neighbours whose last vector counts again, of whatever round."""
        with_vectors = {n: self.exchange.newest_of(n) for n in mix.missing}
        found = {n: delivery for n, delivery in with_vectors.items() if delivery is not None}
        for neighbour, delivery in found.items():
            self.mixer.heard[neighbour] = delivery.vector
        own = len(self.machine.nearby)
        weights = {n: lazy_metropolis(own, own) for n in mix.missing if n in self.mixer.heard}
        return weights | self._weights(found)
