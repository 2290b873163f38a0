"""Each invariant can fail: with one line broken on purpose the protocol breaks it somewhere."""

from collections.abc import Callable
from typing import Any

import pytest

from swarm.protocol import machine, membership, messages, peers, transfer
from swarm.protocol.accounts import Account
from swarm.protocol.actions import Await
from swarm.protocol.machine import Machine
from swarm.protocol.membership import Membership
from swarm.protocol.messages import ParameterHeader, Statement
from swarm.protocol.peers import Peer
from swarm.protocol.quorum import Quorum
from tests.swarm.simulation import world
from tests.swarm.simulation.invariants import failing
from tests.swarm.simulation.schedule import Damage, draw

SEARCHED = 400  # schedules in which a mutant must be found
Patch = Callable[[pytest.MonkeyPatch], None]


def keeps_one_sided_shares(patch: pytest.MonkeyPatch) -> None:
    def close(self: Account, theirs: Statement) -> None:
        self.open = None

    patch.setattr(Account, "_close", close)


def goes_on_with_old_accounts(patch: pytest.MonkeyPatch) -> None:
    def meet(self: Account, theirs: Statement, lives: tuple[str, str]) -> tuple[bool, None]:
        self.lives, self.number, self.open = lives, theirs.number, None
        return False, None

    patch.setattr(Account, "meet", meet)


def never_waits_again_for_who_was_late(patch: pytest.MonkeyPatch) -> None:
    hear = Peer.hear

    def deaf(self: Peer, now: float, header: ParameterHeader, vector: Any, run: str) -> bool:
        late = self.late
        heard = hear(self, now, header, vector, run)
        self.late = late
        return heard

    patch.setattr(Peer, "hear", deaf)


def waits_for_who_was_late_every_time(patch: pytest.MonkeyPatch) -> None:
    may_come = Machine._may_come

    def patient(self: Machine, peer: Peer) -> bool:
        peer.late = False
        return may_come(self, peer)

    patch.setattr(Machine, "_may_come", patient)


def names_no_cause(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Machine, "_wait", lambda self, now: Await({}, now + 0.1))


def believes_one(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(membership, "WITNESSES", 1)


def takes_any_state(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(transfer, "_confirms", lambda witness, claim: True)


def mixes_other_runs(patch: pytest.MonkeyPatch) -> None:
    hear = Peer.hear

    def gullible(self: Peer, now: float, header: ParameterHeader, vector: Any, run: str) -> bool:
        return hear(self, now, header, vector, header.run)

    patch.setattr(Peer, "hear", gullible)
    patch.setattr(Membership, "fellow", lambda self, member: self._peers[member].here)
    patch.setattr(Machine, "_current", lambda self, peer, header: True)


def does_not_order_lives(patch: pytest.MonkeyPatch) -> None:
    for module in (machine, peers, messages):
        patch.setattr(module, "order", lambda life: 0)


def trains_alone(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(world, "QUORUM", Quorum(patience=1e9))


def forgets_nothing(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(peers, "KEPT", 1000)


@pytest.mark.parametrize(
    ("mutant", "breaks", "kinds"),
    [
        (keeps_one_sided_shares, "is kept by one end only", ("lossy",)),
        (goes_on_with_old_accounts, "their duals do not cancel", ("crash",)),
        (never_waits_again_for_who_was_late, "does not mix with", ("freeze", "cut")),
        (waits_for_who_was_late_every_time, "times into the deadline", ("cut",)),
        (names_no_cause, "waits without a cause", ("crash",)),
        (believes_one, "is carried to round", ("lie",)),
        (takes_any_state, "takes a state that a liar offers", ("lie", "crash")),
        (mixes_other_runs, "of another", ("lie", "twin")),
        (does_not_order_lives, "lives 2 times", ("twin",)),
        (trains_alone, "trains alone", ("leave", "cut")),
        (forgets_nothing, "keeps more than it needs", ("crash",)),
    ],
)
def test_a_mutant_is_found(
    mutant: Patch, breaks: str, kinds: tuple[Damage, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    mutant(monkeypatch)
    told: list[str] = []
    for seed in range(SEARCHED):
        told = failing(draw(seed, kinds, most=6))
        if any(breaks in line for line in told):
            return
    pytest.fail(f"{SEARCHED} schedules without '{breaks}'; the last one: {told}")
