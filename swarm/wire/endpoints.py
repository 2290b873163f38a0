"""Endpoints: where an agent listens and is dialled, ``tcp/10.0.0.7:7450`` or ``tls/[::1]:7450``.

Interface: :func:`endpoint` writes one, :func:`host_and_port` reads one and :func:`check_host`
judges an address alone; whatever is not so is told with the form that is right.
"""

import ipaddress
import re

from swarm.errors import ConfigError

PROTOCOLS = ("tcp", "tls")
PORTS = 65_535  # the highest
_FORM = re.compile(
    r"(?P<protocol>\w+)/(?:\[(?P<six>[^\[\]]+)\]|(?P<host>[^\[\]:/]+)):(?P<port>\d+)"
)


def endpoint(protocol: str, host: str, port: int) -> str:
    """An endpoint; an IPv6 address gets its brackets."""
    bare = host.strip("[]")
    return f"{protocol}/[{bare}]:{port}" if ":" in bare else f"{protocol}/{bare}:{port}"


def host_and_port(text: str) -> tuple[str, int]:
    """Of an endpoint; the host without brackets.

    Raises:
        ConfigError: it is none; names the right form.
    """
    address = text.partition("?")[0].partition("#")[0]  # Zenoh's own settings follow
    match = _FORM.fullmatch(address)
    if match and match["protocol"] in PROTOCOLS and 0 < int(match["port"]) <= PORTS:
        return match["six"] or match["host"], int(match["port"])
    raise ConfigError(f'endpoint "{text}": expected {_right_form(address)}')


def check_host(key: str, host: str) -> None:
    """See that it is a name or an address, and no endpoint.

    Raises:
        ConfigError: it is something else.
    """
    bare = host[1:-1] if host.startswith("[") and host.endswith("]") else host
    if not re.fullmatch(r"[\w.-]+", bare) and not _is_ipv6(bare):
        near = re.fullmatch(r"(?:\w+:?//?)?(\[.+\]|[\w.-]+)(?::\d+)?/?", host)
        like = near[1] if near else "127.0.0.1"
        raise ConfigError(f'{key} = "{host}": expected an address or a host name, e.g. "{like}"')


def plain_host(host: str) -> str:
    """A name or an address in the one way of writing it that can be compared."""
    try:
        return str(ipaddress.ip_address(host))
    except ValueError:
        return host.lower()


def _right_form(address: str) -> str:
    """What was probably meant."""
    if _is_ipv6(address.strip("[]")):
        return endpoint(PROTOCOLS[0], address, 7450)
    match = re.fullmatch(r"(?:(\w+)(?::/?/?|/))?/?(.*?)(?::(\d+))?/?", address)
    protocol, host, port = match.groups() if match else (None, "", None)
    if port is None and _is_ipv6(host.strip("[]")):
        host, _, port = host.rpartition(":")
    host = host.strip("[]/ ")
    known = protocol if protocol in PROTOCOLS else PROTOCOLS[0]
    if not re.fullmatch(r"[\w.-]+", host) and not _is_ipv6(host):
        return "one like tcp/10.0.0.7:7450"
    good, why = port or "7450", ""
    if not 0 < int(good) <= PORTS:
        good, why = "7450", f" (ports are 1 to {PORTS})"
    if protocol is not None and protocol not in PROTOCOLS:
        why = f" (agents speak {' or '.join(PROTOCOLS)})"
    return endpoint(known, host, int(good)) + why


def _is_ipv6(host: str) -> bool:
    try:
        ipaddress.IPv6Address(host)
    except ValueError:
        return False
    return True
