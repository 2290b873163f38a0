"""What ``swarm compose`` prints: a Docker Compose file for any swarm file.

Interface: :func:`compose_file`.  Each agent has a container, beside it a vehicle, and a viewer
serves the browser.  The containers share a network that leads nowhere else (Docker drops multicast
there), so agents dial each other by service name and learn of the rest by gossip.  The resolved
swarm file travels in the compose file itself.

Where a task flies a vehicle, its own (``body = "mavlink"``) or another one
(``"agent.vehicle.body:vehicle_bodies"``), it flies the container beside the agent, in real time and
in the same scene; the vehicles of other swarms stand by.
"""

import json
from string import Template

import msgspec
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

HEAD = Template("""\
# Written by: swarm compose $source
#
#   docker compose up --build --wait    # builds, starts, returns when all are healthy
#   docker compose exec viewer swarm status /etc/swarm/swarm.json
#   docker compose down --volumes       # without --volumes the next `up` goes on where this ended
#
# The viewer: http://localhost:9090/?url=rerun%2Bhttp://localhost:9876/proxy
name: $name

x-build: &build
  context: $context
  dockerfile: deploy/images/Dockerfile
  args:
    BASE: $${DOCKER_UP_IMAGE:-python:3.11-slim-bookworm}
    TORCH_INDEX: $${TORCH_INDEX:-}
    POLICY: $policy
    WORLDS: $worlds

x-container: &container
  init: true
  restart: on-failure
  cap_drop: [ALL]
  security_opt: ["no-new-privileges:true"]
  networks: [swarm]
  stop_grace_period: 15s  # a drone lands meanwhile

x-agent: &agent
  <<: *container
  image: dcpg-swarm-agent:$policy
  configs: [{source: swarm, target: /etc/swarm/swarm.json}]

x-vehicle: &vehicle
  <<: *container
  image: dcpg-swarm-vehicle

services:
""")
AGENT = Template("""\
  $agent:
    <<: *agent
    command: [--id, $agent]
    depends_on: [$vehicle]
    volumes: ["$agent:/var/lib/swarm"]$build_agent

  $vehicle:
    <<: *vehicle
    command: $options$build_vehicle

""")
BUILD = "\n    build: {<<: *build, target: %s}"  # said once for each image
VIEWER = """\
  viewer:
    <<: *container
    image: dcpg-swarm-viewer
    build: {<<: *build, target: viewer}
    configs: [{source: swarm, target: /etc/swarm/swarm.json}]
    networks: [swarm, outside]
    ports: ["127.0.0.1:9090:9090", "127.0.0.1:9876:9876"]

networks:
  swarm: {internal: true}
  outside: {}

volumes:
"""
TAIL = Template("""
configs:
  swarm:
    content: |
$content
""")


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
    for taken in ("viewer", *(vehicle_of(member) for member in config.members)):
        if taken in config.members:
            raise ConfigError(f'agent "{taken}": expected an id that is no other service\'s')
    agents = tuple(
        replace(
            agent,
            endpoint=f"tcp/{agent.id}:{PORT}",
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


def _beside_its_vehicle(agent: AgentEntry) -> Task:
    kwargs = agent.task.kwargs
    if kwargs.get("body") not in FLIES:
        return agent.task
    given = kwargs.get("body_options", {}) if kwargs["body"] == BODY else {}
    options = given | {"vehicle": f"udpout:{vehicle_of(agent.id)}:{MAVLINK}"}
    return replace(agent.task, kwargs=kwargs | {"body": BODY, "body_options": options})


def vehicle_options(agent: AgentEntry, system: int) -> list[str]:
    """Options of ``swarm vehicle`` for the container beside an agent."""
    kwargs = agent.task.kwargs
    options = ["--sysid", str(system), "--host", "0.0.0.0", "--ground-port", "0"]  # noqa: S104
    if kwargs.get("body") in FLIES:
        flavour = kwargs.get("body_options", {}).get("flavour", "px4")
        options += ["--flavour", flavour, "--scene", str(kwargs.get("scene", NAMES[0]))]
    return options


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
    name = config.name.lower().replace(".", "-")
    scenes = {str(agent.task.kwargs.get("scene", "")) for agent in inside.agents}
    worlds = json.dumps(" ".join(sorted(scenes & set(NAMES))))
    policy = "tabular" if isinstance(config.policy, Tabular) else "neural"  # as in the Dockerfile
    parts = [
        HEAD.substitute(source=source, name=name, context=context, policy=policy, worlds=worlds)
    ]
    for place, agent in enumerate(config.agents):
        first = place == 0
        parts.append(
            AGENT.substitute(
                agent=agent.id,
                vehicle=vehicle_of(agent.id),
                options=json.dumps(vehicle_options(agent, place + 1)),
                build_agent=BUILD % "agent" if first else "",
                build_vehicle=BUILD % "vehicle" if first else "",
            )
        )
    parts += [VIEWER, *(f"  {agent}:\n" for agent in inside.members)]
    text = msgspec.json.format(msgspec.json.encode(inside), indent=2).decode()
    text = text.replace("$", "$$")  # Compose would put variables in their place
    parts.append(TAIL.substitute(content="\n".join(f"      {line}" for line in text.splitlines())))
    return "".join(parts)
