"""Who speaks otherwise, as the tokens come and go."""

import logging
from collections.abc import Callable
from typing import Any

import pytest
import zenoh

from swarm.errors import NetworkError
from swarm.wire.keys import Keys
from swarm.wire.payload import Layout
from swarm.wire.refusals import HEARD, LINES, Refusals, speech

KEYS = Keys("s")
OURS = Layout("s", (("theta", (4, 2)),))
THEIRS = Layout("s", (("theta", (5, 2)),))


class Network:
    """A session's liveliness; tokens are put and withdrawn by hand."""

    def __init__(self) -> None:
        self.declared: list[str] = []
        self.here: list[str] = []
        self._receive: Callable[[Any], None]

    def liveliness(self) -> "Network":
        return self

    def declare_subscriber(self, key: str, receive: Callable[[Any], None], history: bool) -> None:
        assert (key, history) == (Keys("*").speaks(), True)
        self._receive = receive

    def declare_token(self, key: str) -> None:
        self.declared.append(key)

    def get(self, key: str, timeout: float) -> list[Any]:
        assert key == KEYS.speaks()
        assert timeout > 0
        return [Sample(token) for token in self.here]

    def put(self, key: str) -> None:
        self._receive(Sample(key, zenoh.SampleKind.PUT))

    def delete(self, key: str) -> None:
        self._receive(Sample(key, zenoh.SampleKind.DELETE))


class Sample:
    """A token, or a reply that names one."""

    def __init__(self, key: str, kind: zenoh.SampleKind = zenoh.SampleKind.PUT) -> None:
        self.key_expr, self.kind, self.ok = key, kind, self


@pytest.fixture
def network() -> Network:
    return Network()


@pytest.fixture
def refusals(network: Network) -> Refusals:
    return Refusals(network, KEYS, "drone0", OURS)  # type: ignore[arg-type]


def test_it_says_what_it_speaks(network: Network, refusals: Refusals) -> None:
    assert network.declared == [KEYS.speaks("drone0", speech(OURS))]
    assert refusals.refused() == set()


def test_who_speaks_otherwise_is_refused_until_gone(network: Network, refusals: Refusals) -> None:
    network.put(KEYS.speaks("drone1", speech(OURS)))
    network.put(KEYS.speaks("drone2", speech(THEIRS)))
    assert refusals.refused() == {"drone2"}
    network.delete(KEYS.speaks("drone2", speech(THEIRS)))
    assert refusals.refused() == set()


def test_an_impostor_does_not_shut_out_the_real_one(network: Network, refusals: Refusals) -> None:
    network.put(KEYS.speaks("drone1", speech(OURS)))
    network.put(KEYS.speaks("drone1", "9.forged"))
    assert refusals.refused() == set()


def test_one_line_about_each_and_no_flood(
    network: Network, refusals: Refusals, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            network.put(KEYS.speaks("drone2", speech(THEIRS)))
            network.put(Keys("other").speaks("drone7", speech(OURS)))
    refused, other = caplog.messages
    assert refused.startswith("refused: drone2 differs in layout = (('theta', (5, 2)),), we ((")
    assert refused.endswith("expected the same release and the same swarm file everywhere")
    assert other.startswith('another swarm is on this network, "other" (drone7)')
    assert refusals.refused() == {"drone2"}
    for i in range(2 * LINES):
        network.put(Keys(f"swarm{i}").speaks("x", "1.x"))
    assert len(caplog.messages) == LINES


def test_nobody_or_a_friend_lets_us_in_and_strangers_alone_do_not(
    network: Network, refusals: Refusals
) -> None:
    refusals.check()
    network.here = [KEYS.speaks("drone0", speech(OURS)), KEYS.speaks("drone1", speech(THEIRS))]
    with pytest.raises(NetworkError, match='swarm "s" refuses us: drone1 differs in layout'):
        refusals.check()
    network.here.append(KEYS.speaks("drone2", speech(OURS)))
    refusals.check()


def test_tokens_on_wild_keys_and_under_many_names_cost_nothing(
    network: Network, refusals: Refusals
) -> None:
    for key in ("dcpg/**", "dcpg/*/speaks/*/x", "**"):
        network.put(key)
    for i in range(2 * HEARD):
        network.put(KEYS.speaks(f"mallory{i}", "4.x"))
        network.put(KEYS.speaks("drone1", f"4.{i}"))
    assert len(refusals.refused()) <= HEARD
    for i in range(2 * HEARD):
        network.delete(KEYS.speaks(f"mallory{i}", "4.x"))
        network.delete(KEYS.speaks("drone1", f"4.{i}"))
    assert refusals.refused() == set()
