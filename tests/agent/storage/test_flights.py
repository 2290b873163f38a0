"""What a run keeps of its flights is bounded, spread over its rounds, and never in the way."""

from pathlib import Path

import pytest

from agent.storage.flights import SAMPLES, FlightLog, read_flights
from swarm.reports.telemetry import FlightSample


def sample(round_: int) -> FlightSample:
    return FlightSample(
        agent="drone0", round=round_, time=0.0, flight=0, step=0, position=(0.0, 0.0, -1.0),
        yaw=0.0, action=0, reward=0.0, distance=0.0, camera=b"\x89PNG",
    )  # fmt: skip


def fly(path: Path, rounds: int, first: int = 0, every: float = 1.0) -> list[int]:
    """Play a run that offers 50 samples a round, ``every`` [s]; rounds of those that are kept."""
    now = round_ = 0.0
    log = FlightLog(path, first, rounds, lambda: round_ + first, clock=lambda: now)
    for played in range(rounds - first):
        round_ = played
        for _ in range(50):
            now += every
            if log.flight_due():
                log.flight(sample(first + played))
    return [kept.round for kept in read_flights(path)]


@pytest.mark.parametrize("rounds", [100, 1000, 5000])
def test_a_run_of_any_length_keeps_as_many_samples_of_all_its_rounds(
    tmp_path: Path, rounds: int
) -> None:
    kept = fly(tmp_path / "flown" / "drone0.jsonl", rounds)
    assert len(kept) == SAMPLES
    assert kept[0] == 0
    assert kept[-1] >= rounds * (1 - 2 / SAMPLES) - 1
    assert sum(round_ < rounds / 2 for round_ in kept) == pytest.approx(SAMPLES / 2, abs=2)


def test_steps_that_take_no_time_are_not_all_kept(tmp_path: Path) -> None:
    assert len(fly(tmp_path / "drone0.jsonl", 4, every=0.025)) == pytest.approx(20, abs=2)


def test_rounds_that_are_played_again_are_kept_once(tmp_path: Path) -> None:
    path = tmp_path / "drone0.jsonl"
    fly(path, 100)
    with path.open("ab") as file:
        file.write(b'{"torn')
    kept = fly(path, 100, first=60)
    assert kept == sorted(kept)
    assert len(kept) == SAMPLES
    assert read_flights(path)[0] == sample(0)


def test_a_disk_that_refuses_costs_a_line(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "flown").touch()  # no folder can be made there
    assert fly(tmp_path / "flown" / "drone0.jsonl", 100, every=0.3) == []
    assert 1 <= len(caplog.records) <= 26  # 25 minutes
    assert "drone0.jsonl cannot be written" in caplog.text
