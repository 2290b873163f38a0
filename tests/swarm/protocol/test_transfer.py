"""What a joiner believes."""

from swarm.protocol.messages import ParameterHeader
from swarm.protocol.transfer import Answer, choose

LIVES = {"a": "1", "b": "2", "c": "3"}


def answer(agent: str, round_: int, **changes: object) -> Answer:
    fields: dict[str, object] = {
        "version": 4, "fingerprint": "", "agent": agent, "incarnation": LIVES.get(agent, "9"),
        "round": round_, "run": "r", "neighbours": {}, "norm": 1.0,
    }  # fmt: skip
    return Answer(ParameterHeader(**(fields | changes)), agent)  # type: ignore[arg-type]


def chosen(*answers: Answer, run: str | None = None, reached: float = 0) -> object:
    found = choose(answers, LIVES, run, reached)
    return found.vector if found else None


def test_the_furthest_whom_another_confirms() -> None:
    assert chosen(answer("a", 100), answer("b", 101)) == "b"
    assert chosen(answer("a", 100), answer("b", 500_000), answer("c", 99)) == "a"
    assert chosen(answer("a", 100), answer("b", 500_000)) == "a"
    assert chosen(answer("a", 100), answer("b", 101), reached=101) is None


def test_strangers_former_lives_other_runs_and_wild_norms_are_not_believed() -> None:
    honest = answer("a", 100)
    assert chosen(honest, answer("mallory", 500_000), answer("mallory", 500_001)) == "a"
    assert chosen(honest, answer("b", 120, incarnation="0"), answer("c", 101)) == "c"
    assert chosen(honest, answer("b", 120, run="s"), answer("c", 101)) == "c"
    assert chosen(honest, answer("b", 120, norm=1e6), answer("c", 101)) == "c"
    assert chosen(honest, answer("b", 101), run="s") is None


def test_the_only_one_here_is_believed() -> None:
    assert choose([answer("a", 100)], {"a": "1"}, None, 0) is not None
    assert chosen(answer("a", 100)) == "a"  # the others do not answer
