"""Both ends of an edge, hearing each other or not."""

from itertools import product

import pytest

from swarm.protocol.accounts import UNUSED, Account, successor
from swarm.protocol.messages import LISTED, Statement

LIVES = ("1", "2")


def pair() -> tuple[Account, Account]:
    ours, theirs = Account(), Account()
    for account in (ours, theirs):
        assert account.meet(Statement(), LIVES) == (False, None)
    return ours, theirs


def test_a_use_that_the_other_end_confirms_is_kept() -> None:
    ours, theirs = pair()
    for round_ in range(5):
        ours.use(round_)
        theirs.use(round_)
        assert ours.settle(theirs.state(), round_) is None  # it speaks of this round still
        assert ours.settle(theirs.state(), round_ + 1) is None
        assert theirs.settle(ours.state(), round_ + 1) is None
    assert ours.rounds == theirs.rounds == (2, 3, 4)
    assert (ours.uses, ours.one_sided, ours.open) == (5, 0, None)


def test_a_use_of_one_end_is_taken_back_once() -> None:
    ours, theirs = pair()
    ours.use(7)
    assert ours.settle(theirs.state(), 8) == 7
    assert ours.settle(theirs.state(), 9) is None
    assert (ours.rounds, ours.uses, ours.one_sided) == ((), 0, 1)
    assert ours.state().fresh


def test_a_resumed_swarm_goes_on_and_an_older_disk_does_not() -> None:
    ours, theirs = pair()
    for account in (ours, theirs):
        account.use(4)
    assert ours.meet(theirs.state(), ("3", "4")) == (False, None)
    old = Account(rounds=(3,), booked=1)
    assert ours.meet(old.state(), ("3", "5")) == (True, None)
    assert (ours.number, ours.state().fresh) == (1, True)


def test_duals_of_an_edge_that_is_not_used_are_void_once() -> None:
    ours, _ = pair()
    ours.use(1)
    assert [ours.rest() for _ in range(2 * UNUSED)].count(True) == 1
    assert ours.number == 1


statements = [
    Statement(number, fresh, rounds)
    for number, fresh, rounds in product((0, 1, 2), (True, False), ((), (5,), (5, 6)))
]


@pytest.mark.parametrize("own", statements)
@pytest.mark.parametrize("theirs", statements)
def test_both_ends_come_to_one_account_whoever_hears_first(
    own: Statement, theirs: Statement
) -> None:
    ends = [
        Account(s.number, 0 if s.fresh else 1, s.rounds, None, ("old", "old"))
        for s in (own, theirs)
    ]
    for turn in range(6):  # one hears, then the other, and so on
        hearing, speaking = ends[turn % 2], ends[1 - turn % 2]
        hearing.meet(speaking.state(), ("new", "new"))
    assert ends[0].number == ends[1].number
    assert successor(ends[0].state(), ends[1].state(), True) == ends[0].number


def test_no_more_rounds_are_listed_than_a_message_may_hold() -> None:
    ours, _ = pair()
    for round_ in range(10):
        ours.use(round_)
    assert len(ours.state().rounds) == LISTED
