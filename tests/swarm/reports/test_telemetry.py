"""What watchers receive is of its type, in bounds and under its sender's own key, or dropped."""

import math
import time

import msgspec
import pytest
import zenoh

from swarm.reports import telemetry
from swarm.reports.telemetry import (
    FlightSample,
    RoundReport,
    TelemetryPublisher,
    decode,
    watch_flights,
)
from swarm.wire.keys import Keys

KEYS = Keys("test")
SAMPLE = FlightSample(
    agent="drone0", round=3, time=1e9, flight=2, step=5, position=(1.0, 2.0, -1.5), yaw=0.5,
    action=12, reward=0.25, distance=2.4, track=((0.0, 2.0, -1.5),), camera=b"png", depth=b"png",
)  # fmt: skip


def flight(**changes: object) -> bytes:
    """A flight sample as it travels, with other values."""
    return msgspec.msgpack.encode(msgspec.structs.asdict(SAMPLE) | changes)


def test_a_sample_reads_back() -> None:
    assert decode(flight(), FlightSample) == SAMPLE


@pytest.mark.parametrize(
    "changes",
    [
        {"position": (math.nan, 0.0, 0.0)},
        {"position": (0.0, 0.0)},
        {"position": (0.0, 0.0, math.inf)},
        {"yaw": math.nan},
        {"step": -1},
        {"distance": -1.0},
        {"reward": math.nan},
        {"track": ((0.0, 0.0, 0.0),) * (telemetry.TRACK + 1)},
        {"camera": bytes(telemetry.PICTURE + 1)},
        {"camera": "text"},
        {"stranger": 1},
    ],
)
def test_bad_samples_are_nothing(changes: dict[str, object]) -> None:
    assert decode(flight(**changes), FlightSample) is None


def test_what_is_too_long_or_torn_is_nothing() -> None:
    assert decode(bytes(telemetry.MESSAGE + 1), FlightSample) is None
    assert decode(flight()[:-1], FlightSample) is None
    assert decode(flight(), RoundReport) is None


def test_flights_are_sent_when_somebody_watches_and_at_a_bounded_rate(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(time, "time", lambda: 1e9)
    config = zenoh.Config()
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("listen/endpoints", "[]")
    with zenoh.open(config) as session, TelemetryPublisher(session, KEYS, "drone0") as publisher:
        assert not publisher.flight_due()
        heard: list[FlightSample] = []
        watch_flights(session, KEYS, heard.append)
        assert publisher.flight_due()
        publisher.flight(SAMPLE)
        publisher.flight(SAMPLE)  # in the same slot: not sent
        session.put(KEYS.telemetry("drone1", telemetry.FLIGHT), flight())  # another's name: dropped
        monkeypatch.setattr(time, "time", lambda: 1e9 + 1 / telemetry.FLIGHT_RATE)
        publisher.flight(SAMPLE)
        end = time.monotonic() + 10.0
        while len(heard) < 2 and time.monotonic() < end:
            time.sleep(0.005)
    assert heard == [SAMPLE, SAMPLE]
