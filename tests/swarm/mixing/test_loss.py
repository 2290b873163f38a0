from hypothesis import given
from hypothesis import strategies as st

from swarm.mixing.loss import Loss, edge_counts, lost

rounds = st.integers(0, 10_000)
losses = st.builds(Loss, st.floats(0, 1), st.integers(0, 100))


def test_frequency() -> None:
    """30% of 20000 messages, within four standard errors; directions are independent."""
    loss = Loss(0.3, seed=1)
    there = [lost(loss, round_, "a", "b") for round_ in range(20_000)]
    back = [lost(loss, round_, "b", "a") for round_ in range(20_000)]
    assert abs(sum(there) / 20_000 - 0.3) < 4 * (0.21 / 20_000) ** 0.5
    both = sum(x and y for x, y in zip(there, back, strict=True)) / 20_000
    assert abs(both - 0.09) < 4 * (0.09 * 0.91 / 20_000) ** 0.5


@given(loss=losses, round_=rounds)
def test_symmetric_drop_asks_both_ends_the_same(loss: Loss, round_: int) -> None:
    there = edge_counts(loss, "symmetric", round_, "a", "b")
    assert there == edge_counts(loss, "symmetric", round_, "b", "a")
    assert there == (not lost(loss, round_, "a", "b") and not lost(loss, round_, "b", "a"))


@given(loss=losses, round_=rounds)
def test_other_policies_ask_one_direction(loss: Loss, round_: int) -> None:
    arrives = not lost(loss, round_, "a", "b")
    assert edge_counts(loss, "stale", round_, "a", "b") == arrives
    assert edge_counts(loss, "give-back", round_, "a", "b") == arrives


def test_none_and_all() -> None:
    assert not any(lost(Loss(0.0), round_, "a", "b") for round_ in range(100))
    assert all(lost(Loss(1.0), round_, "a", "b") for round_ in range(100))


def test_a_fixed_function() -> None:
    """Real processes of any version and machine must lose the same messages."""
    drawn = [lost(Loss(0.5, seed=7), round_, "drone0", "drone1") for round_ in range(12)]
    assert drawn == [bool(int(bit)) for bit in "100110010100"]
