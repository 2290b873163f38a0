"""A newcomer without a swarm file gets it from the swarm: ``swarm agent --join NAME``.

Interface: :func:`serve_config` at those who are there, :func:`fetch_config` at the one who comes;
round and parameters follow with :meth:`swarm.protocol.transfer.Handover.fetch`.  What is received
is read as strictly as a file, and is trusted less: it comes from a member of the swarm that it
describes, may name tasks of this project and of Gymnasium only, no other module and no path, and
does not say where the newcomer listens beyond the endpoint that the others dial.
"""

import logging
import re
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import msgspec
import zenoh
from msgspec.structs import replace

from agent.config.beside import strings
from agent.config.experiment import SwarmFile, Task, read
from agent.config.strict import convert, override
from swarm.errors import ConfigError, NetworkError, PayloadError
from swarm.wire.endpoints import host_and_port
from swarm.wire.keys import Keys
from swarm.wire.security import Party, Security
from swarm.wire.session import Network, open_session

log = logging.getLogger(__name__)
DEADLINE = 3.0  # [s] for somebody to answer
ASK_AGAIN = 0.5  # [s] links may still be on their way
LONGEST = 1 << 20  # [bytes] of a swarm file
EVERYWHERE = ("0.0.0.0", "::")  # noqa: S104  (refused here; addresses that mean all)
_ENVIRONMENT = re.compile(r"(sim:)?[A-Za-z0-9_-]+-v\d+")
_PLAIN = re.compile(r"[A-Za-z0-9_.-]*")


class Offer(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What an agent answers.

    Attributes:
        round: how far it is.
        config: the swarm file as JSON, without its ``network.security``.
    """

    round: Annotated[int, msgspec.Meta(ge=0)]
    config: bytes


def serve_config(
    session: zenoh.Session, keys: Keys, agent: str, config: SwarmFile, round_: Callable[[], int]
) -> None:
    """Answer newcomers on Zenoh's thread; files of security stay where they are."""
    network = replace(config.network, security=Security())
    text = msgspec.json.encode(replace(config, network=network, modules=()))

    def answer(query: zenoh.Query) -> None:
        query.reply(keys.config(agent), msgspec.msgpack.encode(Offer(round_(), text)))

    session.declare_queryable(keys.config(agent), answer)


def fetch_config(
    swarm: str, agent: str, connect: Sequence[str], settings: Iterable[str] = ()
) -> SwarmFile:
    """The swarm file of whoever is furthest on.

    Args:
        swarm: name of the swarm.
        agent: own id; the file must know it.
        connect: endpoints of agents to ask; empty: whoever multicast finds.
        settings: as on the command line; they also say how to reach the swarm.

    Raises:
        NetworkError: nobody answers in time.
        ConfigError: what they answer will not do, or is not to be trusted.
    """
    settings = list(settings)
    tables: dict[str, Any] = {}
    override(tables, [setting for setting in settings if setting.startswith("network.")])
    if not connect:
        tables.setdefault("network", {}).setdefault("discovery", "multicast")
    network = convert(tables.get("network", {}), Network, "--set network")
    network = replace(network, security=network.security.beside(Path()))
    if network.security.tls:
        raise ConfigError(
            "--join with certificates: expected the swarm file, which says who may say what"
        )
    start, keys = time.monotonic(), Keys(swarm)
    with open_session(network, Party(agent, keys, (agent,)), (), connect) as session:
        sender, offer = _ask(session, keys, agent, connect)
    where = f"swarm file of {sender}"
    try:
        received = msgspec.json.decode(offer.config)
    except msgspec.DecodeError as error:
        raise ConfigError(f"{where} does not read: {error}") from None
    if not isinstance(received, dict):
        raise ConfigError(f"{where} holds no table: expected the keys of a swarm file")
    check_network(read(received, (), where), sender, where)
    config = read(received, settings, where)
    security = config.network.security.beside(Path())
    config = replace(config, network=replace(config.network, security=security))
    if config.name != swarm:
        raise ConfigError(f'{where}: name = "{config.name}": expected "{swarm}", as asked for')
    config.index(agent)
    for entry in config.agents:
        check_task(entry.task, where)
    taken = time.monotonic() - start
    log.info("configuration from %s in round %d after %.1f s", sender, offer.round, taken)
    return config


def _ask(
    session: zenoh.Session, keys: Keys, agent: str, connect: Sequence[str]
) -> tuple[str, Offer]:
    """The best offer, and whose."""
    end = time.monotonic() + DEADLINE
    while (left := end - time.monotonic()) > 0:
        asked = time.monotonic()
        offers = dict(_offers(session, keys, min(left, ASK_AGAIN)))
        offers.pop(agent, None)
        if offers:
            return _best(offers)
        time.sleep(max(0.0, min(left, ASK_AGAIN) - (time.monotonic() - asked)))
    where = f"at {', '.join(connect)}" if connect else "by multicast"
    raise NetworkError(
        f'nobody of swarm "{keys.swarm}" answers {where} within {DEADLINE:.0f} s: '
        "expected a running agent, see swarm doctor"
    )


def _best(offers: dict[str, Offer]) -> tuple[str, Offer]:
    """The file that most agree on, from whoever of them is furthest on."""
    votes = Counter(offer.config for offer in offers.values())
    return max(offers.items(), key=lambda entry: (votes[entry[1].config], entry[1].round))


def _offers(session: zenoh.Session, keys: Keys, timeout: float) -> Iterable[tuple[str, Offer]]:
    for reply in session.get(
        keys.config(), timeout=timeout, consolidation=zenoh.ConsolidationMode.NONE
    ):
        if reply.ok is None or len(body := reply.ok.payload.to_bytes()) > LONGEST:
            continue
        try:
            sender = Keys.identity(str(reply.ok.key_expr))[1]
            yield sender, msgspec.msgpack.decode(body, type=Offer)
        except (PayloadError, msgspec.MsgspecError, UnicodeDecodeError) as error:
            log.warning("dropped an answer on %s: %s", reply.ok.key_expr, error)


def check_network(config: SwarmFile, sender: str, where: str) -> None:
    """See that a received file comes from one of its agents and opens nothing here.

    Raises:
        ConfigError: it names files, an address to listen on, or a device.
    """
    network, trust = config.network, "to trust more, start with the swarm file itself"
    if sender not in config.members:
        raise ConfigError(f'{where}: "{sender}" is none of its agents: expected one that is')
    if network.security != Security():
        raise ConfigError(f"{where} names files in [network.security]: expected none; {trust}")
    if config.modules:
        raise ConfigError(f'{where}: modules in "{config.modules[0]}": expected none; {trust}')
    if network.listen is not None:
        raise ConfigError(f'{where}: network.listen = "{network.listen}": expected none; {trust}')
    for member in config.members:
        host, _ = host_and_port(endpoint := config.endpoint(member))
        if host in EVERYWHERE:
            raise ConfigError(f'{where}: {member} at "{endpoint}": expected one address; {trust}')
    for agent in config.agents:
        if device := agent.namespace or agent.device:
            raise ConfigError(f'{where}: agent "{agent.id}" on "{device}": expected none; {trust}')


def check_task(task: Task, where: str) -> None:
    """See that a received task names nothing but worlds of this project or of Gymnasium.

    Raises:
        ConfigError: it names a module or a path.
    """
    texts = [text for text in strings(task.kwargs) if not _PLAIN.fullmatch(text)]
    for text in texts if _ENVIRONMENT.fullmatch(task.env) else [task.env]:
        raise ConfigError(
            f'{where}: task names "{text}": expected sim:Name-v0 or Name-v0 and plain names; '
            "to trust more, start with the swarm file itself"
        )
