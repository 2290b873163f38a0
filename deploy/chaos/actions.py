"""What a fault consists of: signals, commands in namespaces, jumps of clocks, each at its time.

Interface: :func:`plan`.  Decides all; does nothing.
"""

import signal
from dataclasses import dataclass

from agent.config.experiment import SwarmFile
from deploy.chaos.faults import Fault
from swarm.wire.endpoints import host_and_port

DUTY_CYCLE = 0.2  # [s] period of `slow`


@dataclass(frozen=True, slots=True)
class Action:
    """Something to do so long after its fault began.

    Attributes:
        at: how long after [s].
        label: for the user; "" where there is nothing to tell.
        signals: (agent, signal).
        commands: run one after the other.
        jumps: (agent, by how much its clock jumps [s]).
    """

    at: float
    label: str
    signals: tuple[tuple[str, signal.Signals], ...] = ()
    commands: tuple[tuple[str, ...], ...] = ()
    jumps: tuple[tuple[str, float], ...] = ()


def plan(fault: Fault, config: SwarmFile) -> list[Action]:
    """What a fault consists of, in order of time."""
    name, end = str(fault), f"end of {fault}"
    match fault.kind:
        case "kill":
            return [_signal(0.0, name, fault.agents, signal.SIGKILL)]
        case "restart":
            return [_signal(0.0, name, fault.agents, signal.SIGTERM)]
        case "freeze":
            return [
                _signal(0.0, name, fault.agents, signal.SIGSTOP),
                _signal(fault.seconds, end, fault.agents, signal.SIGCONT),
            ]
        case "slow":
            return _duty_cycle(fault)
        case "clock":
            return [Action(0.0, name, jumps=tuple((agent, fault.by) for agent in fault.agents))]
        case "partition" | "loss" | "rate":
            start, stop = _network_commands(fault, config)
            return [
                Action(0.0, name, commands=tuple(start)),
                Action(fault.seconds, end, commands=tuple(stop)),
            ]


def _signal(at: float, label: str, agents: tuple[str, ...], what: signal.Signals) -> Action:
    return Action(at, label, signals=tuple((agent, what) for agent in agents))


def _duty_cycle(fault: Fault) -> list[Action]:
    """Stop and go, with one line of news at the start and one at the end."""
    cycles = max(1, round(fault.seconds / DUTY_CYCLE))
    actions = []
    for i in range(cycles):
        at = i * DUTY_CYCLE
        label = f"{fault}" if i == 0 else ""
        actions.append(_signal(at, label, fault.agents, signal.SIGSTOP))
        label = f"end of {fault}" if i == cycles - 1 else ""
        go = at + DUTY_CYCLE * (1 - 1 / fault.factor)
        actions.append(_signal(go, label, fault.agents, signal.SIGCONT))
    return actions


def _network_commands(
    fault: Fault, config: SwarmFile
) -> tuple[list[tuple[str, ...]], list[tuple[str, ...]]]:
    """Commands that begin and end a fault of the network."""
    start: list[tuple[str, ...]] = []
    stop: list[tuple[str, ...]] = []
    others = [agent for agent in config.members if agent not in fault.agents]
    for agent in fault.agents:
        entry = config.agents[config.index(agent)]
        inside = ("ip", "netns", "exec", str(entry.namespace))
        if fault.kind == "partition":
            for other in others:
                address, _ = host_and_port(config.endpoint(other))
                table = "ip6tables" if ":" in address else "iptables"
                for rule in (("INPUT", "-s", address), ("OUTPUT", "-d", address)):
                    start.append((*inside, table, "-A", *rule, "-j", "DROP"))
                    stop.append((*inside, table, "-D", *rule, "-j", "DROP"))
        elif fault.kind == "loss":
            chance = ("-m", "statistic", "--mode", "random", "--probability")
            rule3 = ("INPUT", *chance, f"{fault.probability}", "-j", "DROP")
            start.append((*inside, "iptables", "-A", *rule3))
            stop.append((*inside, "iptables", "-D", *rule3))
        else:
            device = ("dev", str(entry.device), "root")
            shape = ("tbf", "rate", f"{fault.kbit}kbit", "burst", "32kbit", "latency", "400ms")
            start.append((*inside, "tc", "qdisc", "replace", *device, *shape))
            stop.append((*inside, "tc", "qdisc", "del", *device))
    return start, stop
