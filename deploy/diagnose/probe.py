"""What ``swarm doctor`` sees, as plain facts: sockets, certificates, Zenoh.  It judges nothing.

Interface: :func:`examine`.  Each endpoint is looked at through a session of its own that knows no
other (peers do not relay), so what comes back is said by who lives there.
"""

import errno
import json
import socket
import ssl
import time
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import msgspec
import zenoh

from agent.config.experiment import SwarmFile
from agent.daemon.process import layout_of
from agent.learning.learners import build_learner
from swarm.errors import ConfigError, PayloadError, TooEarlyError
from swarm.protocol.messages import PROTOCOL
from swarm.reports.telemetry import RoundReport, watch_reports
from swarm.wire.endpoints import host_and_port, plain_host
from swarm.wire.keys import Keys
from swarm.wire.security import OBSERVER, Certificate, Party, contexts, hosts_in, read_certificate
from swarm.wire.session import Network, open_session

PAUSE = 0.02  # [s] between two looks
LISTEN = 1.0  # [s] for a round's messages: who is not learning now sends none
AT_ONCE = 16  # endpoints looked at side by side

Outcome = Literal[
    "zenoh",  # a session opened
    "unresolved",  # no such host
    "refused",  # nobody listens
    "silent",  # no answer in time
    "unreachable",  # the network says so
    "tls only",  # TLS, and this file has no security
    "not tls",  # something else, and this file demands TLS
    "foreign",  # its certificate is not of our authority, or has expired
    "other host",  # its certificate is for other hosts
    "rejects us",  # our certificate is refused
    "stranger",  # listens, but opens no Zenoh session
    "untried",  # listens; we have no good certificate to go on with
]
Port = Literal["free", "taken", "not here", "forbidden"]
Token = tuple[str, str]  # (swarm, agent)


class Spoken(msgspec.Struct, frozen=True):
    """The part of a parameter header that every protocol version has."""

    version: int
    fingerprint: str


@dataclass(frozen=True, slots=True)
class Language:
    """What a swarm file makes an agent say of itself: in rounds, and to joiners."""

    params: Spoken
    state: Spoken


@dataclass(frozen=True, slots=True)
class Answer:
    """What an endpoint gave.

    Attributes:
        endpoint: which.
        outcome: how far we got.
        detail: the system's words where they add something.
        tokens: who lives there, of whatever swarm.
        params, state: protocol and layout heard of an agent of our swarm there.
        clock: its clock less ours [s], as far as the network's delay lets us see.
    """

    endpoint: str
    outcome: Outcome
    detail: str = ""
    tokens: tuple[Token, ...] = ()
    params: Spoken | None = None
    state: Spoken | None = None
    clock: float | None = None


@dataclass(frozen=True, slots=True)
class Facts:
    """Everything that :mod:`deploy.diagnose.doctor` judges.

    Attributes:
        config: the swarm file.
        agent: on whose behalf, or None for an observer's.
        now: Unix time [s].
        ours: protocol and layouts of this file.
        certificate: the own one; what is wrong with it; or None when TLS is off.
        port: state of the agent's own port; None for observers.
        answers: of the file's endpoints, by agent.
        present: tokens seen by a session as an agent's own.
        echo: whether our own multicast came back; None when it is not used.
        hellos: endpoints that others told by multicast.
        early: nothing is wrong with the certificate but that it is not valid yet.
    """

    config: SwarmFile
    agent: str | None
    now: float
    ours: Language
    certificate: Certificate | str | None
    port: Port | None
    answers: dict[str, Answer]
    present: tuple[Token, ...] = ()
    echo: bool | None = None
    hellos: tuple[str, ...] = ()
    early: bool = False


def examine(config: SwarmFile, agent: str | None, ours: Language, timeout: float) -> Facts:
    """Look at everything; no single wait is longer than ``timeout`` [s]."""
    party = config.party(agent or OBSERVER)
    certificate, early = _certificate(config.network, party)
    able = not isinstance(certificate, str)
    endpoints = {member: config.endpoint(member) for member in config.members}

    def look(endpoint: str) -> Answer:
        return probe(config.network, party, endpoint, able, timeout)

    with ThreadPoolExecutor(AT_ONCE) as pool:
        present = pool.submit(_present, config, party, timeout) if able else None
        multicast = config.network.discovery == "multicast"
        interface = config.network.multicast_interface
        scouted = pool.submit(_scout, interface, timeout) if multicast else None
        answers = dict(zip(endpoints, pool.map(look, endpoints.values()), strict=True))
        return Facts(
            config=config,
            agent=agent,
            now=time.time(),
            ours=ours,
            certificate=certificate,
            port=own_port(endpoints[agent]) if agent else None,
            answers=answers,
            present=present.result() if present else (),
            echo=scouted.result()[0] if scouted else None,
            hellos=scouted.result()[1] if scouted else (),
            early=early,
        )


def language(config: SwarmFile) -> Language:
    """What the agents of this file say.

    Raises:
        ConfigError: the first task cannot be built.
    """
    layout = layout_of(config, build_learner(config, config.members[0]))
    plain = replace(layout, copies=1, codec="none")
    return Language(Spoken(PROTOCOL, layout.fingerprint), Spoken(PROTOCOL, plain.fingerprint))


def _certificate(network: Network, party: Party) -> tuple[Certificate | str | None, bool]:
    """The own one, or what is wrong with it; and whether only the time is."""
    try:
        network.security.check(party.name)
        if not network.security.tls:
            return None, False
        return read_certificate(network.security.files_of(party.name)), False
    except ConfigError as error:
        return str(error), isinstance(error, TooEarlyError)


def own_port(endpoint: str) -> Port:
    """Whether one could listen there."""
    host, port = host_and_port(endpoint)
    try:
        family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind) as place:
            place.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            place.bind(address)
    except socket.gaierror:
        return "not here"
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            return "taken"
        return "forbidden" if error.errno == errno.EACCES else "not here"
    return "free"


# --- one endpoint ---------------------------------------------------------------------------


def probe(network: Network, party: Party, endpoint: str, able: bool, timeout: float) -> Answer:
    """Resolve, connect, open a Zenoh session, ask; and where that fails, see what is there."""
    host, port = host_and_port(endpoint)
    try:
        socket.create_connection((host, port), timeout).close()
    except socket.gaierror as error:
        return Answer(endpoint, "unresolved", str(error.strerror))
    except ConnectionRefusedError:
        return Answer(endpoint, "refused")
    except TimeoutError:
        return Answer(endpoint, "silent")
    except OSError as error:
        return Answer(endpoint, "unreachable", str(error.strerror))
    if not able:
        return Answer(endpoint, "untried")
    alone = msgspec.structs.replace(network, discovery="endpoints", gossip=False)
    with open_session(alone, party, (), [endpoint]) as session:
        if _until(lambda: bool(session.info.links()), timeout):
            return _ask(session, party.keys, endpoint, timeout)
    return replace(_who_else(network, party, host, port, timeout), endpoint=endpoint)


def _ask(session: zenoh.Session, keys: Keys, endpoint: str, timeout: float) -> Answer:
    """Who lives at the other end, what they speak, what time they have."""
    clocks: list[float] = []
    params: list[Spoken] = []
    state: list[Spoken] = []

    def on_report(report: RoundReport) -> None:
        clocks.append(report.time - time.time())

    watch_reports(session, keys, on_report)
    session.declare_subscriber(keys.params(), lambda sample: _read(sample, params))
    tokens: tuple[Token, ...] = ()

    def known() -> bool:
        nonlocal tokens
        tokens = _tokens(session, timeout)
        if tokens and all(swarm != keys.swarm for swarm, _ in tokens):
            return True  # of another swarm, which says nothing under our keys
        if not state:
            for reply in session.get(keys.state(), timeout=timeout):
                if reply.ok is not None:
                    _read(reply.ok, state)
        return bool(tokens and clocks and params and state)

    _until(known, min(timeout, LISTEN))
    return Answer(
        endpoint,
        "zenoh",
        tokens=tokens,
        params=params[0] if params else None,
        state=state[0] if state else None,
        clock=clocks[0] if clocks else None,
    )


def _read(sample: zenoh.Sample, into: list[Spoken]) -> None:
    """Keep what the first readable header says."""
    if not into and sample.attachment is not None:
        with suppress(msgspec.MsgspecError):
            into.append(msgspec.msgpack.decode(sample.attachment.to_bytes(), type=Spoken))


def _tokens(session: zenoh.Session, timeout: float) -> tuple[Token, ...]:
    """Every agent of every swarm that this session sees."""
    found = set()
    for reply in session.liveliness().get(Keys("*").alive(), timeout=timeout):
        if reply.ok is not None:
            with suppress(PayloadError):  # nobody's token
                found.add(Keys.identity(str(reply.ok.key_expr)))
    return tuple(sorted(found))


def _who_else(network: Network, party: Party, host: str, port: int, timeout: float) -> Answer:
    """Why no Zenoh session opens where somebody listens."""
    if network.security.tls:
        context, _ = contexts(network.security.files_of(party.name))
    else:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
    try:
        with socket.create_connection((host, port), timeout) as plain:
            link = context.wrap_socket(plain, server_hostname=host)
    except ssl.SSLCertVerificationError as error:
        return Answer("", "foreign", error.verify_message)
    except OSError as error:  # ssl's own and time-outs among them
        refused = isinstance(error, ssl.SSLError) and "ALERT" in (error.reason or "")
        if network.security.tls:
            return Answer("", "rejects us" if refused else "not tls")
        return Answer("", "tls only" if refused else "stranger")
    with link:
        if not network.security.tls:
            return Answer("", "tls only")
        names = hosts_in(link.getpeercert())
        if not fits(host, names):
            return Answer("", "other host", ", ".join(names))
        try:
            link.recv(1)  # TLS 1.3 refuses a client's certificate after the handshake
        except TimeoutError:
            return Answer("", "stranger")
        except OSError:
            return Answer("", "rejects us")
    return Answer("", "stranger")


def fits(host: str, names: Collection[str]) -> bool:
    """Whether a certificate with these names may be dialled at ``host``."""
    return plain_host(host) in map(plain_host, names)


# --- the network ----------------------------------------------------------------------------


def _present(config: SwarmFile, party: Party, timeout: float) -> tuple[Token, ...]:
    """Who is seen by a session like an agent's: with gossip, or by multicast."""
    endpoints = [config.endpoint(member) for member in config.members if member != party.name]
    wanted = {(config.name, member) for member in config.members if member != party.name}
    tokens: tuple[Token, ...] = ()

    def complete() -> bool:
        nonlocal tokens
        tokens = _tokens(session, timeout)
        return wanted <= set(tokens)

    with open_session(config.network, party, (), endpoints) as session:
        _until(complete, timeout)
    return tokens


def _scout(interface: str, timeout: float) -> tuple[bool, tuple[str, ...]]:
    """(whether our own hello came back, endpoints of everybody else's)."""
    config = zenoh.Config()
    for key, value in (
        ("listen/endpoints", []),
        ("scouting/multicast/interface", interface),
        ("scouting/multicast/autoconnect", {"peer": []}),
        ("scouting/gossip/enabled", False),
    ):
        config.insert_json5(key, json.dumps(value))
    heard: dict[str, list[str]] = {}
    own = ""

    def complete() -> bool:
        while (hello := scout.try_recv()) is not None:
            heard[str(hello.zid)] = list(map(str, hello.locators))
        return own in heard and len(heard) > 1

    try:
        with zenoh.open(config) as session, zenoh.scout(config=config) as scout:
            own = str(session.zid())
            _until(complete, timeout)
    except zenoh.ZError:  # no such interface
        return False, ()
    others = {place for zid, places in heard.items() if zid != own for place in places}
    return own in heard, tuple(sorted(others))


def _until(condition: Callable[[], bool], timeout: float) -> bool:
    """Whether the condition came true in time."""
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() >= end:
            return False
        time.sleep(PAUSE)
    return True
