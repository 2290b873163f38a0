"""Accounts of an edge, compared from both ends."""

import numpy as np

from swarm.protocol.ledger import REPEATED, Ledger
from swarm.wire.payload import PROTOCOL, ParameterHeader

SHARE = np.array([1.0, -2.0])


def header(agent: str, round_: int, used: dict[int, dict[str, float]]) -> ParameterHeader:
    return ParameterHeader(
        version=PROTOCOL,
        fingerprint="",
        agent=agent,
        incarnation="1",
        round=round_,
        neighbours=("me",),
        used=used,
    )


def ledger(round_: int = 5) -> Ledger:
    kept = Ledger("me")
    kept.record(round_, {"b": 0.25, "c": 0.25}, {"b": SHARE, "c": SHARE * 2})
    return kept


def test_equal_accounts_are_settled() -> None:
    kept = ledger()
    agreed = [header("b", 6, {5: {"me": 0.25}}), header("c", 6, {5: {"me": 0.25, "d": 0.5}})]
    assert kept.settle(agreed) == []
    assert kept.one_sided == 0


def test_a_one_sided_share_is_owed_once() -> None:
    kept = ledger()
    without_us = header("c", 6, {5: {"d": 0.5}})
    (share,) = kept.settle([without_us])
    np.testing.assert_array_equal(share, SHARE * 2)
    assert kept.settle([without_us, header("c", 7, {5: {"d": 0.5}})]) == []
    assert kept.one_sided == 1


def test_different_weights_are_one_sided_but_owe_nothing() -> None:
    kept = ledger()
    assert kept.settle([header("b", 6, {5: {"me": 0.5}})]) == []
    assert kept.one_sided == 1


def test_rounds_nobody_speaks_of_are_left_alone() -> None:
    kept = ledger()
    assert kept.settle([header("b", 9, {8: {"d": 0.5}}), header("x", 6, {5: {}})]) == []
    assert kept.one_sided == 0
    for round_ in range(6, 6 + REPEATED):
        kept.record(round_, {}, {})
    assert 5 not in kept.used
    assert kept.settle([header("b", 9, {5: {}})]) == []


def test_who_has_gone_on_without_us_is_known_before_mixing() -> None:
    gone_on = header("b", 6, {5: {"c": 0.25}})
    with_us = header("c", 6, {5: {"me": 0.25}})
    in_step = header("d", 5, {4: {}})
    silent = header("e", 7, {6: {}})
    assert Ledger("me").declined(5, [gone_on, with_us, in_step, silent]) == {"b"}
