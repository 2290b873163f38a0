"""Prometheus reads the numbers, a health check the state; mistakes are one line."""

from http.client import HTTPConnection

import pytest

from agent.daemon.metrics import address_of, serve_metrics
from swarm.errors import ConfigError, NetworkError
from swarm.reports.telemetry import AgentStatus, NeighbourStatus, RoundReport

STATUS = AgentStatus(
    agent="drone0", incarnation="1f", pid=7, state="learning", round=3, rounds=9,
    neighbours={"drone1": NeighbourStatus(round=3, age=0.25), "drone3": NeighbourStatus()},
    rejected={"round": 2}, memory_mb=50.0,
)  # fmt: skip
REPORT = RoundReport(
    agent="drone0", round=2, time=0.0, seconds=0.5, waited=0.1, value=-1.5, episodes=30, steps=900,
    gradient_norm=1.0, disagreement=0.2, weights={"drone1": 0.5}, distance=12.5,
)  # fmt: skip


def get(port: int, path: str) -> tuple[int, str, str]:
    """(code, content type, text)."""
    connection = HTTPConnection("127.0.0.1", port, timeout=5)
    try:
        connection.request("GET", path)
        reply = connection.getresponse()
        return reply.status, reply.headers["Content-Type"], reply.read().decode()
    finally:
        connection.close()


def scrape(report: RoundReport | None) -> list[str]:
    """The lines that Prometheus gets."""
    with serve_metrics("127.0.0.1:0", "test", lambda: (STATUS, report, True)) as port:
        code, kind, text = get(port, "/metrics")
    assert code == 200
    assert kind.startswith("text/plain; version=0.0.4")
    return text.splitlines()


def test_every_number_has_its_help_its_type_and_its_labels() -> None:
    lines = scrape(REPORT)
    own = 'agent="drone0",swarm="test"'
    assert f"dcpg_round{{{own}}} 3.0" in lines
    assert f"dcpg_return{{{own}}} -1.5" in lines
    assert f"dcpg_flight_metres{{{own}}} 12.5" in lines
    assert f"dcpg_steps_total{{{own}}} 900.0" in lines
    assert f"dcpg_resident_memory_bytes{{{own}}} 5e+07" in lines
    age = 'dcpg_neighbour_age_seconds{agent="drone0",neighbour="drone1",swarm="test"} 0.25'
    assert [line for line in lines if line.startswith("dcpg_neighbour_age")] == [age]
    rejected = 'dcpg_rejected_messages_total{agent="drone0",cause="round",swarm="test"} 2.0'
    assert rejected in lines
    names = {line.split("{")[0] for line in lines if not line.startswith("#")}
    assert names == {line.split()[2] for line in lines if line.startswith("# TYPE")}
    assert all(line.endswith(("gauge", "counter")) for line in lines if line.startswith("# TYPE"))


def test_before_the_first_round_there_is_less_to_say() -> None:
    assert not any("dcpg_return" in line for line in scrape(None))


@pytest.mark.parametrize(("well", "code"), [(True, 200), (False, 503)])
def test_a_health_check_sees_whether_all_is_well(well: bool, code: int) -> None:
    with serve_metrics("127.0.0.1:0", "test", lambda: (STATUS, REPORT, well)) as port:
        assert get(port, "/healthz")[0] == code
        assert get(port, "/else")[0] == 404


def test_a_users_mistakes_are_named() -> None:
    assert address_of("[::1]:9464") == ("::1", 9464)
    for wrong in ("9464", ":9464", "host", "host:port", "host:70000"):
        with pytest.raises(ConfigError, match="expected HOST:PORT"):
            address_of(wrong)
    ask = lambda: (STATUS, None, True)  # noqa: E731
    with (
        serve_metrics("127.0.0.1:0", "test", ask) as port,
        pytest.raises(NetworkError, match=f"metrics cannot listen on 127.0.0.1:{port}"),
        serve_metrics(f"127.0.0.1:{port}", "test", ask),
    ):
        pass
