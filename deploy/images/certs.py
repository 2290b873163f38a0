"""Certificates for a swarm: ``swarm certs DIR --agents drone0,drone1`` or ``swarm certs DIR FILE``.

::

    DIR/ca.pem              the swarm's own authority: copy it to every machine
    DIR/ca.key              signs new certificates: stays here, offline at best
    DIR/drone0.pem, .key    drone0's name: only drone0's machine has them
    DIR/observer.pem, .key  for viewer, status and launcher: reads, publishes nothing

A certificate's common name is the agent's id, which is what access control goes by
(:mod:`swarm.wire.security`); its alternative names are the hosts at which others dial it.  Running
again adds what is missing; ``--force`` renews what is there, signed by the same authority.  One
authority is one fleet: whom it signs may take part under that name, and a new authority is a new
folder.

Keys are ECDSA on P-256, unencrypted PKCS #8, mode 0600.  RFC 5280 names the extensions.
"""

import ipaddress
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from agent.config.experiment import SwarmFile
from agent.storage.files import write_file
from swarm.errors import ConfigError
from swarm.wire.endpoints import host_and_port
from swarm.wire.keys import check_name
from swarm.wire.security import AGENT, OBSERVER

LOCAL = ("localhost", "127.0.0.1", "::1")  # names that every certificate bears
CA_DAYS = 3650  # [days]
BACKDATED = timedelta(days=1)  # a drone's clock may be slow before it has a fix; a guess
AUTHORITY = "swarm authority"
AUTHORITY_FILE = "ca"


@dataclass(frozen=True, slots=True)
class Authority:
    """Who signs."""

    certificate: x509.Certificate
    key: ec.EllipticCurvePrivateKey


def hosts_of(
    config: SwarmFile | None, agents: str = "", hosts: Iterable[str] = ()
) -> dict[str, set[str]]:
    """By agent, the hosts at which it is dialled.

    Args:
        config: a swarm file, if any: its agents and the hosts of their endpoints.
        agents: more ids, with commas.
        hosts: more hosts, ``agent=host`` for one agent's or ``host`` for all.

    Raises:
        ConfigError: no agents, or a host of an agent that is not among them.
    """
    of: dict[str, set[str]] = {}
    if config is not None:
        of = {m: {host_and_port(config.endpoint(m))[0]} for m in config.members}
    for name in filter(None, agents.split(",")):
        of.setdefault(name, set())
    if not of:
        raise ConfigError("certs: expected a swarm file or --agents drone0,drone1,...")
    for entry in hosts:
        agent, equals, host = entry.rpartition("=")
        if equals and agent not in of:
            raise ConfigError(f'--host "{entry}": expected one of {", ".join(of)} before the "="')
        for name in [agent] if equals else of:
            of[name].add(host)
    return of


def tell(folder: Path, made: Collection[str]) -> None:
    """Print what was made and what belongs where."""
    print(f"made in {folder}: {', '.join(made)}" if made else f"{folder}: nothing was missing")
    print(f"""
{folder}/ca.pem            to every machine
{folder}/ID.pem, ID.key    to the machine of agent ID, and nowhere else
{folder}/{OBSERVER}.*        to where up, status, view and doctor are run
{folder}/ca.key            stays here, safe: who has it makes members

in every swarm file (relative paths begin at its folder):

[network.security]
ca = "{folder.resolve()}/ca.pem"
certificate = "{folder.resolve()}/{AGENT}.pem"
key = "{folder.resolve()}/{AGENT}.key\"""")


def make_certificates(
    folder: Path,
    hosts: Mapping[str, Collection[str]],
    days: int = 365,
    force: bool = False,
) -> list[str]:
    """Make what is missing of an authority, a certificate for each agent, and the observer's.

    Args:
        folder: where they are kept.
        hosts: by agent, names and addresses beside :data:`LOCAL` under which it is dialled.
        days: how long they are valid.
        force: renew certificates that are there (never the authority).

    Returns:
        The names for which a certificate was made.

    Raises:
        ConfigError: a name or file will not do.
    """
    for agent in hosts:
        if check_name("agent", agent) in {OBSERVER, AUTHORITY_FILE}:
            raise ConfigError(f'agent "{agent}": expected another id, this one is taken')
    try:
        folder.mkdir(parents=True, exist_ok=True)
        authority = _authority(folder)
        made = []
        for name, names in {**hosts, OBSERVER: ()}.items():
            if not force and (folder / f"{name}.pem").exists():
                continue
            key = ec.generate_private_key(ec.SECP256R1())
            certificate = _sign(name, key, authority, days, (*LOCAL, *names))
            _write(folder, name, certificate, key)
            made.append(name)
    except OSError as error:
        raise ConfigError(f'certificates in "{folder}" cannot be written: {error}') from None
    return made


def _authority(folder: Path) -> Authority:
    """The folder's authority; a new one in an empty folder."""
    certificate_file, key_file = (folder / f"{AUTHORITY_FILE}.{end}" for end in ("pem", "key"))
    if not certificate_file.exists() and not key_file.exists():
        key = ec.generate_private_key(ec.SECP256R1())
        certificate = _sign(AUTHORITY, key, None, CA_DAYS, ())
        _write(folder, AUTHORITY_FILE, certificate, key)
        return Authority(certificate, key)
    try:
        certificate = x509.load_pem_x509_certificate(certificate_file.read_bytes())
        private = serialization.load_pem_private_key(key_file.read_bytes(), None)
    except (OSError, ValueError, TypeError) as error:
        raise ConfigError(
            f'authority "{certificate_file}" with "{key_file}" does not read ({error}): '
            "expected both as swarm certs wrote them, or an empty folder"
        ) from None
    if (
        not isinstance(private, ec.EllipticCurvePrivateKey)
        or private.public_key() != certificate.public_key()
    ):
        raise ConfigError(f'key "{key_file}" does not belong to "{certificate_file}"')
    return Authority(certificate, private)


def _sign(
    name: str,
    key: ec.EllipticCurvePrivateKey,
    authority: Authority | None,
    days: int,
    hosts: Collection[str],
) -> x509.Certificate:
    """A certificate for ``name``; without an authority, one that signs itself and others."""
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    now = datetime.now(UTC)
    signs = authority is None
    issuer, issuer_key = (
        (subject, key) if authority is None else (authority.certificate.subject, authority.key)
    )
    builder = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - BACKDATED)
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.BasicConstraints(signs, 0 if signs else None), critical=True)
        .add_extension(_usage(signs), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), False)
        .add_extension(
            x509.AuthorityKeyIdentifier.from_issuer_public_key(issuer_key.public_key()), False
        )
    )
    if not signs:
        both = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
        names = [_general_name(host) for host in dict.fromkeys(hosts)]
        builder = builder.add_extension(x509.ExtendedKeyUsage(both), False)
        builder = builder.add_extension(x509.SubjectAlternativeName(names), False)
    return builder.sign(issuer_key, hashes.SHA256())


def _usage(signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        key_cert_sign=signs,
        crl_sign=signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _general_name(host: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        pass
    try:
        return x509.DNSName(host)
    except ValueError:
        raise ConfigError(f'host "{host}": expected a host name or an address') from None


def _write(
    folder: Path, name: str, certificate: x509.Certificate, key: ec.EllipticCurvePrivateKey
) -> None:
    """Key first and readable by the owner alone; each file appears whole."""
    secret = key.private_bytes(
        serialization.Encoding.PEM,
        serialization.PrivateFormat.PKCS8,
        serialization.NoEncryption(),
    )
    public = certificate.public_bytes(serialization.Encoding.PEM)
    for file, content, mode in (
        (folder / f"{name}.key", secret, 0o600),
        (folder / f"{name}.pem", public, 0o644),
    ):
        write_file(file, content, mode=mode)
