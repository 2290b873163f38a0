"""Health checks of containers: ``python -S health.py agent|vehicle|viewer`` exits with 0 or 1.

They run every few seconds beside the process they look at, so this file stands alone and imports
next to nothing.  An agent and a viewer are asked over HTTP.  A vehicle is not spoken to, since a
ground station that comes and goes would be an event to it: its socket must be there and be read.
"""

import socket
import sys

LIMIT = 2.0  # [s] for an answer
METRICS, WEB, MAVLINK = 9464, 9090, 14580  # ports in the images
ENOUGH = 65_536  # [bytes] of an answer
UNREAD = 100_000  # [bytes] more than this in a socket's queue: nobody reads it any more


def answers(port: int, path: str) -> bool:
    """Whether ``GET path`` on this machine gives 200."""
    try:
        with socket.create_connection(("127.0.0.1", port), LIMIT) as connection:
            connection.sendall(f"GET {path} HTTP/1.0\r\nHost: localhost\r\n\r\n".encode())
            answer = connection.makefile("rb").read(ENOUGH)  # all of it, or the server complains
            return answer.split(b" ")[1:2] == [b"200"]
    except OSError:
        return False


def is_read(port: int, table: str) -> bool:
    """Whether ``table`` (``/proc/net/udp``) has a socket on ``port`` whose queue is short."""
    for line in table.splitlines()[1:]:
        local, queues = line.split()[1], line.split()[4]
        if int(local.rpartition(":")[2], 16) == port:
            return int(queues.rpartition(":")[2], 16) < UNREAD
    return False


def check(role: str) -> bool:
    """Whether the process of this role, in this container, is well."""
    if role == "agent":
        return answers(METRICS, "/healthz")
    if role == "viewer":
        return answers(WEB, "/")
    with open("/proc/net/udp", encoding="ascii") as table:  # noqa: PTH123  (pathlib takes longer)
        return is_read(MAVLINK, table.read())


if __name__ == "__main__":
    sys.exit(not check(sys.argv[1]))
