import numpy as np

from swarm.memory import Faults, MemoryExchange, Partition, Poison
from swarm.mixing.loss import Loss, lost

PAIR = {"a": ("b",), "b": ("a",)}


def publish(exchange: MemoryExchange, round_: int) -> None:
    for number, agent in enumerate(PAIR):
        exchange.publish(round_, agent, np.array([10.0 * round_ + number]))


def heard(exchange: MemoryExchange, round_: int, receiver: str) -> dict[str, float]:
    return {sender: float(v[0]) for sender, v in exchange.gather(round_, receiver).items()}


def test_neighbours_hear_this_round() -> None:
    exchange = MemoryExchange(PAIR, Loss(), "stale")
    for round_ in range(3):
        publish(exchange, round_)
        assert heard(exchange, round_, "a") == {"b": 10.0 * round_ + 1}
        assert heard(exchange, round_, "b") == {"a": 10.0 * round_}


def test_delay() -> None:
    exchange = MemoryExchange(PAIR, Loss(), "stale", Faults(delay=2))
    for round_ in range(6):
        publish(exchange, round_)
        expected = {"b": 10.0 * (round_ - 2) + 1} if round_ >= 2 else {}
        assert heard(exchange, round_, "a") == expected


def test_losses_are_those_of_real_agents() -> None:
    loss = Loss(0.5, seed=3)
    for policy in ("stale", "symmetric"):
        exchange = MemoryExchange(PAIR, loss, policy)
        for round_ in range(50):
            publish(exchange, round_)
            gone = lost(loss, round_, "b", "a")
            gone |= policy == "symmetric" and lost(loss, round_, "a", "b")
            assert (heard(exchange, round_, "a") == {}) == gone


def test_a_partition_comes_and_goes() -> None:
    full = {agent: tuple(other for other in "abc" if other != agent) for agent in "abc"}
    gap = Partition(first=1, last=2, groups=(("a", "b"),))  # c hears nobody
    exchange = MemoryExchange(full, Loss(), "stale", Faults(partitions=(gap,)))
    for round_ in range(4):
        for agent in "abc":
            exchange.publish(round_, agent, np.zeros(1))
        apart = round_ in (1, 2)
        assert set(exchange.gather(round_, "a")) == ({"b"} if apart else {"b", "c"})
        assert set(exchange.gather(round_, "c")) == (set() if apart else {"a", "b"})


def test_a_traitor_sends_what_is_not_its_own_from_its_round_on() -> None:
    honest = np.array([1.0, -2.0, 3.0, 4.0])
    opposite = Poison(("b",), "opposite", 2.0, first=3)
    np.testing.assert_array_equal(opposite.spoil(2, "b", honest), honest)
    np.testing.assert_array_equal(opposite.spoil(3, "a", honest), honest)
    np.testing.assert_array_equal(opposite.spoil(3, "b", honest), -2 * honest)
    shift = Poison(("b",), "shift", 5.0).spoil(0, "b", honest)
    np.testing.assert_array_equal(shift, [6.0, -2.0, 8.0, 4.0])
    noise = Poison(("b",), "noise", 1.0)
    np.testing.assert_array_equal(noise.spoil(1, "b", honest), noise.spoil(1, "b", honest))
    assert not np.array_equal(noise.spoil(1, "b", honest), noise.spoil(2, "b", honest))
    exchange = MemoryExchange({"a": ("b",)}, Loss(), "stale", Faults(poison=opposite))
    exchange.publish(3, "b", honest)
    np.testing.assert_array_equal(exchange.gather(3, "a")["b"], -2 * honest)
