"""Connection strings as the ecosystem writes them, and the sockets behind them.

``udpin:HOST:PORT`` listens and answers the vehicle, wherever it last spoke from;
``udpout:HOST:PORT`` speaks first; ``tcp:HOST:PORT`` connects; ``serial:DEVICE:BAUD`` opens a serial
port (needs ``pyserial``).  ``udp:`` is ``udpin:``, as in pymavlink.
"""

import contextlib
import select
import socket
from importlib import import_module
from typing import Any, Protocol

from agent.errors import VehicleError

RECEIVE = 65_536  # bytes
EXPECTED = "expected udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD"


class Connection(Protocol):
    """Bytes in, bytes out.

    Attributes:
        datagrams: whether what ``receive`` returns begins and ends with a frame.
    """

    datagrams: bool

    def receive(self, timeout: float) -> bytes:
        """What has come; empty if nothing did within `timeout` seconds."""
        ...

    def believe(self) -> None:
        """What was received last came from our vehicle: answer there from now on."""
        ...

    def send(self, data: bytes) -> None:
        """Send, if there is anybody to send to; loss is possible, waiting is not."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


def parse(text: str) -> tuple[str, str, int]:
    """Kind, host or device, and port or baud rate that a connection string names.

    Raises:
        VehicleError: it is none.
    """
    kind, _, rest = text.partition(":")
    host, _, number = rest.rpartition(":")
    kind = "udpin" if kind == "udp" else kind
    if kind not in {"udpin", "udpout", "tcp", "serial"} or not host or not number.isdecimal():
        raise VehicleError(f'vehicle connection "{text}": {EXPECTED}')
    if kind != "serial" and not 0 < int(number) < 65_536:
        raise VehicleError(f'vehicle connection "{text}": port {number}, expected 1 to 65535')
    return kind, host, int(number)


def open_connection(text: str, timeout: float) -> Connection:
    """The connection that a string names.

    Raises:
        VehicleError: the string is none, or what it names cannot be opened.
    """
    kind, host, number = parse(text)
    try:
        if kind == "serial":
            return _Serial(host, number)
        if kind == "tcp":
            return _Tcp((host, number), timeout)
        return _Udp((host, number), listens=kind == "udpin")
    except OSError as error:  # pyserial's errors are among these
        raise VehicleError(
            f'vehicle connection "{text}" cannot be opened: {error.strerror or error}'
        ) from error


class _Udp:
    datagrams = True

    def __init__(self, address: tuple[str, int], *, listens: bool) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._listens = listens
        self._peer: tuple[str, int] | None = None
        self._last: tuple[str, int] | None = None  # who sent the last datagram
        try:
            if listens:
                self._socket.bind(address)  # no SO_REUSEADDR: a port is never stolen
            else:
                self._peer = (socket.gethostbyname(address[0]), address[1])
        except OSError:
            self._socket.close()
            raise

    def receive(self, timeout: float) -> bytes:
        self._socket.settimeout(max(timeout, 0.0))
        try:
            data, peer = self._socket.recvfrom(RECEIVE)
        except OSError:  # nothing yet, or the peer's port is closed
            return b""
        self._last = peer
        return data if self._listens or peer == self._peer else b""

    def believe(self) -> None:
        if self._listens:
            self._peer = self._last

    def send(self, data: bytes) -> None:
        if self._peer is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, self._peer)

    def close(self) -> None:
        self._socket.close()


class _Tcp:
    datagrams = False

    def __init__(self, address: tuple[str, int], timeout: float) -> None:
        self._socket = socket.create_connection(address, timeout)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(1.0)
        self._open = True

    def receive(self, timeout: float) -> bytes:
        if not self._open:
            select.select([], [], [], max(timeout, 0.0))
            return b""
        ready, _, _ = select.select([self._socket], [], [], max(timeout, 0.0))
        if not ready:
            return b""
        try:
            data = self._socket.recv(RECEIVE)
        except OSError:
            data = b""
        self._open = bool(data)
        return data

    def believe(self) -> None:
        """There is only one other end."""

    def send(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            self._socket.sendall(data)

    def close(self) -> None:
        self._socket.close()


class _Serial:
    datagrams = False

    def __init__(self, device: str, baud: int) -> None:
        try:
            serial = import_module("serial")
        except ModuleNotFoundError:
            raise VehicleError("a serial connection needs pyserial: pip install pyserial") from None
        self._port: Any = serial.Serial(device, baud, timeout=0.0, write_timeout=0.5)

    def receive(self, timeout: float) -> bytes:
        select.select([self._port.fileno()], [], [], max(timeout, 0.0))
        with contextlib.suppress(OSError):
            return bytes(self._port.read(RECEIVE))
        return b""

    def believe(self) -> None:
        """There is only one other end."""

    def send(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            self._port.write(data)

    def close(self) -> None:
        self._port.close()
