"""Hosts made of network namespaces on one bridge, for those who study or test bad networks.

The bridge lives in a namespace of its own: the machine's own firewall never sees its frames.

Interface: :func:`why_not`, :func:`hosts`, :func:`settle`, :func:`inside`.
"""

import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from msgspec.structs import replace

from agent.config.experiment import SwarmFile
from swarm.errors import SwarmError

NETWORK = "10.77.0"  # /24, inside the namespaces only
DEVICE, PORT = "eth", 7450  # of every host
PREFIX = f"dcpg-{os.getpid()}"
TOOLS = ("ip", "tc", "iptables")


def why_not() -> str | None:
    """Why this machine cannot make hosts, or None."""
    if missing := [tool for tool in TOOLS if shutil.which(tool) is None]:
        return f"{', '.join(missing)} not installed (Debian: iproute2, iptables)"
    if os.geteuid() != 0:
        return "network namespaces need root"
    done = subprocess.run(
        ["ip", "netns", "add", PREFIX], capture_output=True, text=True, check=False
    )
    if done.returncode:
        return f"network namespaces are not allowed here: {done.stderr.strip()}"
    subprocess.run(["ip", "netns", "del", PREFIX], capture_output=True, check=False)
    return None


@contextmanager
def hosts(count: int) -> Iterator[list[str]]:
    """Names of new namespaces, with addresses ``10.77.0.1`` ... on :data:`DEVICE`.

    Raises:
        SwarmError: this machine cannot make them.
    """
    if reason := why_not():
        raise SwarmError(f"no hosts made of network namespaces: {reason}")
    switch, *names = (f"{PREFIX}-{i}" for i in range(count + 1))
    try:
        _ip(f"netns add {switch}")
        _ip(f"-n {switch} link add br0 type bridge mcast_snooping 0")
        _ip(f"-n {switch} link set br0 up")
        for i, name in enumerate(names, 1):
            _ip(f"netns add {name}")
            _ip(f"-n {name} link set lo up")
            _ip(f"link add {DEVICE} netns {name} type veth peer name p{i} netns {switch}")
            _ip(f"-n {switch} link set p{i} master br0 up")
            _ip(f"-n {name} addr add {NETWORK}.{i}/24 dev {DEVICE}")
            _ip(f"-n {name} link set {DEVICE} up")
            _ip(f"-n {name} route add 224.0.0.0/4 dev {DEVICE}")
        yield names
    finally:
        for name in [*names, switch]:
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


def settle(config: SwarmFile, names: Sequence[str]) -> SwarmFile:
    """The swarm with each agent on a host of its own, in order."""
    agents = tuple(
        replace(agent, namespace=name, device=DEVICE, endpoint=f"tcp/{NETWORK}.{i}:{PORT}")
        for i, (agent, name) in enumerate(zip(config.agents, names, strict=False), 1)
    )
    return replace(config, agents=agents)


def inside(name: str) -> list[str]:
    """Words before a command that is to run on a host."""
    return ["ip", "netns", "exec", name]


def _ip(arguments: str) -> None:
    done = subprocess.run(
        ["ip", *arguments.split()], capture_output=True, text=True, check=False, timeout=10
    )
    if done.returncode:
        raise SwarmError(f"ip {arguments}: {done.stderr.strip()}")
