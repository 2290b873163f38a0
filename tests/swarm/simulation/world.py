"""A virtual clock and network, and agents that run the real protocol and the real mixing in it.

Nothing here sleeps, and nothing is left to chance but what the schedule's seed decides: the same
schedule gives the same play to the bit.  Agents climb ``-|theta - c_i|^2 / 2``, so the optimum of
any set of them is the mean of their ``c_i``.
"""

import heapq
import random
from collections.abc import Callable
from itertools import count

import numpy as np

from swarm.mixing.rules import Mixer, Mixing
from swarm.mixing.weights import Topology, lazy_metropolis, neighbours
from swarm.protocol.accounts import Account
from swarm.protocol.actions import Again, Await, Begin, End, Mix, Say, Send
from swarm.protocol.machine import Machine
from swarm.protocol.messages import ParameterHeader, life_after, newest
from swarm.protocol.quorum import Quorum
from swarm.protocol.timing import Timing
from swarm.protocol.transfer import Answer, choose
from tests.swarm.simulation.process import DIMENSION, Disk, Process, Vector
from tests.swarm.simulation.schedule import Fault, Schedule
from tests.swarm.simulation.traitor import lie

STEP = 0.05
LEASE = 1.0  # [s]
TIMING = Timing(start=3.0, round=6.0, round_floor=1.0, resend=0.25, beat=0.5, state=0.5, finish=1.0)
QUORUM = Quorum(patience=4.0)
WORK = (0.25, 0.35)  # [s] that a round's step takes
SAVED = 3  # rounds between checkpoints


class World:
    """Plays a schedule.

    Args:
        schedule: what goes wrong.
        machine: the protocol, or a mutant of it.
        rounds: at which the experiment ends.
        work: shortest and longest time that a step takes [s].
    """

    def __init__(
        self,
        schedule: Schedule,
        machine: type[Machine] = Machine,
        rounds: int = 100_000,
        work: tuple[float, float] = WORK,
    ) -> None:
        self.schedule, self._machine, self._last, self._work = schedule, machine, rounds, work
        self.members = tuple(f"a{i:02}" for i in range(schedule.agents))
        self.topology = Topology(kind=schedule.topology)
        self.dice = random.Random(schedule.seed + 1)
        self.now = 0.0
        self._queue: list[tuple[float, int, Callable[[], None]]] = []
        self._number = count()
        self.processes: list[Process] = []
        self.disks = {member: Disk() for member in self.members}
        rng = np.random.default_rng(schedule.seed)
        self.centres = {m: rng.normal(size=DIMENSION) for m in self.members}
        self.wrong = {m: self.dice.uniform(-1, 1) * schedule.clocks for m in self.members}
        self._cuts: list[tuple[str, str, float, float]] = []  # from, to, since, until
        self._lossy: list[tuple[float, float]] = []
        self._frozen_since: dict[str, float] = {}
        self.offences: list[str] = []
        self.healed_by = 0.0  # [s]
        late = {f.agent for f in schedule.faults if f.kind == "late"}
        for i, member in enumerate(self.members):
            delay = 3.5 + self.dice.random() if i in late else 0.3 * self.dice.random()
            self.after(delay, lambda member=member: self.start(member, "lost"))  # type: ignore[misc]
        for fault in schedule.faults:
            self._plan(fault)

    def after(self, delay: float, call: Callable[[], None]) -> None:
        heapq.heappush(self._queue, (self.now + max(delay, 0.0), next(self._number), call))

    def run(self, until: float) -> None:
        """Let time pass."""
        while self._queue and self._queue[0][0] <= until:
            self.now, _, call = heapq.heappop(self._queue)
            call()
        self.now = until

    def _plan(self, fault: Fault) -> None:
        agent = self.members[fault.agent]
        match fault.kind:
            case "crash":
                self.after(fault.at, lambda: self.crash(agent))
                self.after(fault.at + fault.seconds, lambda: self.start(agent, fault.disk))
            case "leave":
                self.after(fault.at, lambda: self.crash(agent))
            case "freeze":
                self.after(fault.at, lambda: self.freeze(agent))
                self.after(fault.at + fault.seconds, lambda: self.thaw(agent))
            case "twin":
                self.after(fault.at, lambda: self.start(agent, fault.disk))
            case "cut":
                self.after(fault.at, lambda: self.cut(fault))
                for later in (LEASE + 0.05, fault.seconds + 0.05, fault.seconds + 0.3):
                    self.after(fault.at + later, self.refresh)
            case "lossy":
                self._lossy.append((fault.at, fault.at + fault.seconds))
            case "late" | "lie":
                pass

    def living(self, agent: str) -> list[Process]:
        return [p for p in self.processes if p.agent == agent and p.alive]

    def current(self, agent: str) -> Process | None:
        """The latest life of an agent, if it lives."""
        lives = self.living(agent)
        return max(lives, key=lambda p: int(p.life, 16)) if lives else None

    def crash(self, agent: str) -> None:
        for process in self.living(agent):
            process.alive = False
        self.after(0.01, self.refresh)

    def freeze(self, agent: str) -> None:
        if (process := self.current(agent)) is not None and not process.frozen:
            process.frozen = True
            self._frozen_since[process.life] = self.now
            self.after(LEASE + 0.01, self.refresh)

    def thaw(self, agent: str) -> None:
        for process in self.living(agent):
            if process.frozen:
                process.frozen = False
                held, process.held = process.held, []
                for call in held:
                    self.after(0.0, call)
                self.wake(process)
        self.after(0.2, self.refresh)

    def cut(self, fault: Fault) -> None:
        agent, until = self.members[fault.agent], self.now + fault.seconds
        others = self.members if fault.other < 0 else (self.members[fault.other],)
        for other in others:
            if other != agent:
                self._cuts.append((agent, other, self.now, until))
                if not fault.one_way:
                    self._cuts.append((other, agent, self.now, until))

    def _cut_since(self, sender: str, receiver: str) -> float | None:
        since = [
            s for a, b, s, u in self._cuts if (a, b) == (sender, receiver) and s <= self.now < u
        ]
        return min(since, default=None)

    # Processes

    def start(self, agent: str, disk: str) -> None:
        """Begin a life."""
        saved = self.disks[agent].saved
        at = None
        if disk != "lost" and saved:
            places = {"kept": -1, "torn": -2, "old": 0}
            at = saved[max(-len(saved), places[disk])]
        seen = [p for p in self.processes if p.alive and self._visible(agent, p)]
        known = [p.life for p in seen if p.agent == agent]
        known += [p.machine.peers[agent].life for p in seen if p.agent != agent]
        life = life_after(self.now + 1e6 + self.wrong[agent], self.dice.randrange(4096), known)
        machine = self._machine(
            agent, life, self.members,
            lambda here: neighbours(self.topology, here, agent),
            "same", self._last, TIMING, QUORUM, at["run"] if at else None,
        )  # fmt: skip
        mixer = Mixer(Mixing(rule=self.schedule.rule))
        theta, round_ = np.zeros(DIMENSION), 0
        if at is not None:
            theta, round_ = at["theta"].copy(), at["round"]
            mixer.state = dict(at["state"])
            for other, account in at["accounts"].items():
                machine.peers[other].account = Account(**account)
        answers = [
            Answer(self.spoil(p, p.machine.sign()), p.theta.copy())
            for p in seen
            if p.agent != agent
        ]
        lives = {p.agent: newest([q.life for q in seen if q.agent == p.agent]) for p in seen}
        chosen = choose(answers, lives, machine.membership.run if at else None, round_)
        if chosen is not None:
            self._judge_choice(agent, chosen, seen)
            theta, round_ = chosen.vector.copy(), chosen.header.round
            mixer.state = {}
            machine.adopt(chosen.header.run)
        process = Process(agent, life, machine, mixer, theta, theta.copy(), np.zeros(DIMENSION))
        self.processes.append(process)
        machine.start(self.now, round_, together=round_ == 0)
        self.after(0.05 + 0.1 * self.dice.random(), self.refresh)
        self.wake(process)

    @property
    def traitors(self) -> frozenset[str]:
        return frozenset(self.members[i] for i in self.schedule.traitors)

    def _judge_choice(self, agent: str, chosen: Answer, seen: list[Process]) -> None:
        """A joiner must not believe a lie while there are others to ask."""
        sender = max((p for p in seen if p.agent == chosen.header.agent), key=lambda p: p.life)
        honest = [p for p in seen if p.agent not in {agent, *self.traitors}]
        true, told = sender.machine.sign(), chosen.header
        fields = ("round", "norm", "run", "incarnation")
        if honest and any(getattr(true, name) != getattr(told, name) for name in fields):
            self.offences.append(f"{self.now:.2f}: {agent} takes a state that a liar offers")

    def _judge_jump(self, process: Process, target: int) -> None:
        """Nobody is carried to where no honest agent is."""
        others = [
            p.machine.round
            for p in self.processes
            if p is not process and p.agent not in self.traitors
        ]
        if process.agent not in self.traitors and others and target > max(others):
            process.offences.append(f"{self.now:.2f}: is carried to round {target}")

    def save(self, process: Process) -> None:
        accounts = {
            other: {
                name: getattr(peer.account, name)
                for name in ("number", "booked", "rounds", "open", "lives", "uses")
            }
            for other, peer in process.machine.peers.items()
        }
        self.disks[process.agent].saved.append(
            {
                "run": process.machine.membership.run, "round": process.machine.round,
                "theta": process.theta.copy(), "state": dict(process.mixer.state),
                "accounts": accounts,
            }
        )  # fmt: skip
        del self.disks[process.agent].saved[:-3]

    def _visible(self, observer: str, process: Process) -> bool:
        if not process.alive:
            return False
        frozen = self._frozen_since.get(process.life) if process.frozen else None
        cut = self._cut_since(process.agent, observer)
        silent = [self.now - since for since in (frozen, cut) if since is not None]
        return max(silent, default=0.0) < LEASE

    def refresh(self) -> None:
        """Tell everybody who is here."""
        for observer in self.processes:
            if observer.alive:
                self._deliver(observer, lambda observer=observer: self._present(observer))  # type: ignore[misc]

    def _present(self, observer: Process) -> None:
        lives: dict[str, list[str]] = {}
        for process in self.processes:
            if self._visible(observer.agent, process):
                lives.setdefault(process.agent, []).append(process.life)
        here = {agent: newest(each) for agent, each in lives.items()}
        own = here.pop(observer.agent, observer.life)
        observer.machine.present(self.now, here, own)
        self.wake(observer)

    def send(self, sender: Process, action: Send) -> None:
        for receiver in action.to:
            header = self.spoil(sender, action.header)
            vector = sender.sent.copy() if action.vector else None
            for _ in range(2 if self.dice.random() < self.schedule.duplicates else 1):
                lossy = any(since <= self.now < until for since, until in self._lossy)
                if lossy and self.dice.random() < 0.3:
                    continue
                if self._cut_since(sender.agent, receiver) is not None:
                    continue
                delay = self.schedule.latency + self.schedule.jitter * self.dice.random()
                self.after(delay, lambda r=receiver, h=header, v=vector: self._arrive(r, h, v))  # type: ignore[misc]

    def _arrive(self, receiver: str, header: ParameterHeader, vector: Vector | None) -> None:
        for process in self.living(receiver):
            self._deliver(process, lambda p=process: self._hear(p, header, vector))  # type: ignore[misc]

    def _deliver(self, process: Process, call: Callable[[], None]) -> None:
        if process.frozen:
            process.held.append(call)
        else:
            call()

    def _hear(self, process: Process, header: ParameterHeader, vector: Vector | None) -> None:
        if process.alive and header.agent in process.machine.peers:
            process.machine.heard(self.now, header, vector)
            self.wake(process)

    def spoil(self, sender: Process, header: ParameterHeader) -> ParameterHeader:
        """What a traitor makes of its header."""
        lies = [f for f in self.schedule.faults if f.kind == "lie" and self.now >= f.at]
        for fault in lies:
            if self.members[fault.agent] == sender.agent:
                return lie(header, fault.lie, self.members, self._last, self.dice)
        return header

    # One agent's rounds, as agent/daemon plays them

    def wake(self, process: Process) -> None:
        """Poll a process soon, once."""
        process.woken += 1
        mine = process.woken
        self.after(0.0, lambda: self._poll(process) if process.woken == mine else None)

    def _poll(self, process: Process) -> None:
        if not process.alive or process.frozen or process.busy:
            return
        for action in process.machine.poll(self.now):
            match action:
                case Send():
                    self.send(process, action)
                case Say():
                    process.said.append((self.now, action.cause, action.line))
                case Await():
                    if not action.causes:
                        process.offences.append(f"{self.now:.2f}: waits without a cause")
                    process.woken += 1
                    mine = process.woken
                    self.after(
                        action.until - self.now,
                        lambda m=mine: self._poll(process) if process.woken == m else None,  # type: ignore[misc]
                    )
                case Begin():
                    self._round(process, process.machine.round)
                case Again():
                    self._publish(process)
                    process.machine.ready(self.now)
                    self.wake(process)
                case Mix():
                    self._mix(process, action)
                case End():
                    process.alive, process.ended = False, action.line
                    self.after(0.01, self.refresh)

    def _round(self, process: Process, round_: int) -> None:
        process.machine.round = round_
        process.step = STEP * (self.centres[process.agent] - process.theta)
        if not process.mixer.rule.sends_after_step:
            self._publish(process)
        process.busy = True
        self.after(self.dice.uniform(*self._work), lambda: self._worked(process))

    def _worked(self, process: Process) -> None:
        def done() -> None:
            process.busy = False
            if process.mixer.rule.sends_after_step:
                self._publish(process)
            process.machine.ready(self.now)
            self.wake(process)

        if process.alive:
            self._deliver(process, done)

    def _publish(self, process: Process) -> None:
        process.mixer.outgoing(process.theta, process.step)
        process.sent = process.mixer.rule.message(process.theta, process.step, process.mixer.state)
        norm = float(np.linalg.norm(process.theta))
        for action in process.machine.begin(self.now, process.machine.round, norm):
            self.send(process, action)

    def _mix(self, process: Process, mix: Mix) -> None:
        machine, mixer = process.machine, process.mixer
        round_ = machine.round
        for neighbour, taken in mix.taken_back:
            process.theta = mixer.take_back(neighbour, process.theta)
            lives = [
                key for key in process.flows if key[1] == taken and key[0].startswith(neighbour)
            ]
            for key in lives:
                del process.flows[key]
        for neighbour in mix.void:
            mixer.forget(neighbour)
        own = len(machine.nearby)
        weights = {n: lazy_metropolis(own, mix.degrees[n]) for n in mix.used}
        arrived = {n: delivery.vector for n, delivery in mix.used.items()}
        for n, delivery in mix.used.items():
            header = delivery.header
            if header.run != machine.membership.run or header.round != round_:
                process.offences.append(f"{self.now:.2f}: used a vector of another run or round")
            if header.incarnation != machine.peers[n].life:
                process.offences.append(f"{self.now:.2f}: used a vector of another life of {n}")
        process.theta = mixer.mix(process.theta, process.step, arrived, weights)
        process.steps = process.steps + process.step
        for n, delivery in mix.used.items():
            key = (f"{n}/{delivery.header.incarnation}", round_)
            process.flows[key] = mixer.shares[n]
        process.rounds.append((self.now, round_, tuple(mix.used), machine.nearby))
        if mix.next_round > round_ + 1:
            self._judge_jump(process, mix.next_round)
        machine.round = mix.next_round
        if round_ % SAVED == 0:
            self.save(process)
        if mix.next_round < self._last:
            self._round(process, mix.next_round)
        else:
            process.ended = "finished"
