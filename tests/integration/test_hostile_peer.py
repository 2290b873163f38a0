"""Strangers and traitors on every key: dropped, counted, said once per cause; nobody stops."""

from collections.abc import Iterator
from contextlib import ExitStack
from itertools import count, islice
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import zenoh

from agent.config.experiment import load
from agent.daemon.process import layout_of
from agent.learning.learners import build_learner
from agent.storage.runfolder import RunFolder
from deploy.observe.status import collect, observe
from swarm.protocol.guard import STRANGERS
from swarm.protocol.messages import PROTOCOL
from swarm.wire.keys import Keys
from swarm.wire.payload import HEADER_LIMIT, Layout, plain
from tests.integration.harness import (
    GRIDWORLD_A,
    MEMBERS,
    framed,
    free_base_port,
    rounds_played,
    status,
    swarm,
    until,
)

pytestmark = pytest.mark.integration


def test_bad_messages_are_counted_and_dropped(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with swarm(
        "up", GRIDWORLD_A, "--run", folder, "--no-record", "--set", "rounds=1000000", cwd=tmp_path
    ) as command:
        command.says("first round")
        config = load(folder / "config.json")
        layout = layout_of(config, build_learner(config, "drone0"))
        body = np.zeros(layout.size, "<f4").tobytes()

        alive = status(folder, tmp_path)[1]["agents"]["drone1"]["incarnation"]

        def header(**changes: object) -> bytes:
            good = {
                "version": PROTOCOL,
                "fingerprint": layout.fingerprint,
                "agent": "drone1",
                "incarnation": alive,
                "round": 5,
                "neighbours": {"drone0": [0, True, [], 0]},
            }
            return msgspec.msgpack.encode(good | changes)

        nan = np.full(layout.size, np.nan, "<f4").tobytes()
        far_out = np.full(layout.size, 1e6, "<f4").tobytes()
        bad = [
            (b"junk", body),
            (header(version=99), body),
            (header(fingerprint="?"), body),
            (header(incarnation="0"), body),
            (header(), body[:-4]),
            (header(), nan),
            (header(), far_out),
        ]
        keys = Keys(config.name)
        with observe(config) as session:
            # Few enough that the honest drone1 is not shut out for what we do in its name.
            publisher = session.declare_publisher(keys.params("drone1"))
            stranger = session.declare_publisher(keys.params("mallory"))
            until(lambda: len(session.info.peers_zid()) >= len(MEMBERS), "links to all")
            for _ in range(2):
                for said, payload in bad:
                    publisher.put(payload, attachment=framed("drone1", alive, said, payload))
                publisher.put(body, attachment=b"junk")
                publisher.put(body, attachment=framed("drone2", alive, header(), body))
                stranger.put(body, attachment=framed("mallory", alive, header(), body))
            causes = {"frame", "header", "version", "fingerprint", "stranger", "incarnation"}
            causes |= {"key", "length", "finite", "norm"}

            def counted() -> bool:
                rejected = status(folder, tmp_path)[1]["agents"]["drone0"]["rejected"]
                return set(rejected) == causes and all(n == 2 for n in rejected.values())

            until(counted, "each cause counted twice")
        before = rounds_played(folder, "drone0")
        until(lambda: rounds_played(folder, "drone0") > before + 20, "the swarm goes on")
        code, summary = status(folder, tmp_path)
        assert code == 1
        assert any("drone0 rejected messages" in problem for problem in summary["problems"])
    log = RunFolder(folder).log("drone0").read_text()
    assert log.count("for this cause, said once a minute") == len(bad) + 3


FLOOD = 100_000  # messages
TRAITOR = "drone4"  # a member of the file, and hostile
CAUSES = {"frame", "header", "version", "fingerprint", "round", "length", "finite", "norm", "key"}
CAUSES |= {"incarnation", "stranger", "quarantined"}


def hostile(layout: Layout, replayed: list[tuple[bytes, bytes]]) -> Iterator[tuple[str, Any, Any]]:
    """(sender in the key, body, attachment), for ever."""

    def header(**changes: object) -> bytes:
        fields = {"version": PROTOCOL, "fingerprint": layout.fingerprint, "agent": TRAITOR}
        fields |= {"incarnation": "f00d", "round": 5}
        fields["neighbours"] = {member: [0, True, [], 0] for member in MEMBERS}
        return msgspec.msgpack.encode(fields | changes)

    body = np.zeros(layout.size, "<f4").tobytes()
    nan = np.full(layout.size, np.nan, "<f4").tobytes()
    far_out = np.full(layout.size, 1e6, "<f4").tobytes()
    said = [
        (body, b"junk"),
        (body, bytes(HEADER_LIMIT + 1)),
        (body, header(version=99)),
        (body, header(fingerprint="?")),
        (body, header(round=-1)),
        (body, header(round=10**9)),
        (body[:-4], header()),
        (body * 50, header()),
        (nan, header()),
        (far_out, header()),
        (body, header(agent="drone1")),
        (body, header(incarnation="0")),
    ]
    for number in count():
        payload, attachment = said[number % len(said)]
        yield TRAITOR, payload, framed(TRAITOR, "f00d", attachment, payload)
        yield TRAITOR, payload, (b"junk", None, attachment)[number % 3]
        yield ("mallory", *replayed[number % len(replayed)])


@pytest.mark.timeout(600)  # a busy machine; alone it takes less than a minute
def test_a_flood_on_every_key_while_the_swarm_learns(tmp_path: Path) -> None:
    """A fifth member turns against the other four: what it says is counted, and not mixed in."""
    file = tmp_path / "five.toml"
    task = 'env = "sim:GridWorld-v0", kwargs = { layout = "a", task = 0 }'
    file.write_text(
        GRIDWORLD_A.read_text() + f'[[agents]]\nid = "{TRAITOR}"\ntask = {{ {task} }}\n'
    )
    settings = [f"network.base_port={free_base_port(5)}", "rounds=1000000", "timing.start=2"]
    settings += ['topology.kind="complete"']
    config, keys = load(file, settings), Keys("gridworld-a")
    layout = layout_of(config, build_learner(config, "drone0"))
    options = [word for setting in settings for word in ("--set", setting)]
    with ExitStack() as stack:
        for member in MEMBERS:
            folder = tmp_path / member
            stack.enter_context(
                swarm("agent", file, "--id", member, "--run", folder, *options, cwd=tmp_path)
            )
        session = stack.enter_context(observe(config))
        replayed: list[tuple[bytes, bytes]] = []

        def capture(sample: zenoh.Sample) -> None:
            if len(replayed) < 20 and sample.attachment is not None:
                replayed.append((sample.payload.to_bytes(), sample.attachment.to_bytes()))

        listening = session.declare_subscriber(keys.params(), capture)
        until(lambda: len(replayed) == 20, "honest messages to replay")
        listening.undeclare()
        before = collect(session, config, 10.0)
        assert set(before) == set(MEMBERS)
        token = session.liveliness().declare_token(keys.alive(TRAITOR, "f00d"))
        hello = msgspec.msgpack.encode(
            {"version": PROTOCOL, "fingerprint": layout.fingerprint, "agent": TRAITOR,
             "incarnation": "f00d", "round": 0, "run": before["drone0"].run,
             "neighbours": {member: [0, True, [], 0] for member in MEMBERS}}
        )  # fmt: skip

        def known() -> bool:
            session.put(keys.params(TRAITOR), b"", attachment=framed(TRAITOR, "f00d", hello, b""))
            return all(TRAITOR in s.neighbours for s in collect(session, config, 10.0).values())

        until(known, "everybody knows the traitor")
        params = {
            sender: session.declare_publisher(
                keys.params(sender), congestion_control=zenoh.CongestionControl.BLOCK
            )
            for sender in (TRAITOR, "mallory")
        }
        elsewhere = [keys.state("drone0"), keys.status("drone1"), keys.telemetry("drone2", "round")]
        elsewhere += [keys.alive("drone3", "0")]
        for i, (sender, body, attachment) in enumerate(islice(hostile(layout, replayed), FLOOD)):
            params[sender].put(body, attachment=attachment)
            if i % 100 == 0:
                for key in elsewhere:
                    session.put(key, body, attachment=attachment)
        until(
            lambda: all(
                sum(status.rejected.values()) >= FLOOD
                for status in collect(session, config, 10.0).values()
            ),
            "every message refused by everybody",
            deadline=120.0,
        )
        after = collect(session, config, 10.0)
        token.undeclare()
        reached = {member: after[member].round for member in MEMBERS}
        until(
            lambda: all(
                status.round > reached[member] + 20
                for member, status in collect(session, config, 10.0).items()
            ),
            "the swarm goes on",
        )
    assert set(after) == set(MEMBERS)
    for member in MEMBERS:
        assert after[member].incarnation == before[member].incarnation  # nobody was restarted
        assert sum(after[member].rejected.values()) == FLOOD
        assert set(after[member].rejected) <= CAUSES
        assert {TRAITOR, STRANGERS} >= set(after[member].quarantined)  # for a time
        assert after[member].rejected["quarantined"] > 0.9 * FLOOD
        assert after[member].memory_mb < before[member].memory_mb + 10
        reports = list(RunFolder(tmp_path / member).reports(member))
        assert all(TRAITOR not in report.weights for report in reports)


def test_what_one_member_claims_moves_nobody(tmp_path: Path) -> None:
    """It lies about valid rounds, states, learned counts and neighbours, in messages that read."""
    file = tmp_path / "five.toml"
    task = 'env = "sim:GridWorld-v0", kwargs = { layout = "a", task = 0 }'
    file.write_text(
        GRIDWORLD_A.read_text() + f'[[agents]]\nid = "{TRAITOR}"\ntask = {{ {task} }}\n'
    )
    settings = [f"network.base_port={free_base_port(5)}", "rounds=1000000", "timing.start=2"]
    config, keys = load(file, settings), Keys("gridworld-a")
    layout = layout_of(config, build_learner(config, "drone0"))
    options = [word for setting in settings for word in ("--set", setting)]
    body = np.zeros(layout.size, "<f4").tobytes()

    def start(stack: ExitStack, member: str) -> None:
        folder = tmp_path / member
        stack.enter_context(
            swarm("agent", file, "--id", member, "--run", folder, *options, cwd=tmp_path)
        )

    with ExitStack() as stack:
        for member in MEMBERS[:3]:
            start(stack, member)
        session = stack.enter_context(observe(config))

        def all_know(agents: set[str]) -> bool:
            said = collect(session, config, 5.0)
            return set(said) == agents and all(s.round > 20 for s in said.values())

        until(lambda: all_know(set(MEMBERS[:3])), "three learn")
        run = collect(session, config, 5.0)["drone0"].run

        def header(round_: int, **changes: object) -> bytes:
            fields = {"version": PROTOCOL, "fingerprint": layout.fingerprint, "agent": TRAITOR}
            fields |= {"incarnation": "f00d", "round": round_, "run": run}
            fields["neighbours"] = {member: [0, True, [], 0, ""] for member in MEMBERS}
            return msgspec.msgpack.encode(fields | changes)

        token = session.liveliness().declare_token(keys.alive(TRAITOR, "f00d"))
        state = plain(layout).fingerprint
        stack.callback(
            session.declare_queryable(
                keys.state(TRAITOR),
                lambda query: query.reply(
                    keys.state(TRAITOR), body, attachment=header(500_000, fingerprint=state)
                ),
            ).undeclare
        )
        lies = [
            header(500_000),
            header(1_000_000, phase="finished"),
            header(0, neighbours={}),
            header(40, neighbours={m: [2**53, False, [1, 2, 3], 2**53, ""] for m in MEMBERS}),
        ]
        start(stack, "drone3")  # it joins while the traitor offers it a state
        for _ in range(20):
            for lie in lies:
                session.put(keys.params(TRAITOR), body, attachment=lie)

        until(lambda: all_know(set(MEMBERS)), "four learn")
        reached = {m: s.round for m, s in collect(session, config, 5.0).items()}
        until(
            lambda: all(
                status.round > reached[member] + 20
                for member, status in collect(session, config, 5.0).items()
            ),
            "the swarm goes on",
        )
        token.undeclare()
        after = collect(session, config, 5.0)
    assert {status.state for status in after.values()} == {"learning"}
    assert max(status.round for status in after.values()) < 400_000
