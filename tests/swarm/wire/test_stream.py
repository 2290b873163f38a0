"""Chunks, acknowledgements and resumption, on a clock that the test moves."""

import random
from collections import deque

from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.wire.frames import Ack, Ask, Chunk
from swarm.wire.stream import LARGE, TRIES, Arrival, Incoming, Message, Outgoing, Part
from swarm.wire.window import FIRST, LEAST_CHUNK


def body(size: int, seed: int = 0) -> bytes:
    return random.Random(seed).randbytes(size)


def data(part: Part) -> bytes:
    return bytes(part.body[part.frame.offset : part.frame.offset + part.size])


class Pair:
    """Two ends and what is under way between them."""

    def __init__(self, life: str = "1", host: str = "") -> None:
        self.out = Outgoing("a", "1", host=host)
        self.into = Incoming("b", life, host=host)
        self.now, self.arrived = 100.0, list[Arrival]()
        self.flying: deque[tuple[Chunk | Ask, bytes]] = deque()
        self.parts: list[Part] = []

    def send(self) -> None:
        """All that may go now."""
        while (part := self.out.chunk(self.now)) is not None:
            self.parts.append(part)
            self.flying.append((part.frame, data(part)))

    def deliver(self, shared: bool = False) -> None:
        """All that is under way, and what is said to it."""
        while self.flying:
            frame, part = self.flying.popleft()
            if isinstance(frame, Ask):
                ack: Ack | None = self.into.answer(frame, self.now)
            else:
                ack, arrival = self.into.accept(frame, part, self.now, shared=shared)
                if arrival is not None:
                    self.arrived.append(arrival)
            if ack is not None:
                self.out.acknowledge(ack, self.now)

    def play(self, rounds: int = 200) -> None:
        """Until all has arrived."""
        for _ in range(rounds):
            self.send()
            if not self.flying:
                self.now += max(0.0, self.out.due(self.now))
                if (ask := self.out.ask(self.now)) is not None:
                    self.flying.append((ask, b""))
            self.now += 0.01
            self.deliver()
            if not self.out.waiting and not self.out.under_way:
                return
        raise AssertionError(self.out)


def test_messages_arrive_in_order_whole_and_once() -> None:
    pair = Pair()
    bodies = [body(n, n) for n in (0, 1, LEAST_CHUNK, LEAST_CHUNK + 1, 700_000)]
    for number, one in enumerate(bodies):
        pair.out.offer(Message("round", bytes([number]), one))
        pair.play()
    assert [bytes(arrival.body) for arrival in pair.arrived] == bodies
    assert [arrival.header for arrival in pair.arrived] == [bytes([i]) for i in range(5)]
    assert (pair.out.resent, pair.out.delivered) == (0, 5)


def test_no_more_than_the_window_is_under_way() -> None:
    pair = Pair()
    pair.out.offer(Message("round", b"h", body(4 * FIRST)))
    pair.send()
    assert sum(part.size for part in pair.parts) <= FIRST
    assert all(part.size <= LEAST_CHUNK for part in pair.parts)  # nothing is known of the link yet
    assert pair.parts[-1].frame.wants  # or it would never open again


def test_the_newest_replaces_what_has_not_begun_to_leave() -> None:
    pair = Pair()
    pair.out.offer(Message("round", b"0", body(2 * FIRST)))
    pair.send()
    for number in (1, 2, 3):
        pair.out.offer(Message("round", bytes([number]), body(10, number)))
    pair.out.offer(Message("state", b"s", body(10)))
    pair.play()
    assert [arrival.header for arrival in pair.arrived] == [b"0", b"\3", b"s"]
    assert pair.out.replaced == 2


def test_a_lost_link_is_resumed_where_it_broke() -> None:
    pair, one = Pair(), body(200_000)
    pair.out.offer(Message("round", b"h", one))
    pair.send()
    lost = [pair.flying.pop() for _ in range(5)]
    pair.deliver()
    had = pair.into.have
    pair.play()
    assert bytes(pair.arrived[0].body) == one
    assert pair.out.resumes == 1
    assert pair.out.resent == sum(len(part) for _, part in lost) == 200_001 - had


def test_nothing_is_sent_again_for_being_slow() -> None:
    pair = Pair()
    pair.out.offer(Message("round", b"h", body(100_000)))
    pair.send()
    for _ in range(5):  # all that was sent is still under way, and so are the questions behind it
        pair.now += 30.0
        ask = pair.out.ask(pair.now)
        assert ask is not None
        pair.flying.append((ask, b""))
        assert pair.out.chunk(pair.now) is None
    pair.deliver()
    assert (pair.out.resent, pair.out.resumes, len(pair.arrived)) == (0, 0, 1)


def test_a_receiver_that_starts_anew_gets_the_message_from_its_beginning() -> None:
    pair, one = Pair(), body(400_000)
    pair.out.offer(Message("round", b"h", one))
    pair.send()
    pair.deliver()
    pair.into = Incoming("b", "2")
    pair.play()
    assert [bytes(arrival.body) for arrival in pair.arrived] == [one]
    assert pair.out.stream == 1


def test_a_message_that_is_refused_does_not_hold_up_the_next() -> None:
    pair = Pair()
    pair.out.offer(Message("round", b"no", body(100_000)))
    pair.out.offer(Message("state", b"yes", body(10)))
    pair.send()
    first, part = pair.flying.popleft()
    assert isinstance(first, Chunk)
    pair.into.accept(first, part, pair.now, wanted=False)
    pair.play()
    assert [arrival.header for arrival in pair.arrived] == [b"yes"]


def test_shared_memory_takes_whole_bodies_and_is_given_up_when_it_fails() -> None:
    pair = Pair(host="here")
    pair.out.offer(Message("round", b"0", b""))
    pair.play()  # the first acknowledgement names the machine
    assert pair.out.shares(LARGE)
    assert not pair.out.shares(LARGE - 1)
    pair.out.offer(Message("round", b"1", body(5 * FIRST)))
    pair.send()
    assert (pair.parts[-1].shared, pair.parts[-1].size) == (True, 5 * FIRST)
    pair.deliver(shared=True)
    for number in range(TRIES):  # does not arrive any more
        assert pair.out.shares(LARGE)
        pair.out.offer(Message("round", bytes([number + 2]), body(LARGE)))
        pair.send()
        pair.flying.clear()
        pair.play()
    assert not pair.out.shares(LARGE)
    assert len(pair.arrived) == 2 + TRIES


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32), st.lists(st.integers(0, 60_000), min_size=1, max_size=6))
def test_whatever_breaks_everything_arrives_in_order(seed: int, sizes: list[int]) -> None:
    """Links break at random: all that is under way is lost, or all from some place on."""
    pair, dice = Pair(), random.Random(seed)
    for number, size in enumerate(sizes):
        pair.out.offer(Message(str(number), bytes([number]), body(size, number)))
    for _ in range(dice.randrange(12)):
        pair.send()
        pair.now += dice.random()
        if (ask := pair.out.ask(pair.now)) is not None:
            pair.flying.append((ask, b""))
        for _ in range(dice.randrange(len(pair.flying) + 1)):
            pair.flying.pop()
        if dice.random() < 0.2:
            pair.flying.clear()
        pair.deliver()
    pair.play()
    assert [bytes(arrival.body) for arrival in pair.arrived] == [
        body(size, number) for number, size in enumerate(sizes)
    ]
