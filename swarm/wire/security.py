"""Who may join a swarm and what each may say: mutual TLS, access control, or passwords.

::

    [network.security]                      # made by: swarm certs certs
    deploy/library/swarms/mine.toml ca = "certs/ca.pem"                     # the swarm's own
    authority, the same everywhere certificate = "certs/{agent}.pem"       # {agent}: own id, or
    "observer" for viewer and status key = "certs/{agent}.key"

Every link is then TLS in both directions: who has no certificate of this authority gets no link.
A certificate's common name is an agent's id, and by it each agent refuses what others may not say
(:func:`access_control`): drone1 publishes, announces itself and answers under drone1's keys alone;
observers read everything and say nothing.  One authority is one fleet.

``users = "users.txt"``, lines of ``name:password``, is the simple option: whoever dials must know a
password of the list.  It keeps strangers out of a network that is trusted otherwise; nothing is
encrypted, who listens proves nothing, and members are not told apart.

Shared memory stays on with TLS: between processes of one machine large payloads then go through
/dev/shm (files of mode 0600) and not through the encrypted link.  Other users of the machine cannot
read them; ``network.shared_memory = false`` sends everything through TLS.
"""

import ssl
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from swarm.errors import ConfigError, TooEarlyError
from swarm.wire.endpoints import plain_host
from swarm.wire.keys import Keys

OBSERVER = "observer"  # common name of viewers, launchers and status: reads, says nothing
NOT_YET_VALID = 9  # X509_V_ERR_CERT_NOT_YET_VALID
AGENT = "{agent}"  # placeholder in paths


@dataclass(frozen=True, slots=True)
class Party:
    """On whose behalf a session is opened, and in which company.

    Attributes:
        name: an agent's id, or :data:`OBSERVER`.
        keys: of the swarm.
        members: every id of the swarm file.
    """

    name: str
    keys: Keys
    members: tuple[str, ...]


class Security(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Off by default; else three files for TLS, or one for passwords.

    Relative paths begin at the swarm file's folder; ``{agent}`` stands for the own id.

    Attributes:
        ca: certificate of the swarm's authority (PEM).
        certificate: own certificate (PEM).
        key: its private key (PEM).
        users: passwords, one ``name:password`` a line, a line for every agent and the observer.
    """

    ca: str = ""
    certificate: str = ""
    key: str = ""
    users: str = ""

    def __post_init__(self) -> None:
        given = [bool(path) for path in (self.ca, self.certificate, self.key)]
        if any(given) and not all(given):
            raise ValueError("ca, certificate and key together")
        if any(given) and self.users:
            raise ValueError("either ca, certificate and key, or users")

    @property
    def tls(self) -> bool:
        """Whether links are encrypted and both ends prove who they are."""
        return bool(self.ca)

    def beside(self, folder: Path) -> "Security":
        """With relative paths taken from ``folder``."""
        paths = {name: getattr(self, name) for name in self.__struct_fields__}
        return Security(**{n: str((folder / p).resolve()) for n, p in paths.items() if p})

    def files_of(self, name: str) -> "Security":
        """With the paths of one agent or observer."""
        paths = {field: getattr(self, field) for field in self.__struct_fields__}
        return Security(**{field: path.replace(AGENT, name) for field, path in paths.items()})

    def check(self, name: str) -> None:
        """See that the files are there, belong together and to ``name``.

        Raises:
            ConfigError: one line that names the file.
        """
        own = self.files_of(name)
        if own.tls:
            certificate = read_certificate(own)
            if certificate.name != name:
                raise ConfigError(
                    f'certificate "{own.certificate}" is of "{certificate.name}": '
                    f'expected one of "{name}"'
                )
        elif own.users:
            _password(own.users, name)

    def settings(self, party: Party) -> dict[str, Any]:
        """Zenoh's configuration for ``party``; the files must have passed :meth:`check`."""
        own = self.files_of(party.name)
        if own.tls:
            return {
                "transport/link/protocols": ["tls"],
                "transport/link/tls/root_ca_certificate": own.ca,
                "transport/link/tls/listen_certificate": own.certificate,
                "transport/link/tls/listen_private_key": own.key,
                "transport/link/tls/connect_certificate": own.certificate,
                "transport/link/tls/connect_private_key": own.key,
                "transport/link/tls/enable_mtls": True,
                "transport/link/tls/verify_name_on_connect": True,
                "access_control": access_control(party),
            }
        if own.users:
            return {
                "transport/auth/usrpwd/user": party.name,
                "transport/auth/usrpwd/password": _password(own.users, party.name),
                "transport/auth/usrpwd/dictionary_file": own.users,
            }
        return {}


def access_control(party: Party) -> dict[str, Any]:
    """What may pass between ``party`` and each peer, by the common name of the peer's certificate.

    Everything is denied but: all may ask and listen; into this process comes what a peer says
    under its own id; out of it goes what this agent says under its own.  A key that holds more than
    the own id (``params/*``) is not under it.
    """
    asks = ["declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber"]
    says = ["put", "liveliness_token", "declare_queryable", "reply"]
    both = ["ingress", "egress"]

    def rule(name: str, messages: list[str], flows: list[str], *keys: str) -> dict[str, Any]:
        return {
            "id": name,
            "permission": "allow",
            "messages": messages,
            "flows": flows,
            "key_exprs": list(keys),
        }

    rules = [rule("ask", asks, both, Keys("*").everything())]
    policies = [{"rules": ["ask"], "subjects": [*party.members, OBSERVER]}]
    for member in party.members:
        # A token may name any swarm: so a doctor sees agents that took another swarm's file.
        own = (party.keys.own(member), Keys("*").alive(member), Keys("*").speaks(member))
        rules.append(rule(f"from {member}", says, ["ingress"], *own))
        policies.append({"rules": [f"from {member}"], "subjects": [member]})
        if member == party.name:
            rules.append(rule("say", says, ["egress"], *own))
            policies.append({"rules": ["say"], "subjects": [*party.members, OBSERVER]})
    subjects = [{"id": name, "cert_common_names": [name]} for name in (*party.members, OBSERVER)]
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


@dataclass(frozen=True, slots=True)
class Certificate:
    """What a certificate says.

    Attributes:
        name: common name of its owner.
        hosts: names and addresses at which the owner may be dialled.
        until: end of its validity, Unix time [s].
    """

    name: str
    hosts: tuple[str, ...]
    until: float


def read_certificate(files: Security) -> Certificate:
    """Read a certificate whose key fits and which the authority has signed.

    OpenSSL is the judge: the certificate is shown to one who trusts the authority, in memory.

    Raises:
        TooEarlyError: it begins later than now.
        ConfigError: one line that names the file.
    """
    for what in ("ca", "certificate", "key"):
        _read(what, getattr(files, what))
    trusting, showing = contexts(files)
    for authority in trusting.get_ca_certs():
        if ssl.cert_time_to_seconds(str(authority["notAfter"])) < time.time():
            raise ConfigError(f'ca "{files.ca}" has expired on {authority["notAfter"]}')
    try:
        shown = _handshake(trusting, showing)
    except ssl.SSLCertVerificationError as error:
        if error.verify_code == NOT_YET_VALID:
            raise TooEarlyError(
                f'certificate "{files.certificate}" is not valid yet by this machine\'s clock, '
                f"which says {time.strftime('%Y-%m-%d %H:%M', time.gmtime())} UTC"
            ) from None
        why = {
            10: "has expired",
            19: f'is not signed by ca "{files.ca}"',
            20: f'is not signed by ca "{files.ca}"',
        }.get(error.verify_code, error.verify_message)
        raise ConfigError(f'certificate "{files.certificate}" {why}') from None
    except ssl.SSLError as error:
        raise ConfigError(f'certificate "{files.certificate}" will not do: {error}') from None
    subject = {key: value for entry in shown["subject"] for key, value in entry}
    return Certificate(
        name=subject.get("commonName", ""),
        hosts=hosts_in(shown),
        until=ssl.cert_time_to_seconds(shown["notAfter"]),
    )


def hosts_in(shown: Any) -> tuple[str, ...]:
    """Names and addresses in what :meth:`ssl.SSLSocket.getpeercert` returned."""
    return tuple(plain_host(host) for _, host in (shown or {}).get("subjectAltName", ()))


def contexts(files: Security) -> tuple[ssl.SSLContext, ssl.SSLContext]:
    """For TLS with these files: (one that dials and checks but names no host, one that listens).

    Raises:
        ConfigError: a file holds something else, or key and certificate do not belong together.
    """
    dials, listens = (
        ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT),
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER),
    )
    dials.check_hostname = False
    try:
        dials.load_verify_locations(files.ca)
    except ssl.SSLError:
        raise ConfigError(f'ca "{files.ca}" holds no certificate: expected PEM') from None
    try:
        ssl.PEM_cert_to_DER_cert(_read("certificate", files.certificate).strip())
    except ValueError:
        raise ConfigError(
            f'certificate "{files.certificate}" holds no certificate: expected PEM'
        ) from None
    for context in (dials, listens):
        try:
            context.load_cert_chain(files.certificate, files.key, password="")
        except ssl.SSLError as error:
            why = (
                f'does not belong to certificate "{files.certificate}"'
                if error.reason == "KEY_VALUES_MISMATCH"
                else "holds no private key: expected PEM without a password"
            )
            raise ConfigError(f'key "{files.key}" {why}') from None
    return dials, listens


def _handshake(dials: ssl.SSLContext, listens: ssl.SSLContext) -> Any:
    """What ``dials`` learns of the certificate of ``listens``, without a network."""
    forth, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    client, server = dials.wrap_bio(back, forth), listens.wrap_bio(forth, back, server_side=True)
    for _ in range(4):  # flights of TLS 1.3, with some to spare
        for end in (client, server):
            try:
                end.do_handshake()
            except ssl.SSLWantReadError:
                continue
    return client.getpeercert()


def _read(what: str, path: str) -> str:
    try:
        return Path(path).read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ConfigError(
            f'{what} "{path}" does not exist: expected a file as swarm certs makes them'
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f'{what} "{path}" cannot be read: {error}') from None


def _password(path: str, name: str) -> str:
    """The password of ``name`` in a dictionary file."""
    passwords: dict[str, str] = {}
    if _read("users", path).startswith("\ufeff"):  # Zenoh reads the file itself, and takes it so
        raise ConfigError(f'users "{path}" begins with a byte-order mark: expected UTF-8 without')
    for number, line in enumerate(_read("users", path).splitlines(), 1):
        user, _, password = line.partition(":")
        if not (user and password):
            raise ConfigError(f'users "{path}", line {number}: expected name:password')
        passwords[user] = password
    if name not in passwords:
        raise ConfigError(f'users "{path}" has no line of "{name}": expected {name}:password')
    return passwords[name]
