"""Ports that are ours from the moment they are chosen until we let go of them.

Looking whether a port is free and letting go of it again leaves time for somebody else to take it.
So whoever chooses ports for others holds them, in a way that keeps out every other chooser and lets
the one in for whom they are meant:

- the port's number is locked by its *other* transport: who chooses TCP ports binds the UDP port of
  the same number, exclusively, and the other way round.  The kernel keeps that lock, for all users
  of a network namespace, and drops it when its process ends, however it ends;
- a TCP port is also bound, though nobody listens on it.  Linux lets a listener in beside that which
  sets ``SO_REUSEADDR``, as Zenoh does, and refuses every program that does not.

Ports are chosen from below those that the kernel hands out by itself, so that no outgoing
connection has them.
"""

import errno
import random
import socket
import sys
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

from swarm.errors import ConfigError

LOWEST = 10_000  # well-known services are below
EPHEMERAL = Path("/proc/sys/net/ipv4/ip_local_port_range")
USUAL_EPHEMERAL = 32_768  # where Linux begins to hand out ports, unless told otherwise
TRIES = 200

Kind = socket.SocketKind


@dataclass(slots=True)
class Ports:
    """Ports that are held; a context manager that lets go of them.

    Attributes:
        numbers: which.
    """

    numbers: tuple[int, ...]
    _sockets: ExitStack = field(default_factory=ExitStack)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._sockets.close()


def hold(host: str, numbers: Iterable[int], kind: Kind = socket.SOCK_STREAM) -> Ports | None:
    """Hold these ports for somebody who will listen there; None where one of them is taken.

    Args:
        host: the address that will be listened on.
        numbers: the ports.
        kind: how it will be listened: ``SOCK_STREAM`` for TCP, ``SOCK_DGRAM`` for UDP.

    Raises:
        ConfigError: the host is no address of this machine.
    """
    ports = Ports(tuple(numbers))
    with ExitStack() as undo:
        undo.enter_context(ports)
        try:
            for number in ports.numbers:
                for held in _lock(host, number, kind):
                    ports._sockets.enter_context(held)
        except socket.gaierror as error:
            raise ConfigError(f'host "{host}": {error.strerror}; expected an address') from None
        except OSError as error:
            if error.errno == errno.EADDRNOTAVAIL:
                raise ConfigError(f'host "{host}" is no address of this machine') from None
            return None
        undo.pop_all()
    return ports


def hold_free(host: str, count: int, kind: Kind = socket.SOCK_STREAM) -> Ports:
    """Hold ``count`` ports in a row that nobody uses; arguments and errors as of :func:`hold`.

    Raises:
        ConfigError: there are none.
    """
    top = _first_ephemeral() - count
    for _ in range(TRIES):
        first = random.randrange(LOWEST, top)
        if held := hold(host, range(first, first + count), kind):
            return held
    raise ConfigError(f"no {count} free ports in a row on {host} between {LOWEST} and {top}")


def is_free(host: str, port: int) -> bool:
    """Whether one could listen on this TCP port now."""
    try:
        _bound(host, port, socket.SOCK_STREAM, shared=True).close()
    except OSError:
        return False
    return True


def _lock(host: str, port: int, kind: Kind) -> list[socket.socket]:
    """Sockets that hold one port."""
    with ExitStack() as undo:
        if kind is socket.SOCK_DGRAM:
            held = [_bound(host, port, socket.SOCK_STREAM)]
            undo.enter_context(held[0])
            _bound(host, port, kind).close()
        else:
            held = [_bound(host, port, socket.SOCK_DGRAM)]
            undo.enter_context(held[0])
            listener = undo.enter_context(_bound(host, port, kind, shared=True))
            if sys.platform == "linux":
                held.append(listener)
            else:
                listener.close()
        undo.pop_all()
    return held


def _bound(host: str, port: int, kind: Kind, *, shared: bool = False) -> socket.socket:
    """A socket bound to an address; with ``shared`` a listener may bind there, too."""
    family, _, _, _, address = socket.getaddrinfo(host, port, type=kind)[0]
    bound = socket.socket(family, kind)
    try:
        if shared:
            bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(address)
    except OSError:
        bound.close()
        raise
    return bound


def _first_ephemeral() -> int:
    """The lowest port that the kernel hands out by itself."""
    try:
        first = int(EPHEMERAL.read_text(encoding="ascii").split()[0])
    except (OSError, ValueError, IndexError):
        return USUAL_EPHEMERAL
    return first if first > 2 * LOWEST else USUAL_EPHEMERAL
