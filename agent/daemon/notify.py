"""Tells systemd how this process is: ready, alive, stopping (sd_notify(3), its datagram protocol).

Interface: :class:`Systemd`.  Without systemd (no ``NOTIFY_SOCKET``) it says nothing to nobody.
"""

import os
import socket
from collections.abc import Mapping


class Systemd:
    """The service manager that started us, if one did."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        # A leading @ stands for the null byte of Linux's abstract socket names.
        self._address = "\0" + address[1:] if address.startswith("@") else address

    def ready(self) -> None:
        """The agent is a member of its swarm."""
        self._send("READY=1")

    def starting(self, status: str, more: float) -> None:
        """Not ready yet, and here is why; grant ``more`` [s] from now for the start."""
        self._send(f"EXTEND_TIMEOUT_USEC={int(more * 1e6)}\nSTATUS={status}")

    def alive(self, status: str) -> None:
        """A round has been played: feed the watchdog, and say in a line how it stands."""
        self._send(f"WATCHDOG=1\nSTATUS={status}")

    def stopping(self) -> None:
        """The agent is about to end, as it was told."""
        self._send("STOPPING=1")

    def _send(self, text: str) -> None:
        if not self._address:
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as out:
            out.setblocking(False)
            try:
                out.sendto(text.encode(), self._address)
            except OSError:
                return  # a service manager that does not listen is not worth an agent's life
