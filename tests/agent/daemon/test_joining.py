"""What a newcomer takes from a swarm, and what it does not."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from agent.config.experiment import Task, load
from agent.daemon import joining
from agent.daemon.joining import Offer, check_task, fetch_config, serve_config
from swarm.errors import ConfigError
from swarm.wire.keys import Keys
from swarm.wire.security import Security
from swarm.wire.session import Network

FILE = Path(__file__).parents[3] / "deploy" / "library" / "swarms" / "gridworld-a.toml"


@pytest.mark.parametrize(
    "task",
    [
        Task("sim:GridWorld-v0", {"layout": "a", "task": 0}),
        Task("CartPole-v1"),
        Task("sim:IndoorFlight-v0", {"scene": "indoor-long", "body": "mavlink"}),
        Task("sim:IndoorFlight-v0", {"body_options": {"noise": [0.1, "low"]}}),
    ],
)
def test_tasks_of_this_project_and_of_gymnasium_are_taken(task: Task) -> None:
    check_task(task, "file")


@pytest.mark.parametrize(
    ("task", "named"),
    [
        (Task("os:Evil-v0"), "os:Evil-v0"),
        (Task("sim:GridWorld-v0", {"body": "os:abort"}), "os:abort"),
        (Task("sim:IndoorFlight-v0", {"scene": "/etc/passwd"}), "/etc/passwd"),
        (Task("CartPole-v1", {"a": {"b": ["../x"]}}), "../x"),
    ],
)
def test_other_modules_and_paths_are_not(task: Task, named: str) -> None:
    with pytest.raises(ConfigError, match="start with the swarm file itself") as told:
        check_task(task, "file")
    assert f'"{named}"' in str(told.value)


class Answer:
    """Of an agent, or a forger, as it comes out of ``session.get``."""

    def __init__(self, agent: str, body: bytes) -> None:
        self.ok = self
        self.key_expr = Keys("gridworld-a").config(agent)
        self.payload = zenoh.ZBytes(body)


class Session:
    """Gives the answers, and keeps what is declared."""

    def __init__(self, *answers: Answer) -> None:
        self._answers = answers
        self.answer: Any = None

    def get(self, key: str, **_: object) -> tuple[Answer, ...]:
        assert key == Keys("gridworld-a").config()
        return self._answers

    def declare_queryable(self, key: str, answer: object) -> None:
        self.answer = answer


class Query:
    """Keeps the reply."""

    body = b""

    def reply(self, key: str, body: bytes) -> None:
        assert key == Keys("gridworld-a").config("drone0")
        self.body = body


def offer(round_: int, settings: tuple[str, ...] = ()) -> bytes:
    """What an honest agent answers."""
    config = load(FILE, settings)
    security = Security(users="/secret/users")
    config = msgspec.structs.replace(config, network=Network(security=security))
    session, query = Session(), Query()
    serve_config(session, Keys("gridworld-a"), "drone0", config, lambda: round_)  # type: ignore[arg-type]
    session.answer(query)
    return query.body


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch) -> list[Answer]:
    """What the network will answer."""
    said: list[Answer] = []

    @contextmanager
    def opened(*_: object) -> Iterator[Session]:
        yield Session(*said)

    monkeypatch.setattr(joining, "open_session", opened)
    return said


def test_the_furthest_on_is_believed_and_secrets_stay(answers: list[Answer]) -> None:
    answers += [
        Answer("drone0", offer(3, ("rounds=3",))),
        Answer("drone2", offer(9, ("rounds=9",))),
        Answer("drone1", offer(99, ("rounds=99",))),  # itself, or who says so
        Answer("drone3", b"\xff"),
        Answer("drone3", b"x" * (joining.LONGEST + 1)),
    ]
    config = fetch_config("gridworld-a", "drone1", ["tcp/127.0.0.1:1"], ["optimizer.step=0.1"])
    assert config.rounds == 9
    assert config.optimizer.step == 0.1
    assert config.network.security == Security()
    assert b"secret" not in offer(1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"{", "swarm file of drone0 does not read"),
        (b"[]", "swarm file of drone0 holds no table"),
        (b'{"name": "gridworld-a"}', 'swarm file of drone0: key "agents" is missing'),
    ],
)
def test_a_bad_file_is_one_line(answers: list[Answer], text: bytes, words: str) -> None:
    answers.append(Answer("drone0", msgspec.msgpack.encode(Offer(1, text))))
    with pytest.raises(ConfigError, match=words):
        fetch_config("gridworld-a", "drone1", ["tcp/127.0.0.1:1"])


def test_the_file_of_another_swarm_is_not_taken(answers: list[Answer]) -> None:
    answers.append(Answer("drone0", offer(1, ("name=b",))))
    with pytest.raises(ConfigError, match='name = "b": expected "gridworld-a"'):
        fetch_config("gridworld-a", "drone1", ["tcp/127.0.0.1:1"])


def test_one_who_is_not_in_the_file_is_told(answers: list[Answer]) -> None:
    answers.append(Answer("drone0", offer(1)))
    with pytest.raises(ConfigError, match='has no agent "drone9"'):
        fetch_config("gridworld-a", "drone9", ["tcp/127.0.0.1:1"])


def test_with_certificates_the_file_is_needed() -> None:
    settings = [f"network.security.{key}=x" for key in ("ca", "certificate", "key")]
    with pytest.raises(ConfigError, match="expected the swarm file"):
        fetch_config("gridworld-a", "drone1", [], settings)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        (('network.security.users="/etc/passwd"',), "network.security"),
        (('network.listen="tcp/0.0.0.0:7447"',), 'network.listen = "tcp/0.0.0.0:7447"'),
        (('network.host="0.0.0.0"',), 'drone0 at "tcp/0.0.0.0:7450"'),
        (('agents.1.endpoint="tcp/[::]:7447"',), 'drone1 at "tcp/[::]:7447"'),
        (('agents.2.namespace="x"',), 'agent "drone2" on "x"'),
        (('modules=["/tmp"]',), 'modules in "/tmp"'),
    ],
)
def test_a_received_file_opens_nothing_here(
    answers: list[Answer], settings: tuple[str, ...], named: str
) -> None:
    text = msgspec.json.encode(load(FILE, settings))
    answers.append(Answer("drone0", msgspec.msgpack.encode(Offer(1, text))))
    with pytest.raises(ConfigError, match="expected") as told:
        fetch_config("gridworld-a", "drone1", ["tcp/127.0.0.1:1"])
    assert named in str(told.value)


def test_a_stranger_hands_out_no_file_and_the_many_are_believed(answers: list[Answer]) -> None:
    answers.append(Answer("mallory", offer(10**9)))
    with pytest.raises(ConfigError, match='"mallory" is none of its agents'):
        fetch_config("gridworld-a", "drone1", ["tcp/127.0.0.1:1"])
    answers += [
        Answer("drone0", offer(3, ("rounds=5",))),
        Answer("drone2", offer(4, ("rounds=5",))),
    ]
    assert fetch_config("gridworld-a", "drone1", ["tcp/127.0.0.1:1"]).rounds == 5
