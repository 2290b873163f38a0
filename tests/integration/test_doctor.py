"""``swarm doctor`` beside real swarms, and where there is none."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest

from deploy.images.certs import make_certificates
from swarm.wire.security import Security
from tests.integration.harness import (
    GRIDWORLD_A,
    MEMBERS,
    Command,
    ask,
    free_base_port,
    rounds_played,
    run,
    swarm,
    until,
)

pytestmark = pytest.mark.integration
ENDLESS = ("--no-record", "--set", "rounds=1000000")


def security(folder: Path) -> list[str]:
    files = Security(f"{folder}/ca.pem", f"{folder}/{{agent}}.pem", f"{folder}/{{agent}}.key")
    table = ", ".join(f'{k} = "{v}"' for k, v in msgspec.to_builtins(files).items() if v)
    return ["--set", f"network.security={{{table}}}"]


@contextmanager
def learning(folder: Path, *settings: str) -> Iterator[Command]:
    """A swarm that is under way."""
    up = swarm("up", GRIDWORLD_A, "--run", folder, *ENDLESS, *settings, cwd=folder.parent)
    with up as command:
        command.says("first round")
        until(lambda: min(rounds_played(folder, m) for m in MEMBERS) > 3, "round 3")
        yield command


def doctor(cwd: Path, *arguments: str | Path, timeout: float = 3.0) -> tuple[int, dict[str, Any]]:
    """``swarm doctor --json``: (exit code, what it said)."""
    return ask("doctor", *arguments, "--timeout", str(timeout), cwd=cwd)


def failed(diagnosis: dict[str, Any]) -> dict[str, list[str]]:
    """By name of the check, what was found and advised where it failed."""
    bad: dict[str, list[str]] = {}
    for check in diagnosis["checks"]:
        if check["ok"] is False:
            bad.setdefault(check["name"], []).append(f"{check['found']} -> {check['advice']}")
    return bad


def test_beside_a_swarm_with_tls(tmp_path: Path) -> None:
    """All is well; another name, foreign certificates, no certificates, another layout."""
    for name in ("ours", "foreign"):
        make_certificates(tmp_path / name, dict.fromkeys(MEMBERS, ()))
    folder = tmp_path / "run"
    with learning(folder, *security(tmp_path / "ours")):
        for arguments in ([], ["--id", "drone1"]):
            code, seen = doctor(tmp_path, folder, *arguments, timeout=10.0)
            assert (code, failed(seen)) == (0, {}), seen
            assert len(seen["endpoints"]) == 4
            found = {check["name"]: check["found"] for check in seen["checks"]}
            assert found["members"] == "drone0, drone1, drone2, drone3 present"
            assert found["layout"] == "drone0, drone1, drone2, drone3: as this file"
        assert "held by drone1, which runs" in found["own port"]

        code, seen = doctor(tmp_path, folder, "--set", "name=other")
        assert (code, seen["endpoints"]) == (1, [])
        assert set(failed(seen)) == {"endpoint", "members"}
        assert 'set name = "gridworld-a" here' in failed(seen)["members"][0]

        code, seen = doctor(tmp_path, folder, "--set", "mixing.compression=fp16", timeout=10.0)
        assert code == 1
        assert set(failed(seen)) == {"layout"}
        assert "drone3 has layout" in failed(seen)["layout"][0]

        code, seen = doctor(tmp_path, folder, *security(tmp_path / "foreign"))
        assert (code, seen["endpoints"]) == (1, [])
        assert len(failed(seen)["endpoint"]) == 4
        assert all("certificate is not good" in line for line in failed(seen)["endpoint"])

        (tmp_path / "ours" / "observer.key").unlink()
        code, seen = doctor(tmp_path, folder)
        assert code == 1
        assert list(failed(seen)) == ["certificate"]
        assert "observer.key" in failed(seen)["certificate"][0]

        code, seen = doctor(tmp_path, folder, "--set", 'network.security={ca=""}')
        assert code == 1
        assert all("speaks TLS, this file does not" in x for x in failed(seen)["endpoint"])


def test_where_an_agent_is_missing_and_the_id_is_another_ones(tmp_path: Path) -> None:
    """Three of four run by hand; one address leads nowhere, one port is held by the wrong agent."""
    port = free_base_port(4)
    settings = ["--set", f"network.base_port={port}", "--set", "timing.start=0.5"]
    agents = [
        swarm(
            *("agent", GRIDWORLD_A, "--id", member, "--run", tmp_path / member),
            *("--set", "rounds=1000000", *settings),
            cwd=tmp_path,
        )
        for member in MEMBERS[:2]
    ]
    with agents[0], agents[1]:
        for member in MEMBERS[:2]:
            until(lambda m=member: rounds_played(tmp_path / m, m) > 3, "round 3")  # type: ignore[misc]
        nowhere = "agents.3.endpoint=tcp/no-such-host.invalid:7450"
        code, seen = doctor(tmp_path, GRIDWORLD_A, *settings, "--set", nowhere)
        assert code == 1
        assert seen["endpoints"] == [f"tcp/127.0.0.1:{port + i}" for i in range(2)]
        refused, unknown = failed(seen)["endpoint"]
        assert f"drone2 at tcp/127.0.0.1:{port + 2}: nobody listens there" in refused
        assert "drone3 at tcp/no-such-host.invalid:7450: host is not known" in unknown
        assert "drone2, drone3 absent" in failed(seen)["members"][0]

        code, seen = doctor(tmp_path, GRIDWORLD_A, *settings, "--id", "drone2")
        assert code == 1
        assert "own port" not in failed(seen)

        wrong = f"agents.2.endpoint=tcp/127.0.0.1:{port}"
        code, seen = doctor(tmp_path, GRIDWORLD_A, *settings, "--set", wrong, "--id", "drone2")
        assert code == 1
        assert 'taken by drone0 of swarm "gridworld-a"' in failed(seen)["own port"][0]


@pytest.mark.parametrize("secure", [False, True])
def test_a_port_taken_by_a_foreign_listener(tmp_path: Path, secure: bool) -> None:
    port = free_base_port(4)
    settings = ["--set", f"network.base_port={port}"]
    if secure:
        make_certificates(tmp_path / "c", dict.fromkeys(MEMBERS, ()))
        settings += security(tmp_path / "c")
    with socket.create_server(("127.0.0.1", port)):
        code, seen = doctor(tmp_path, GRIDWORLD_A, *settings, "--id", "drone0", timeout=1.0)
        assert code == 1
        (line,) = failed(seen)["own port"]
        assert "taken by a program that is no agent" in line
        assert f"sport = :{port}" in line

        code, seen = doctor(tmp_path, GRIDWORLD_A, *settings, timeout=1.0)
        assert code == 1
        first = failed(seen)["endpoint"][0]
        assert ("does not speak TLS" if secure else "opens no Zenoh session") in first


def test_multicast_on_loopback_and_where_it_is_blocked(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    multicast = ("--set", "network.discovery=multicast", "--set", "network.multicast_interface=lo")
    with learning(folder, *multicast):
        code, seen = doctor(tmp_path, folder, timeout=10.0)
        assert (code, failed(seen)) == (0, {}), seen
        (heard,) = (check["found"] for check in seen["checks"] if check["name"] == "multicast")
        for endpoint in seen["endpoints"]:
            assert endpoint in heard
        nowhere = "network.multicast_interface=no-such0"
        code, seen = doctor(tmp_path, folder, "--set", nowhere)
        assert code == 1
        assert 'set network.discovery = "endpoints"' in failed(seen)["multicast"][0]


def test_it_reads_well(tmp_path: Path) -> None:
    port = free_base_port(4)
    code, output = run(
        *("doctor", GRIDWORLD_A, "--id", "drone0"),
        *("--set", f"network.base_port={port}", "--timeout", "0.2"),
        cwd=tmp_path,
    )
    assert code == 1
    lines = output.splitlines()
    assert lines[0].startswith('✓ file        swarm "gridworld-a" of 4 agents')
    assert lines[2] == f"✓ own port    tcp/127.0.0.1:{port} is free; drone0 does not run"
    assert lines[3] == f"✗ endpoint    drone1 at tcp/127.0.0.1:{port + 1}: nobody listens there"
    assert lines[-1] == "→ start the agent, or correct its endpoint"
