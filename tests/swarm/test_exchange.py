"""Who is here, as tokens come and go, and how long a round may take: without a network."""

import pytest

from swarm.protocol.timing import PATIENCE, Timing, deadline
from swarm.wire.roster import LIVES, Presence


def test_the_deadline_follows_the_rounds_within_floor_and_ceiling() -> None:
    timing = Timing(round=30.0, round_floor=2.0)
    assert deadline([], timing) == 30.0
    assert deadline([0.004] * 20, timing) == 2.0
    assert deadline([1.5] * 20, timing) == pytest.approx(PATIENCE * 1.5)
    assert deadline([1.0] * 19 + [25.0], timing) == pytest.approx(PATIENCE)
    assert deadline([20.0] * 5, timing) == 30.0


def test_presence_follows_tokens_in_any_order_and_the_later_life_counts() -> None:
    presence = Presence(("a", "b"))
    presence.put("a", "2")
    presence.put("a", "1")  # a frozen one comes back beside its successor
    assert presence.incarnation("a") == "2"
    presence.delete("a", "2")
    assert presence.incarnation("a") == "1"
    presence.delete("a", "1")
    presence.delete("a", "1")
    assert presence.incarnation("a") is None
    assert not presence.alive


def test_a_flood_of_tokens_is_not_kept() -> None:
    presence = Presence(("a",))
    for i in range(1000):
        presence.put(f"mallory{i}", "1")
        presence.put("a", f"{i:x}")
    assert list(presence.alive) == ["a"]
    assert len(presence.alive["a"]) == LIVES
