"""What ``swarm compose`` prints: a Docker Compose file for any swarm file.

Interface: :func:`compose_file`.  Each agent has a container, and a viewer serves the browser.  The
containers share a network that leads nowhere else (Docker drops multicast there), so agents dial
each other by name and learn of the rest by gossip.  The resolved swarm file travels in the
compose file itself.

Where a task flies a vehicle, its own (``body = "mavlink"``) or another one
(``"agent.vehicle.body:vehicle_bodies"``), a container beside the agent is that vehicle, in real
time and in the same scene.

Ids may be words that YAML reads as something else (``1``, ``null``, ``0x10``, ``1e3``): whatever is
not plainly a word is quoted.
"""

import re
from typing import Any

import msgspec
import yaml
from msgspec.structs import replace

from agent.config.experiment import AgentEntry, SwarmFile, Task
from agent.learning.policies import Tabular
from sim.indoor.content.scenes import NAMES
from swarm.errors import ConfigError

PORT = 7447  # on which every agent listens in its container
MAVLINK = 14580  # on which a vehicle listens
BODY = "agent.vehicle.body:vehicle_bodies"
FLIES = ("mavlink", BODY)  # bodies that are vehicles
SYSTEMS = 250  # MAVLink system ids are 1 to 250 for vehicles
STATE = "/var/lib/swarm"  # where an agent keeps its run, in its container

HEAD = """\
# Written by: swarm compose {source}
#
#   docker compose up --build --wait    # builds, starts, returns when all are healthy
#   docker compose exec viewer swarm status /etc/swarm/swarm.json
#   docker compose down --volumes       # without --volumes the next `up` goes on where this ended
#
# The viewer: http://localhost:9090/?url=rerun%2Bhttp://localhost:9876/proxy
"""
CONTAINER: dict[str, Any] = {
    "init": True,
    "restart": "on-failure",
    "cap_drop": ["ALL"],
    "security_opt": ["no-new-privileges:true"],
    "networks": ["swarm"],
    "stop_grace_period": "15s",  # a drone lands meanwhile
}
SWARM_FILE = {"configs": [{"source": "swarm", "target": "/etc/swarm/swarm.json"}]}


def in_containers(config: SwarmFile) -> SwarmFile:
    """The swarm with every agent in a container of its name.

    Raises:
        ConfigError: it has what containers of this kind cannot have.
    """
    if config.network.security.ca or config.network.security.users:
        raise ConfigError(
            "network.security: expected none; mount certificates and set it in the compose file"
        )
    if len(config.agents) > SYSTEMS:
        raise ConfigError(f"{len(config.agents)} agents: expected at most {SYSTEMS}")
    for taken in ("viewer", *(vehicle_of(a.id) for a in config.agents if flies(a))):
        if taken in config.members:
            raise ConfigError(f'agent "{taken}": expected an id that is no other service\'s')
    agents = tuple(
        replace(
            agent,
            endpoint=f"tcp/{host_of(agent.id)}:{PORT}",
            namespace=None,
            device=None,
            task=_beside_its_vehicle(agent),
        )
        for agent in config.agents
    )
    network = replace(
        config.network,
        discovery="endpoints",
        listen=f"tcp/0.0.0.0:{PORT}",
        gossip=True,
        shared_memory=False,  # containers do not share /dev/shm
    )
    return replace(config, agents=agents, network=network)


def flies(agent: AgentEntry) -> bool:
    """Whether an agent's task flies a vehicle."""
    return agent.task.kwargs.get("body") in FLIES


def _beside_its_vehicle(agent: AgentEntry) -> Task:
    if not flies(agent):
        return agent.task
    kwargs = agent.task.kwargs
    given = kwargs.get("body_options", {}) if kwargs["body"] == BODY else {}
    options = given | {"vehicle": f"udpout:{vehicle_of(agent.id)}:{MAVLINK}"}
    return replace(agent.task, kwargs=kwargs | {"body": BODY, "body_options": options})


def vehicle_options(agent: AgentEntry, system: int) -> list[str]:
    """Options of ``swarm vehicle`` for the container beside an agent."""
    kwargs = agent.task.kwargs
    flavour = kwargs.get("body_options", {}).get("flavour", "px4")
    return [
        *("--sysid", str(system), "--host", "0.0.0.0", "--ground-port", "0"),  # noqa: S104
        *("--flavour", flavour, "--scene", str(kwargs.get("scene", NAMES[0]))),
    ]


def host_of(agent: str) -> str:
    """Under which name the others dial an agent; an id like 1 or 0x10 would be an address."""
    return f"agent-{agent}"


def vehicle_of(agent: str) -> str:
    """Service of an agent's vehicle."""
    return f"{agent}-vehicle"


def compose_file(config: SwarmFile, source: str, context: str) -> str:
    """The compose file of a swarm.

    Args:
        config: the swarm.
        source: what it was read from, for the first line.
        context: the repository's root, from the compose file's folder.

    Raises:
        ConfigError: it has what containers of this kind cannot have.
    """
    inside = in_containers(config)
    content = msgspec.json.format(msgspec.json.encode(inside), indent=2).decode()
    tables = {
        "name": re.sub(r"[^a-z0-9_-]", "-", config.name.lower()).lstrip("_-") or "swarm",
        "services": _services(config, _build(config, context)),
        "networks": {"swarm": {"internal": True}, "outside": {}},
        "volumes": {agent: {} for agent in config.members},
        "configs": {"swarm": {"content": _literally(content) + "\n"}},
    }
    head = HEAD.format(source=" ".join(source.split()))
    text: str = yaml.dump(
        tables, Dumper=_Dumper, sort_keys=False, width=10_000, default_flow_style=None
    )
    return head + text


def _build(config: SwarmFile, context: str) -> dict[str, Any]:
    """How images are built; ``target`` is added for each."""
    scenes = {str(agent.task.kwargs.get("scene", "")) for agent in config.agents}
    return {
        "context": _literally(context),
        "dockerfile": "deploy/images/Dockerfile",
        "args": {
            "BASE": "${DOCKER_UP_IMAGE:-python:3.11-slim-bookworm}",
            "TORCH_INDEX": "${TORCH_INDEX:-}",
            "POLICY": _policy(config),
            "WORLDS": " ".join(sorted(scenes & set(NAMES))),
        },
    }


def _services(config: SwarmFile, build: dict[str, Any]) -> dict[str, Any]:
    """Agents, vehicles and the viewer; how an image is built is said where it is used first."""
    services: dict[str, Any] = {}
    unbuilt = {"agent", "vehicle"}

    def built(target: str) -> dict[str, Any]:
        if target not in unbuilt:
            return {}
        unbuilt.discard(target)
        return {"build": build | {"target": target}}

    for place, agent in enumerate(config.agents):
        services[agent.id] = {
            "image": f"dcpg-swarm-agent:{_policy(config)}",
            **built("agent"),
            "command": ["--id", agent.id],
            **({"depends_on": [vehicle_of(agent.id)]} if flies(agent) else {}),
            "volumes": [{"type": "volume", "source": agent.id, "target": STATE}],
            **SWARM_FILE,
            **CONTAINER,
            "networks": {"swarm": {"aliases": [host_of(agent.id)]}},
        }
        if flies(agent):
            services[vehicle_of(agent.id)] = {
                "image": "dcpg-swarm-vehicle",
                **built("vehicle"),
                "command": vehicle_options(agent, place + 1),
                **CONTAINER,
            }
    services["viewer"] = {
        "image": "dcpg-swarm-viewer",
        "build": build | {"target": "viewer"},
        "ports": ["127.0.0.1:9090:9090", "127.0.0.1:9876:9876"],
        **SWARM_FILE,
        **CONTAINER,
        "networks": ["swarm", "outside"],
    }
    return services


def _policy(config: SwarmFile) -> str:
    """As in the Dockerfile."""
    return "tabular" if isinstance(config.policy, Tabular) else "neural"


def _literally(text: str) -> str:
    """Text in which Compose puts no variables."""
    return text.replace("$", "$$")


class _Dumper(yaml.SafeDumper):  # type: ignore[misc]
    """Quotes what a YAML reader of any version might take for something else than a string."""

    def ignore_aliases(self, data: Any) -> bool:
        """Everything stands where it belongs."""
        return True


_WORD = re.compile(r"[A-Za-z][\w./-]*")
_NO_WORDS = {"y", "n", "yes", "no", "on", "off", "true", "false", "null", "nan", "inf"}


def _text(dumper: _Dumper, text: str) -> yaml.Node:
    style = "'"
    if "\n" in text:
        style = "|"
    elif _WORD.fullmatch(text) and text.lower() not in _NO_WORDS:
        style = ""
    return dumper.represent_scalar("tag:yaml.org,2002:str", text, style=style)


_Dumper.add_representer(str, _text)
