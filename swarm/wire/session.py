"""A Zenoh session from a :class:`Network`: endpoints, discovery, failure detection, queues, TLS.

Zenoh's log is never opened: it would follow ``RUST_LOG``, which ROS 2 users have set, and write to
standard output, where commands give their answers.

The values that are not options were measured on Zenoh 1.10 (``shared/zenoh.md``): together they let
healthy neighbours survive a frozen one, bound every wait, and keep a fragmenting or oversized
message from being believed.
"""

import json
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any, Literal

import msgspec
import zenoh

from swarm.errors import NetworkError
from swarm.wire.endpoints import PORTS
from swarm.wire.security import Party, Security

CLOSE_DEADLINE = 1.0  # [s] a blocked peer can hold close() for longer; we leave without it
LEAST_LEASE = 100  # [ms] four signs of life fit in; a guess
MAX_MESSAGE = 64 * 2**20  # [bytes] larger ones are dropped by the receiver's transport


class Network(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How agents find and reach each other.

    Attributes:
        discovery: ``endpoints`` dials the other agents' endpoints and sends nothing else anywhere;
            ``multicast`` dials nobody and looks for peers by UDP multicast.
        host: name or address (``::1`` as well) on which agents listen that have no ``endpoint`` of
            their own.
        base_port: agent number i of the file listens on ``base_port + i``.
        listen: where every agent listens instead of at its own endpoint, which others dial; e.g.
            ``tcp/0.0.0.0:7447`` in containers, whose addresses change.
        multicast_interface: address or name of the interface; ``auto`` asks the system.
        gossip: peers tell each other of peers, so that one known address suffices.
        lease_ms: a peer that is silent for so long counts as gone [ms].
        shared_memory: large payloads between processes of one machine go through /dev/shm.
        security: who may join and what each may say; off by default.
    """

    discovery: Literal["endpoints", "multicast"] = "endpoints"
    host: str = "127.0.0.1"
    base_port: Annotated[int, msgspec.Meta(ge=1, le=PORTS)] = 7450
    listen: str | None = None
    multicast_interface: str = "auto"
    gossip: bool = True
    lease_ms: Annotated[int, msgspec.Meta(ge=LEAST_LEASE)] = 2000
    shared_memory: bool = True
    security: Security = Security()

    @property
    def protocol(self) -> str:
        """Of every endpoint: ``tls`` or ``tcp``."""
        return "tls" if self.security.tls else "tcp"


def configuration(
    network: Network, party: Party, listen: Sequence[str], connect: Sequence[str]
) -> zenoh.Config:
    """Zenoh's configuration for a peer that listens here and, if it may, dials there."""
    values: dict[str, Any] = {
        "mode": "peer",
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect) if network.discovery == "endpoints" else [],
        # Seeds may start later than we do: keep trying, never fail.
        "connect/timeout_ms": -1,
        "connect/exit_on_failure": False,
        "connect/retry": {
            "period_init_ms": 100,
            "period_max_ms": 300,
            "period_increase_factor": 1.5,
        },
        "scouting/multicast/enabled": network.discovery == "multicast",
        "scouting/multicast/interface": network.multicast_interface,
        "scouting/gossip/enabled": network.gossip,
        "scouting/gossip/autoconnect_strategy": {"peer": {"to_peer": "greater-zid"}},
        "transport/link/tx/lease": network.lease_ms,
        "transport/link/tx/keep_alive": 4,
        "transport/link/tx/queue/size/data": 16,
        # What is put is small and has a thread of its own (swarm.wire.links): it may take its time;
        # who is frozen loses its link by the lease.
        "transport/link/tx/queue/congestion_control/block/wait_before_close": 10_000_000,  # [us]
        "transport/link/rx/max_message_size": MAX_MESSAGE,
        "transport/shared_memory/enabled": network.shared_memory,
        # Only what swarm.wire.shared puts there itself: the pool for the rest would be 16 MB an
        # agent.
        "transport/shared_memory/transport_optimization/enabled": False,
        **network.security.settings(party),
    }
    config = zenoh.Config()
    for key, value in values.items():
        config.insert_json5(key, json.dumps(value))
    return config


@contextmanager
def open_session(
    network: Network, party: Party, listen: Sequence[str], connect: Sequence[str]
) -> Iterator[zenoh.Session]:
    """A session of ``party`` that is closed at the end, in bounded time.

    Raises:
        ConfigError: a file of ``network.security`` will not do.
        NetworkError: it cannot be opened; most often the port is taken.
    """
    network.security.check(party.name)
    try:
        session = zenoh.open(configuration(network, party, listen, connect))
    except zenoh.ZError as error:
        reason = str(error).split(" at ")[0]
        raise NetworkError(
            f"cannot open a Zenoh session on {', '.join(listen) or 'any port'}: {reason}"
        ) from None
    try:
        yield session
    finally:
        closing = threading.Thread(target=session.close, name="zenoh-close", daemon=True)
        closing.start()
        closing.join(CLOSE_DEADLINE)
