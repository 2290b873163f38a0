"""Health checks of containers: ``python -m deploy.health agent|vehicle|viewer`` exits with 0 or 1.

They run every few seconds beside the process they look at, so they import the standard library
only.  An agent and a viewer are asked over HTTP.  A vehicle is not spoken to, since a ground
station that comes and goes would be an event to it: its socket must be there and be read.
"""

import sys
from http.client import HTTPConnection, HTTPException
from pathlib import Path

LIMIT = 2.0  # [s] for an answer
METRICS, WEB, MAVLINK = 9464, 9090, 14580  # ports in the images
UNREAD = 100_000  # [bytes] more than this in a socket's queue: nobody reads it any more


def answers(port: int, path: str) -> bool:
    """Whether ``GET path`` on this machine gives 200."""
    connection = HTTPConnection("127.0.0.1", port, timeout=LIMIT)
    try:
        connection.request("GET", path)
        return connection.getresponse().status == 200
    except (OSError, HTTPException):
        return False
    finally:
        connection.close()


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
    return is_read(MAVLINK, Path("/proc/net/udp").read_text(encoding="ascii"))


if __name__ == "__main__":
    sys.exit(not check(sys.argv[1]))
