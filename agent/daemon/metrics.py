"""An agent's numbers over HTTP: for Prometheus (text format 0.0.4), and a health check.

Interface: :func:`serve_metrics`.  ``GET /metrics`` gives the numbers, ``GET /healthz`` 200 while
the agent learns or has finished, 503 while it waits for its swarm or has stopped making progress.
"""

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from swarm.errors import ConfigError, NetworkError
from swarm.reports.telemetry import AgentStatus, RoundReport

REQUEST_LIMIT = 5.0  # [s] for a client to say what it wants
TEXT = "text/plain; version=0.0.4; charset=utf-8"
GAUGE, COUNTER = "gauge", "counter"

Sample = tuple[dict[str, str], float]
Ask = Callable[[], tuple[AgentStatus, RoundReport | None, bool]]


def exposition(swarm: str, status: AgentStatus, report: RoundReport | None) -> str:
    """The numbers of one agent in Prometheus's text format."""
    ages = [({"neighbour": n}, s.age) for n, s in status.neighbours.items()]
    families: list[tuple[str, str, str, list[Sample]]] = [
        ("round", GAUGE, "Round that is being played.", [({}, status.round)]),
        ("rounds", GAUGE, "Round at which the run ends.", [({}, status.rounds)]),
        ("learning", GAUGE, "1 while learning.", [({}, float(status.state == "learning"))]),
        ("neighbours", GAUGE, "Neighbours present.", [({}, len(status.neighbours))]),
        ("neighbour_age_seconds", GAUGE, "Since a neighbour's last message.",
         [(labels, age) for labels, age in ages if age is not None]),
        ("rejected_messages_total", COUNTER, "Messages refused, by cause.",
         [({"cause": cause}, n) for cause, n in sorted(status.rejected.items())]),
        ("one_sided_edges_total", COUNTER, "Edges that one end alone used.",
         [({}, status.one_sided)]),
        ("resident_memory_bytes", GAUGE, "Resident memory.", [({}, status.memory_mb * 1e6)]),
    ]  # fmt: skip
    if report is not None:
        families += [
            ("return", GAUGE, "Mean discounted return of the newest round.", [({}, report.value)]),
            ("disagreement", GAUGE, "Largest distance to a neighbour's parameters.",
             [({}, report.disagreement)]),
            ("round_seconds", GAUGE, "Wall time of the newest round.", [({}, report.seconds)]),
            ("waited_seconds", GAUGE, "Of it, spent waiting for neighbours.",
             [({}, report.waited)]),
            ("episodes_total", COUNTER, "Episodes flown.", [({}, report.episodes)]),
            ("steps_total", COUNTER, "Environment steps.", [({}, report.steps)]),
        ]  # fmt: skip
        if report.distance is not None:
            text = "Mean length of the newest round's flights."
            families.append(("flight_metres", GAUGE, text, [({}, report.distance)]))
    own = {"swarm": swarm, "agent": status.agent}
    lines = []
    for name, kind, text, samples in families:
        lines += [f"# HELP dcpg_{name} {text}", f"# TYPE dcpg_{name} {kind}"] if samples else []
        for more, value in samples:
            labels = ",".join(f'{key}="{label}"' for key, label in (own | more).items())
            lines.append(f"dcpg_{name}{{{labels}}} {float(value)!r}")
    return "\n".join(lines) + "\n"


def address_of(text: str) -> tuple[str, int]:
    """``HOST:PORT``.

    Raises:
        ConfigError: it is something else.
    """
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or int(port) > 65_535:
        raise ConfigError(f'metrics "{text}": expected HOST:PORT, e.g. 127.0.0.1:9464')
    return host.strip("[]"), int(port)


@contextmanager
def serve_metrics(address: str, swarm: str, ask: Ask) -> Iterator[int]:
    """Serve at ``HOST:PORT`` meanwhile; gives the port.

    Args:
        address: where to listen; port 0 takes a free one.
        swarm: its name, a label of every number.
        ask: (status, newest report, whether all is well); called on the server's threads.

    Raises:
        ConfigError: the address is none.
        NetworkError: it cannot be listened on.
    """

    class Handler(BaseHTTPRequestHandler):
        timeout = REQUEST_LIMIT

        def do_GET(self) -> None:
            status, report, well = ask()
            if self.path == "/metrics":
                self._reply(200, exposition(swarm, status, report))
            elif self.path == "/healthz":
                self._reply(200 if well else 503, f"{status.state}\n")
            else:
                self._reply(404, "expected /metrics or /healthz\n")

        def _reply(self, code: int, text: str) -> None:
            body = text.encode()
            self.send_response(code)
            self.send_header("Content-Type", TEXT)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002
            """A scrape is not worth a line."""

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, request: Any, client_address: Any) -> None:
            """A scraper that hangs up is not worth a line."""
            if not isinstance(sys.exception(), ConnectionError | TimeoutError):
                super().handle_error(request, client_address)

    try:
        server = Server(address_of(address), Handler)
    except OSError as error:
        raise NetworkError(
            f"metrics cannot listen on {address}: {error.strerror or error}"
        ) from None
    thread = threading.Thread(target=server.serve_forever, name="metrics", daemon=True)
    thread.start()
    try:
        yield server.server_port
    finally:
        server.shutdown()
        server.server_close()
