"""An agent's numbers over HTTP: for Prometheus, and a health check.

Interface: :func:`serve_metrics`.  ``GET /metrics`` gives the numbers, ``GET /healthz`` 200 while
the agent learns or has finished, 503 while it waits for its swarm or has stopped making progress.
"""

import socket
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from socketserver import ThreadingMixIn
from typing import Any
from wsgiref.simple_server import WSGIRequestHandler, WSGIServer
from wsgiref.types import StartResponse, WSGIEnvironment

from prometheus_client import CollectorRegistry, make_wsgi_app
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from swarm.errors import ConfigError, NetworkError
from swarm.reports.telemetry import AgentStatus, RoundReport

REQUEST_LIMIT = 5.0  # [s] for a client to say what it wants
OWN = ("swarm", "agent")  # labels of every number

Ask = Callable[[], tuple[AgentStatus, RoundReport | None, bool]]


def numbers(swarm: str, status: AgentStatus, report: RoundReport | None) -> list[Metric]:
    """What Prometheus is told of one agent."""
    own = (swarm, status.agent)

    def gauge(name: str, text: str, value: float) -> Metric:
        family = GaugeMetricFamily(f"dcpg_{name}", text, labels=OWN)
        family.add_metric(own, value)
        return family

    def counter(name: str, text: str, value: float) -> Metric:
        family = CounterMetricFamily(f"dcpg_{name}", text, labels=OWN)
        family.add_metric(own, value)
        return family

    ages = GaugeMetricFamily(
        "dcpg_neighbour_age_seconds",
        "Since a neighbour's last message.",
        labels=(*OWN, "neighbour"),
    )
    for name, neighbour in status.neighbours.items():
        if neighbour.age is not None:
            ages.add_metric((*own, name), neighbour.age)
    rejected = CounterMetricFamily(
        "dcpg_rejected_messages", "Messages refused, by cause.", labels=(*OWN, "cause")
    )
    for cause, count in sorted(status.rejected.items()):
        rejected.add_metric((*own, cause), count)
    families = [
        gauge("round", "Round that is being played.", status.round),
        gauge("rounds", "Round at which the run ends.", status.rounds),
        gauge("learning", "1 while learning.", status.state == "learning"),
        gauge("neighbours", "Neighbours present.", len(status.neighbours)),
        ages,
        rejected,
        counter("one_sided_edges", "Edges that one end alone used.", status.one_sided),
        gauge("resident_memory_bytes", "Resident memory.", status.memory_mb * 1e6),
    ]
    if report is not None:
        families += [
            gauge("return", "Mean discounted return of the newest round.", report.value),
            gauge(
                "disagreement", "Largest distance to a neighbour's parameters.", report.disagreement
            ),
            gauge("round_seconds", "Wall time of the newest round.", report.seconds),
            gauge("waited_seconds", "Of it, spent waiting for neighbours.", report.waited),
            counter("episodes", "Episodes flown.", report.episodes),
            counter("steps", "Environment steps.", report.steps),
        ]
        if report.distance is not None:
            text = "Mean length of the newest round's flights."
            families.append(gauge("flight_metres", text, report.distance))
    return [family for family in families if family.samples]


class _Agent(Collector):
    """Asks the agent anew whenever somebody scrapes."""

    def __init__(self, swarm: str, ask: Ask) -> None:
        self._swarm, self._ask = swarm, ask

    def collect(self) -> Iterable[Metric]:
        status, report, _ = self._ask()
        return numbers(self._swarm, status, report)


class _Handler(WSGIRequestHandler):
    timeout = REQUEST_LIMIT

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """A scrape is not worth a line."""


class _Server(ThreadingMixIn, WSGIServer):
    daemon_threads = True

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A scraper that hangs up is not worth a line."""
        if not isinstance(sys.exception(), ConnectionError | TimeoutError):
            super().handle_error(request, client_address)


class _Server6(_Server):
    address_family = socket.AF_INET6


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
    registry = CollectorRegistry()
    registry.register(_Agent(swarm, ask))
    scrape = make_wsgi_app(registry)

    def answer(environ: WSGIEnvironment, start: StartResponse) -> Iterable[bytes]:
        if environ["PATH_INFO"] == "/metrics":
            given: Iterable[bytes] = scrape(environ, start)
            return given
        code, text = "404 Not Found", "expected /metrics or /healthz\n"
        if environ["PATH_INFO"] == "/healthz":
            status, _, well = ask()
            code, text = "200 OK" if well else "503 Service Unavailable", f"{status.state}\n"
        start(code, [("Content-Type", "text/plain; charset=utf-8")])
        return [text.encode()]

    host, port = address_of(address)
    try:
        server = (_Server6 if ":" in host else _Server)((host, port), _Handler)
    except OSError as error:
        raise NetworkError(
            f"metrics cannot listen on {address}: {error.strerror or error}"
        ) from None
    server.set_app(answer)
    thread = threading.Thread(target=server.serve_forever, name="metrics", daemon=True)
    thread.start()
    try:
        yield server.server_port
    finally:
        server.shutdown()
        server.server_close()
