"""Hosts of network namespaces on one bridge, made and removed by the tests that need them.

The bridge lives in a namespace of its own: the machine's own firewall never sees its frames.
"""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

NETWORK = "10.77.0"  # /24, inside the namespaces only
TOOLS = ("ip", "tc", "iptables")


def why_not() -> str | None:
    """Why this machine cannot make namespaces, or None."""
    if missing := [tool for tool in TOOLS if shutil.which(tool) is None]:
        return f"{', '.join(missing)} not installed (Debian: iproute2, iptables)"
    if os.geteuid() != 0:
        return "network namespaces need root"
    return None


@contextmanager
def hosts(count: int, prefix: str) -> Iterator[list[str]]:
    """Namespaces ``{prefix}1`` ... with addresses ``10.77.0.1`` ... on device ``eth``."""
    if reason := why_not():
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    switch, names = f"{prefix}sw", [f"{prefix}{i}" for i in range(1, count + 1)]
    try:
        _ip(f"netns add {switch}")
        _ip(f"-n {switch} link add br0 type bridge mcast_snooping 0")
        _ip(f"-n {switch} link set br0 up")
        for i, name in enumerate(names, 1):
            _ip(f"netns add {name}")
            _ip(f"-n {name} link set lo up")
            _ip(f"link add eth netns {name} type veth peer name p{i} netns {switch}")
            _ip(f"-n {switch} link set p{i} master br0 up")
            _ip(f"-n {name} addr add {NETWORK}.{i}/24 dev eth")
            _ip(f"-n {name} link set eth up")
            _ip(f"-n {name} route add 224.0.0.0/4 dev eth")
        yield names
    finally:
        for name in [*names, switch]:
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)


def _ip(arguments: str) -> None:
    done = subprocess.run(
        ["ip", *arguments.split()], capture_output=True, text=True, check=False, timeout=10
    )
    assert done.returncode == 0, f"ip {arguments}: {done.stderr.strip()}"
