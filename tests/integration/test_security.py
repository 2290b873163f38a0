"""TLS swarms for real: who belongs takes part; who does not gets nothing in and nothing out."""

import json
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from agent.config.experiment import load
from agent.storage.runfolder import RunFolder
from deploy.images.certs import make_certificates
from swarm.wire.keys import Keys
from swarm.wire.roster import Roster
from swarm.wire.security import OBSERVER, Party, Security
from swarm.wire.session import Network, configuration, open_session
from tests.integration.harness import (
    GRIDWORLD_A,
    MEMBERS,
    PATIENCE,
    free_base_port,
    rounds_played,
    run,
    status,
    swarm,
    until,
)

pytestmark = pytest.mark.integration
KEYS = Keys("s")
TRY = 2.0  # [s] for a link that must not come; one that may takes milliseconds
NOWHERE = "tls/127.0.0.1:0"


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Certificates of our authority, and of a foreign one for the same names."""
    ours, foreign = tmp_path_factory.mktemp("ours"), tmp_path_factory.mktemp("foreign")
    for folder in (ours, foreign):
        make_certificates(folder, dict.fromkeys(MEMBERS, ()))
    return ours, foreign


def files(folder: Path) -> Security:
    return Security(f"{folder}/ca.pem", f"{folder}/{{agent}}.pem", f"{folder}/{{agent}}.key")


def settings(folder: Path) -> list[str]:
    security = json.dumps(msgspec.to_builtins(files(folder))).replace('": "', '"= "')
    return ["--set", f"network.security={security}", "--no-record"]


def party(name: str) -> Party:
    return Party(name, KEYS, MEMBERS)


@contextmanager
def hostile(
    network: Network, name: str, listen: str, connect: str, must_link: bool = True
) -> Iterator[zenoh.Session]:
    """A session with no scruples: its own access control is off.  It knows nobody else.

    With ``must_link`` it raises ``ZError`` unless it can connect within :data:`TRY`.
    """
    config = configuration(network, party(name), [listen], [connect] if connect else [])
    config.insert_json5("access_control/enabled", "false")
    config.insert_json5("scouting/gossip/enabled", "false")
    if must_link:
        config.insert_json5("connect/timeout_ms", str(int(TRY * 1e3)))
        config.insert_json5("connect/exit_on_failure", "true")
    session = zenoh.open(config)
    try:
        yield session
    finally:
        session.close()


def matched(publisher: zenoh.Publisher) -> bool:
    """Whether somebody's subscription has come to this session, so that a message would leave."""
    found: Any = publisher.matching_status  # its stub says bool
    return bool(found.matching)


def test_a_swarm_learns_over_tls(tmp_path: Path, folders: tuple[Path, Path]) -> None:
    folder = tmp_path / "run"
    with swarm("up", GRIDWORLD_A, "--run", folder, *settings(folders[0]), cwd=tmp_path) as command:
        assert command.wait(150.0) == 0, command.output
    assert "tasks solved: 4 of 4 by every agent's policy" in command.output
    for agent in MEMBERS:
        assert "on tls/" in RunFolder(folder).log(agent).read_text()
        assert all(len(r.weights) == 2 for r in RunFolder(folder).reports(agent))


def test_strangers_and_impostors_get_nothing_in_and_nothing_out(
    tmp_path: Path, folders: tuple[Path, Path]
) -> None:
    """Beside a learning swarm: plain TCP, a foreign authority, and drone1 as drone0."""
    ours, foreign = folders
    folder = tmp_path / "run"
    endless = ["--set", "rounds=1000000", *settings(ours)]
    with swarm("up", GRIDWORLD_A, "--run", folder, *endless, cwd=tmp_path) as command:
        command.says("first round")
        until(lambda: min(rounds_played(folder, m) for m in MEMBERS) > 5, "round 5")
        code, summary = status(folder, tmp_path)
        assert (code, summary["health"]) == (0, "healthy"), summary
        config = load(folder / "config.json")
        keys, victim = Keys(config.name), config.endpoint("drone0")
        plain, other = Network(), Network(security=files(foreign))
        for network, endpoint in (
            (plain, victim.replace("tls/", "tcp/")),
            (other, victim),
            (Network(security=mixed(tmp_path, ours, foreign)), victim),
        ):
            listen = "tcp/127.0.0.1:0" if network is plain else NOWHERE
            with (
                pytest.raises(zenoh.ZError),
                hostile(network, "drone1", listen, endpoint),
            ):
                pass
        incarnations = {a: s["incarnation"] for a, s in summary["agents"].items()}
        with (
            hostile(config.network, "drone1", NOWHERE, victim) as session,
            ExitStack() as tokens,
        ):
            own = session.declare_publisher(keys.params("drone1"))
            until(lambda: matched(own), "the victim's subscription")
            for forged in ("drone0", "drone2", "*"):
                token = session.liveliness().declare_token(keys.alive(forged, "0"))
                tokens.callback(token.undeclare)
                session.declare_queryable(
                    keys.state(forged), lambda q: q.reply(keys.state("drone0"), b"forged")
                )
                session.put(keys.params(forged), b"forged")
                session.put(keys.telemetry(forged, "round"), b"forged")
            for _ in range(3):  # the agent's own key: comes in, and is refused without a frame
                own.put(b"forged")

            def refused() -> dict[str, int]:
                _, seen = status(folder, tmp_path)
                assert {a: s["incarnation"] for a, s in seen["agents"].items()} == incarnations
                rejected: dict[str, int] = seen["agents"]["drone0"]["rejected"]
                return rejected

            until(lambda: refused() == {"frame": 3}, "only what came under drone1's own key")
            with (
                open_session(
                    config.network, config.party(OBSERVER), (), list(map(config.endpoint, MEMBERS))
                ) as watcher,
                Roster(watcher, keys, MEMBERS) as roster,
            ):
                assert not roster.wait_for(MEMBERS, PATIENCE)
                assert roster.present() == incarnations
        before = rounds_played(folder, "drone0")
        until(lambda: rounds_played(folder, "drone0") > before + 20, "the swarm goes on")
        code, summary = status(folder, tmp_path)
        rejected = {agent: said["rejected"] for agent, said in summary["agents"].items()}
        assert rejected == {member: {} for member in MEMBERS} | {"drone0": {"frame": 3}}
        command.interrupt()
        assert command.wait() == 130


def mixed(tmp_path: Path, ours: Path, foreign: Path) -> Security:
    """Files of one who has our authority's certificate (it is no secret) but none signed by it."""
    folder = tmp_path / "mixed"
    folder.mkdir()
    for name in ("drone1.pem", "drone1.key"):
        (folder / name).write_bytes((foreign / name).read_bytes())
    (folder / "ca.pem").write_bytes((ours / "ca.pem").read_bytes())
    return files(folder)


@pytest.mark.parametrize("dials", ["victim", "attacker"])
@pytest.mark.parametrize("name", ["drone1", OBSERVER])
def test_nobody_speaks_for_another_whoever_dials(
    folders: tuple[Path, Path], name: str, dials: str
) -> None:
    network = Network(security=files(folders[0]))
    port = free_base_port(2)
    victim_at, attacker_at = f"tls/127.0.0.1:{port}", f"tls/127.0.0.1:{port + 1}"
    heard: set[str] = set()
    alive: set[str] = set()
    overheard: set[str] = set()
    with ExitStack() as stack:
        victim = stack.enter_context(
            open_session(
                network, party("drone0"), [victim_at], [attacker_at] if dials == "victim" else []
            )
        )
        attacker_dials = victim_at if dials == "attacker" else ""
        attacker = stack.enter_context(
            hostile(network, name, attacker_at, attacker_dials, must_link=False)
        )
        friend = stack.enter_context(open_session(network, party("drone2"), [NOWHERE], [victim_at]))
        for session in (victim, attacker):
            until(lambda s=session: len(s.info.links()) >= 1, "a link")  # type: ignore[misc]
        until(lambda: len(victim.info.links()) == 2, "links to both")
        victim.declare_subscriber("dcpg/s/**", lambda s: heard.add(str(s.key_expr)))
        victim.liveliness().declare_subscriber(
            KEYS.alive(), lambda s: alive.add(str(s.key_expr)), history=True
        )
        attacker.declare_subscriber("**", lambda s: overheard.add(str(s.key_expr)))
        victim.declare_queryable(
            KEYS.state("drone0"), lambda q: q.reply(KEYS.state("drone0"), b"own")
        )
        own_params = attacker.declare_publisher(KEYS.params("drone1", "drone3"))
        friends = friend.declare_publisher(KEYS.params("drone2", "drone3"))
        until(lambda: matched(own_params) and matched(friends), "the victim's subscription")
        claims = ("drone0", "drone2", "drone3", OBSERVER, "mallory", "*", "**", "drone$*")
        kept = []
        for claim in claims:
            for key in (
                KEYS.params(claim, "drone3"),
                KEYS.telemetry(claim, "round"),
                KEYS.state(claim),
            ):
                attacker.put(key, b"forged")
                attacker.delete(key)
            kept.append(attacker.liveliness().declare_token(KEYS.alive(claim, "1")))
            for key in (KEYS.state(claim), KEYS.status(claim)):
                attacker.declare_queryable(key, lambda q: q.reply(KEYS.state("drone2"), b"forged"))
        attacker.declare_queryable(
            KEYS.state("drone1"),
            lambda q: (
                q.reply(KEYS.state("drone0"), b"forged"),
                q.reply(KEYS.state("drone1"), b""),
            ),
        )
        # After all that, on the same link, what is drone1's own; an observer owns nothing.
        mine = {KEYS.params("drone1", "drone3")} if name == "drone1" else set()
        own_params.put(b"own")
        kept.append(attacker.liveliness().declare_token(KEYS.alive("drone1", "1")))
        friends.put(b"own")
        kept.append(friend.liveliness().declare_token(KEYS.alive("drone2", "9")))
        expected = {KEYS.params("drone2", "drone3"), *mine}
        until(lambda: expected <= heard, f"{expected} in {heard}")
        own = {KEYS.alive("drone2", "9")} | ({KEYS.alive("drone1", "1")} if mine else set())
        until(lambda: own <= alive, f"{own} in {alive}")
        answers = {
            str(reply.ok.key_expr)
            for reply in victim.get(
                KEYS.state(), timeout=PATIENCE, consolidation=zenoh.ConsolidationMode.NONE
            )
            if reply.ok is not None
        }
        assert (heard, alive) == (expected, own)
        assert answers == {KEYS.state("drone0"), *({KEYS.state("drone1")} if mine else ())}
        # Observers and members hear what is said by its owner: the link is not simply dead.
        victim.put(KEYS.params("drone0", "drone3"), b"own")
        until(lambda: KEYS.params("drone0", "drone3") in overheard, "hearing drone0")
        asked = {str(r.ok.key_expr) for r in attacker.get(KEYS.state(), timeout=PATIENCE) if r.ok}
        assert KEYS.state("drone0") in asked


@pytest.mark.parametrize("who", ["plain", "foreign"])
def test_an_honest_agent_does_not_dial_into_a_trap(folders: tuple[Path, Path], who: str) -> None:
    """The victim dials an address at which somebody without a certificate of ours listens."""
    ours, foreign = folders
    network, port = Network(security=files(ours)), free_base_port(1)
    trap = Network() if who == "plain" else Network(security=files(foreign))
    listen = f"{'tcp' if who == 'plain' else 'tls'}/127.0.0.1:{port}"
    heard = threading.Event()
    with hostile(trap, "drone0", listen, "", must_link=False) as session:
        session.declare_subscriber("**", lambda s: heard.set())
        with (
            pytest.raises(zenoh.ZError),
            hostile(network, "drone1", NOWHERE, f"tls/127.0.0.1:{port}") as victim,
        ):
            victim.put(KEYS.params("drone1", "drone3"), b"secret")
        assert not session.info.links()
    assert not heard.is_set()


def test_passwords_keep_strangers_out(tmp_path: Path) -> None:
    port = free_base_port(1)
    ours, guessed = tmp_path / "users.txt", tmp_path / "guessed.txt"
    ours.write_text("drone0:one\ndrone1:two\n")
    guessed.write_text("drone0:one\ndrone1:guess\nmallory:x\n")
    endpoint = f"tcp/127.0.0.1:{port}"
    good, bad = (
        Network(security=Security(users=str(ours))),
        Network(security=Security(users=str(guessed))),
    )
    with open_session(good, party("drone0"), [endpoint], []) as listener:
        for network, name in ((bad, "drone1"), (bad, "mallory"), (Network(), "drone1")):
            with (
                pytest.raises(zenoh.ZError),
                hostile(network, name, "tcp/127.0.0.1:0", endpoint),
            ):
                pass
        with hostile(good, "drone1", "tcp/127.0.0.1:0", endpoint):
            until(lambda: len(listener.info.links()) == 1, "one link")


@pytest.mark.parametrize("spoiled", ["drone2.key", "observer.pem"])
def test_nothing_starts_with_a_file_missing(
    tmp_path: Path, folders: tuple[Path, Path], spoiled: str
) -> None:
    certificates = tmp_path / "certs"
    certificates.mkdir()
    for file in folders[0].iterdir():
        if file.name != spoiled:
            (certificates / file.name).write_bytes(file.read_bytes())
    folder = tmp_path / "run"
    code, output = run("up", GRIDWORLD_A, "--run", folder, *settings(certificates), cwd=tmp_path)
    assert code == 2
    (line,) = output.splitlines()
    assert f'"{certificates / spoiled}" does not exist' in line
    assert not folder.exists()
