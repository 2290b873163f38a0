"""Four drones in containers: they learn, lose one, lose the way to another, and heal.

Builds the images of this tree and brings a whole compose file up, as a user does.  Needs Docker, or
a Debian machine and root (``tests/docker-engine.sh``).  ``pytest -s`` shows the time line.
"""

import json
import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from agent.config.experiment import load
from deploy.images.compose import compose_file
from tests.integration.harness import ROOT, until

pytestmark = [pytest.mark.integration, pytest.mark.timeout(900)]

ENGINE = ROOT / "tests" / "docker-engine.sh"
PROJECT = "dcpg-test"
HEALTHY = 180  # [s] to wait for; two cores need 28 s when they do nothing else
MEMBERS = {f"drone{i}" for i in range(4)}
SWARM = """
name = "containers"
rounds = 100000000
checkpoint_every = 1000

[estimator]
kind = "exact"
entropy_weight = 0.0

[topology]
kind = "ring"
""" + "".join(
    f'[[agents]]\nid = "drone{i}"\n'
    f'task = {{ env = "sim:GridWorld-v0", kwargs = {{ layout = "a", task = {i} }} }}\n'
    for i in range(4)
)


def call(*command: str | Path, limit: float = 120.0, check: bool = True) -> str:
    """Standard output of a command; when it fails, its complaint is the test's."""
    done = subprocess.run(
        [*map(str, command)], capture_output=True, text=True, timeout=limit, check=False
    )
    if check and done.returncode != 0:
        raise AssertionError(f"{' '.join(map(str, command))}: {done.stderr or done.stdout}")
    return done.stdout


@pytest.fixture(scope="module")
def engine() -> Iterator[None]:
    """Docker; ended again if it was started for this."""
    begun = time.monotonic()
    running = subprocess.run(["docker", "version"], capture_output=True, check=False).returncode
    done = subprocess.run([ENGINE, "up"], capture_output=True, text=True, timeout=600, check=False)
    if done.returncode != 0:
        reason = (done.stderr.strip().splitlines() or ["no Docker"])[-1]
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    print(f"{time.monotonic() - begun:6.1f} s  engine and base image", flush=True)
    yield
    if running != 0:
        call(ENGINE, "down")


class Containers:
    """The compose project of the test; it tells how long each part takes."""

    def __init__(self, folder: Path) -> None:
        self._since = time.monotonic()
        swarm, file, more = folder / "swarm.toml", folder / "compose.yaml", folder / "test.yaml"
        swarm.write_text(SWARM)
        file.write_text(compose_file(load(swarm), str(swarm), str(ROOT)))
        # No port of the host; PyTorch from a folder of wheels, if pip has one here.
        wheels = os.environ.get("PIP_FIND_LINKS", "")
        context = f"{{additional_contexts: {{wheels: {wheels}}}}}" if Path(wheels).is_dir() else ""
        agent = f"  drone0: {{build: {context}}}\n" if context else ""
        more.write_text(f"services:\n  viewer: {{ports: !reset []}}\n{agent}")
        self._compose = ("docker", "compose", "-p", PROJECT, "-f", str(file), "-f", str(more))

    def __call__(self, *command: str, limit: float = 120.0) -> str:
        return call(*self._compose, *command, limit=limit)

    def reached(self, what: str) -> None:
        """A line of the time line."""
        now = time.monotonic()
        print(f"{now - self._since:6.1f} s  {what}", flush=True)
        self._since = now

    def status(self) -> dict[str, Any]:
        """``swarm status --json``, asked from the viewer's container."""
        asked = ("status", "/etc/swarm/swarm.json", "--json", "--timeout", "3")
        said = call(*self._compose, "exec", "-T", "viewer", "swarm", *asked, check=False)
        answer: dict[str, Any] = json.loads(said) if said else {"agents": {}}
        return answer

    def rounds(self) -> dict[str, int]:
        """The round of every agent that answers."""
        return {name: agent["round"] for name, agent in self.status()["agents"].items()}

    def go_on(self, agents: set[str], beyond: dict[str, int]) -> None:
        """Wait until these agents, and no others, answer with later rounds than those."""
        until(
            lambda: (
                (now := self.rounds()).keys() == agents
                and all(now[agent] > beyond.get(agent, 0) for agent in agents)
            ),
            f"{sorted(agents)} beyond {beyond}",
            120.0,
        )


@pytest.fixture
def containers(engine: None, tmp_path: Path) -> Iterator[Containers]:
    """Built and up, all healthy; down at the end."""
    project = Containers(tmp_path)
    project("build", limit=600)
    project.reached("images built")
    try:
        wait = ("--wait", "--wait-timeout", str(HEALTHY))
        project("up", "--detach", "--no-build", *wait, limit=HEALTHY + 60)
        project.reached("nine containers up and healthy")
        yield project
    finally:
        with suppress(subprocess.TimeoutExpired):
            project("down", "--volumes", "--timeout", "3")


def test_a_swarm_in_containers_learns_loses_members_and_heals(containers: Containers) -> None:
    # Everybody is there, healthy, and goes on; they come to agree as the gradients fade.
    first = containers.status()
    assert first["agents"].keys() == MEMBERS
    rounds = {name: agent["round"] for name, agent in first["agents"].items()}
    until(
        lambda: (
            min((now := containers.status())["agents"][a]["round"] for a in MEMBERS)
            > 2 * max(rounds.values())
            and now["consensus_error"] < first["consensus_error"]
        ),
        "a smaller consensus error after twice the rounds",
        120.0,
    )
    containers.reached("twice the rounds, a smaller consensus error")

    # One is killed; the others go on, and it comes back to them.
    before = containers.rounds()
    containers("kill", "drone2")
    containers.go_on(MEMBERS - {"drone2"}, before)
    containers.reached("one killed, the others go on")
    before = containers.rounds()
    containers("start", "drone2")
    containers.go_on(MEMBERS, before)
    containers.reached("started again, all go on")

    # One is cut off; the others go on, and so does it, alone; then they meet again.
    network, container = f"{PROJECT}_swarm", f"{PROJECT}-drone3-1"
    before = containers.rounds()
    call("docker", "network", "disconnect", network, container)
    containers.go_on(MEMBERS - {"drone3"}, before)
    containers.reached("one cut off, the others go on")
    before = containers.rounds()
    call("docker", "network", "connect", "--alias", "drone3", network, container)
    containers.go_on(MEMBERS, before)
    until(lambda: containers.status().get("health") == "healthy", "health")
    containers.reached("connected again, all go on")

    # Nothing is left behind.
    containers("down", "--volumes", "--timeout", "3")
    label = f"label=com.docker.compose.project={PROJECT}"
    for kind in ("container", "network", "volume"):
        everything = ["--all"] if kind == "container" else []
        assert call("docker", kind, "ls", "--quiet", *everything, "--filter", label) == ""
    containers.reached("nothing is left")
