"""A stranger on the parameters' keys: dropped, counted, logged once per cause; nobody stops."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from agent.config import load
from agent.daemon import layout_of
from agent.runfolder import RunFolder
from agent.tabular import TabularLearner
from deploy.status import observe
from swarm.keys import Keys
from swarm.payload import PROTOCOL
from tests.integration.harness import (
    GRIDWORLD_A,
    MEMBERS,
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
        layout = layout_of(config, TabularLearner(config, "drone0"))
        body = np.zeros(layout.size, "<f4").tobytes()

        alive = status(folder, tmp_path)[1]["agents"]["drone1"]["incarnation"]

        def header(**changes: object) -> bytes:
            good = {
                "version": PROTOCOL,
                "fingerprint": layout.fingerprint,
                "agent": "drone1",
                "incarnation": alive,
                "round": 5,
                "neighbours": ["drone0"],
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
                for attachment, payload in bad:
                    publisher.put(payload, attachment=attachment)
                stranger.put(body, attachment=header())
                stranger.put(body, attachment=header(agent="mallory"))
            causes = {"header", "version", "fingerprint", "stranger", "incarnation", "key"}
            causes |= {"length", "finite", "norm"}

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
    assert log.count("said once, counted after") == len(bad) + 2
