"""Flights of one agent: several worlds side by side, one batch for the policy at every step.

Interface: :class:`Worlds`, which gives :class:`Stretch` after :class:`Stretch`.  Told to stop
(:class:`agent.learning.learner.Attendance`), it gives the round up.  A world whose
share of a round is flown stands still and costs nothing; what the policy said on the way
(log-probability, value) is kept, so that nobody needs to ask it again.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from agent.learning.learner import Attendance, Moment, Stopped

USUAL_OVER = 16  # flights over which their usual length is remembered

Observation = NDArray[Any]
Observations = NDArray[Any]  # (N, ...)
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Choice:
    """What a policy does about N observations.

    Attributes:
        actions: (N,) chosen.
        log_probs: (N,) their log-probabilities.
        values: (N,) the critic's words; zeros without one.
    """

    actions: NDArray[np.int64]
    log_probs: NDArray[np.float32]
    values: NDArray[np.float32]


Act = Callable[[Observations], Choice]


@dataclass(slots=True)
class Stretch:
    """Consecutive steps of one flight under one policy.

    Attributes:
        start: step of the flight with which it begins.
        observations, actions, log_probs, values, rewards: one entry a step.
        last: the observation after the last step, where the flight was cut off; None where it
            ended by itself.
    """

    start: int = 0
    observations: list[Observation] = field(default_factory=list)
    actions: list[int] = field(default_factory=list)
    log_probs: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    rewards: list[float] = field(default_factory=list)
    last: Observation | None = None


@dataclass(frozen=True, slots=True)
class Ended:
    """A whole flight: its discounted return, its steps and, where the world tells, its length.

    Attributes:
        value: ``sum_t gamma^t r_t``.
        steps: taken.
        distance: [m], from ``info["distance"]``.
    """

    value: float
    steps: int
    distance: float | None


@dataclass(slots=True)
class _World:
    env: gymnasium.Env[Any, Any]
    observation: Observation = field(default_factory=lambda: np.empty(0))
    flying: bool = False
    steps: int = 0
    value: float = 0.0
    stretch: Stretch = field(default_factory=Stretch)


class Worlds:
    """The worlds of one agent.

    Args:
        envs: one each; closed by :meth:`close`.
        gamma: discount of what is reported.
        horizon: most steps of a flight.
    """

    def __init__(self, envs: list[gymnasium.Env[Any, Any]], gamma: float, horizon: int) -> None:
        self.attendance = Attendance()
        self._flights = 0  # of the first world
        self._worlds = [_World(env) for env in envs]
        self._gamma, self._horizon = gamma, horizon
        self._stretches: list[Stretch] = []
        self._ended: list[Ended] = []
        self._owed = 0  # steps that :meth:`flights` may still fly
        self._usual = 20.0  # steps of a flight, lately; a guess at first

    def episodes(
        self, act: Act, count: int, seeds: NDArray[np.int64]
    ) -> tuple[list[Stretch], list[Ended]]:
        """Whole flights: ``count`` of them, dealt evenly, every world seeded anew.

        A world flies its share whatever the others do: stopping all at the first ``count`` to end
        would favour short flights.
        """
        shares = [len(part) for part in np.array_split(np.arange(count), len(self._worlds))]
        flying = [i for i, share in enumerate(shares) if share]
        for i in flying:
            self._begin(self._worlds[i], int(seeds[i]))
        while flying:
            for i in self._advance(act, flying):
                shares[i] -= 1
                if shares[i]:
                    self._begin(self._worlds[i])
            flying = [i for i in flying if shares[i]]
        return self._take()

    def flights(
        self, act: Act, steps: int, seeds: NDArray[np.int64]
    ) -> tuple[list[Stretch], list[Ended]]:
        """Whole flights that make up ``steps`` steps on average over the rounds.

        A flight begins while the round has room for one of usual length, and is flown to its end:
        what a round flies too much, the next ones fly less.
        """
        self._owed += steps
        flying: list[int] = []
        flown = begun = 0
        while True:
            coming = sum(max(self._usual, self._worlds[i].steps) for i in flying)
            idle = [i for i in range(len(self._worlds)) if i not in flying]
            while idle and (not begun or flown + coming + self._usual / 2 < self._owed):
                i = idle.pop(0)
                self._begin(self._worlds[i], int(seeds[i]) if begun < len(seeds) else None)
                flying.append(i)
                begun += 1
                coming += self._usual
            if not flying:
                break
            for i in self._advance(act, flying):
                flown += self._worlds[i].steps
                self._usual += (self._worlds[i].steps - self._usual) / USUAL_OVER
                flying.remove(i)
        self._owed -= flown
        return self._take()

    def segment(
        self, act: Act, steps: int, seeds: NDArray[np.int64]
    ) -> tuple[list[Stretch], list[Ended]]:
        """``steps`` steps of every world; flights go on in the next segment.

        Worlds are seeded when they fly for the first time.
        """
        everyone = list(range(len(self._worlds)))
        for i in everyone:
            if not self._worlds[i].flying:
                self._begin(self._worlds[i], int(seeds[i]))
        for _ in range(steps):
            for i in self._advance(act, everyone):
                self._begin(self._worlds[i])
        for world in self._worlds:
            self._cut(world)
            world.stretch = Stretch(start=world.steps)
        return self._take()

    def close(self) -> None:
        """Close every world."""
        for world in self._worlds:
            world.env.close()

    def _begin(self, world: _World, seed: int | None = None) -> None:
        world.observation, _ = world.env.reset(seed=seed)
        world.flying, world.steps, world.value, world.stretch = True, 0, 0.0, Stretch()

    def _advance(self, act: Act, flying: list[int]) -> list[int]:
        """One step of some worlds; returns those whose flight ended."""
        if self.attendance.stopped():
            raise Stopped
        choice = act(np.stack([self._worlds[i].observation for i in flying]))
        ended = []
        for k, i in enumerate(flying):
            world = self._worlds[i]
            action = int(choice.actions[k])
            observation, reward, terminated, truncated, info = world.env.step(action)
            stretch = world.stretch
            stretch.observations.append(world.observation)
            stretch.actions.append(action)
            stretch.log_probs.append(float(choice.log_probs[k]))
            stretch.values.append(float(choice.values[k]))
            stretch.rewards.append(float(reward))
            world.value += self._gamma**world.steps * float(reward)
            world.steps += 1
            world.observation = observation
            if i == 0:
                self.attendance.see(
                    Moment(
                        world.env, self._flights, world.steps - 1, action, float(reward),
                        observation, info,
                    )
                )  # fmt: skip
            if terminated or truncated or world.steps >= self._horizon:
                if terminated:
                    self._stretches.append(stretch)
                else:
                    self._cut(world)
                distance = info.get("distance")
                self._ended.append(
                    Ended(world.value, world.steps, None if distance is None else float(distance))
                )
                ended.append(i)
                self._flights += i == 0
        return ended

    def _cut(self, world: _World) -> None:
        """Close a stretch whose flight could have gone on."""
        if world.stretch.rewards:
            world.stretch.last = world.observation
            self._stretches.append(world.stretch)

    def _take(self) -> tuple[list[Stretch], list[Ended]]:
        taken = self._stretches, self._ended
        self._stretches, self._ended = [], []
        return taken
