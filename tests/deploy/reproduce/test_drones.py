"""The drone table: which runs there are, and what is claimed of their flights."""

import re
from pathlib import Path

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace
from rich.console import Console

from agent.learning.pilot import Pilot
from agent.storage.checkpoint import Checkpoint, write
from deploy.policies.evaluation import Cell, Evaluation
from deploy.reproduce.claims import Findings, Options, publish
from deploy.reproduce.drones import table
from deploy.reproduce.drones.record import read
from deploy.reproduce.drones.runs import ESTIMATORS, Run, last, plan, steps_per_round
from deploy.reproduce.drones.training import train
from sim.indoor.content.scenes import NAMES
from swarm.errors import ConfigError, SwarmError
from swarm.reports.telemetry import RoundReport

RESULTS = Path(__file__).parents[3] / "deploy" / "docs" / "results"
POLICIES = Path(__file__).parents[3] / "deploy" / "library" / "policies"


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_all_runs_of_an_estimator_have_the_same_settings(tmp_path: Path, estimator: str) -> None:
    whole, *alone = plan(tmp_path, estimator, budget=150_000, seed=1)
    assert [run.name for run in alone] == ["sa-0", "sa-1", "sa-2", "sa-3"]
    assert {run.config.optimizer.step * len(alone) for run in alone} == {
        whole.config.optimizer.step
    }
    for i, run in enumerate(alone):
        assert run.config.agents == (whole.config.agents[i],)
        same = msgspec.structs.replace(
            run.config,
            name=whole.config.name,
            agents=whole.config.agents,
            optimizer=whole.config.optimizer,
        )
        assert same == whole.config
    steps = whole.config.rounds * steps_per_round(whole.config)
    assert 150_000 <= steps < 150_000 + steps_per_round(whole.config)


def report(agent: str, round_: int, steps: int, distance: float) -> bytes:
    fields = RoundReport(
        agent=agent, round=round_, time=0.0, seconds=2.0, waited=0.0, value=1.0, episodes=3,
        steps=steps, gradient_norm=1.0, disagreement=0.0, weights={}, distance=distance,
    )  # fmt: skip
    return msgspec.json.encode(fields) + b"\n"


def learn(run: Run, rounds: int | None = None) -> None:
    """A run that has been trained so far: its configuration and checkpoints."""
    for agent in run.config.members:
        run.folder.prepare(agent)
        write(
            run.folder.checkpoints(agent), Checkpoint(rounds or run.config.rounds, "", np.zeros(1))
        )
    run.folder.config.write_bytes(msgspec.json.encode(run.config))


def pretend(run: Run, metres: dict[str, float]) -> None:
    """A run that has been trained and flown: its files."""
    learn(run)
    for agent in run.config.members:
        lines = [report(agent, k, 1024 * (k + 1), 10.0 + k) for k in range(run.config.rounds)]
        run.folder.metrics(agent).write_bytes(b"".join(lines))
    cells = {
        world: [Cell("greedy", 100, mean, 1.0, 0.0), Cell("stochastic", 100, mean, 1.0, 0.0)]
        for world, mean in metres.items()
    }
    evaluation = Evaluation(str(run.folder.path), None, "m", 0, cells)
    run.folder.evaluation.write_bytes(msgspec.json.encode(evaluation))


def fill(root: Path, seed: int, swarm: float, estimator: str = "ppo") -> None:
    """All runs of a seed: the swarm flies so far everywhere, agents alone 80 m at home, else 5."""
    for run in plan(root, estimator, budget=4 * 1024, seed=seed):
        home = int(run.name[-1]) if run.name.startswith("sa") else None
        metres = {
            world: swarm if home is None else (80.0 if i == home else 5.0)
            for i, world in enumerate(NAMES)
        }
        pretend(run, metres)
        assert run.finished


@pytest.mark.parametrize(("swarm", "good"), [(90.0, True), (30.0, False)])
def test_claims_follow_from_the_flights(tmp_path: Path, swarm: float, good: bool) -> None:
    root = tmp_path / "runs"
    fill(root, 1, swarm)
    options = Options(tmp_path / "out", 1, False, lambda *far: None)
    options.out.mkdir()
    told: list[str] = []
    found = table.study(options, ["ppo"], 4 * 1024, root=root, tell=told.append)
    claims = {claim.what: claim for claim in found.claims}
    ratio = claims["ppo, greedy: DCPG's sum / best SA's"]
    assert ratio.ours == f"{4 * swarm / 95.0:.3f}"
    assert ratio.paper == "2.8"
    assert ratio.holds == good
    cells = claims["stochastic: cells where DCPG >= 0.9 of SA-i in world i"]
    assert cells.ours.startswith("4 of 4" if good else "0 of 4")
    assert cells.holds == good
    assert len(told) == 5
    assert found.data["ppo"]["runs"][0]["policy"] == "dcpg"
    assert found.data["ppo"]["runs"][0]["steps"] == 4 * 4 * 1024
    assert found.figures[0].stat().st_size > 1000


def test_claims_are_about_the_mean_of_all_seeds(tmp_path: Path) -> None:
    root = tmp_path / "runs"
    fill(root, 1, 90.0)
    fill(root, 2, 30.0)
    options = Options(tmp_path / "out", 2, False, lambda *far: None)
    options.out.mkdir()
    found = table.study(options, ["ppo"], 4 * 1024, root=root, tell=lambda text: None)
    claims = {claim.what: claim for claim in found.claims}
    ratio = claims["ppo, greedy: DCPG's sum / best SA's"]
    assert ratio.ours == f"{4 * 60 / 95:.3f} ({4 * 90 / 95:.2f}, {4 * 30 / 95:.2f})"
    unseen = claims["ppo, greedy: unseen indoor-techno, DCPG / best SA"]
    assert unseen.ours == "12.000 (18.00, 6.00)"
    assert claims["greedy: cells where DCPG >= 0.9 of SA-i in world i"].ours.startswith("0 of 4")
    assert [(run["policy"], run["seed"]) for run in found.data["ppo"]["runs"]] == [
        (name, seed) for seed in (1, 2) for name in ("dcpg", "sa-0", "sa-1", "sa-2", "sa-3")
    ]
    assert "mean of 2 seeds" in found.title


def publish_to(out: Path, root: Path, estimators: list[str], beside: Path | None) -> None:
    """What the command does with flown runs and a file."""
    kept = read(beside / "drones.json") if beside else {}

    def study(options: Options) -> Findings:
        return table.study(
            options, estimators, 4 * 1024, root=root, tell=lambda text: None, beside=kept
        )

    options = Options(out, 1, False, lambda *far: None)
    publish("drones", study, options, False, Console(quiet=True))


def test_estimators_measured_elsewhere_stand_in_the_same_table(tmp_path: Path) -> None:
    root, whole, first, both, again = (tmp_path / name for name in "rwfba")
    fill(root, 1, 90.0, "ppo")
    fill(root, 1, 60.0, "a2c")
    publish_to(whole, root, ["a2c", "ppo"], None)
    publish_to(first, root, ["ppo"], None)
    publish_to(both, root, ["a2c"], first)
    publish_to(again, tmp_path / "empty", [], both)
    expected = read(whole / "drones.json")
    for out in both, again:
        assert read(out / "drones.json") == expected
        assert (out / "fig3.png").read_bytes() == (whole / "fig3.png").read_bytes()
        pages = [(o / "drones.md").read_text().rpartition("seeds 1")[0] for o in (out, whole)]
        assert pages[0] == pages[1]
        assert "a2c, greedy: SA-0" in pages[0]


@pytest.mark.parametrize(
    ("budget", "seeds", "flights", "text"),
    [
        (8, 1, 100, "--beside, ppo: dcpg has 4 rounds: expected 8, of --budget"),
        (4, 2, 100, "--beside, ppo: seeds [1]: expected [1, 2], of --seeds"),
        (4, 1, 101, "--beside, ppo: dcpg has 100 flights: expected 101, of --flights"),
    ],
)
def test_what_was_measured_otherwise_is_refused(
    tmp_path: Path, budget: int, seeds: int, flights: int, text: str
) -> None:
    fill(tmp_path, 1, 90.0, "ppo")
    publish_to(tmp_path / "out", tmp_path, ["ppo"], None)
    options = Options(tmp_path / "out", seeds, False, lambda *far: None)
    kept = read(tmp_path / "out" / "drones.json")
    with pytest.raises(ConfigError, match=re.escape(text)):
        table.study(options, [], budget * 1024, flights, root=tmp_path, beside=kept)


def test_an_incomplete_record_is_refused_before_anything_is_trained(tmp_path: Path) -> None:
    fill(tmp_path, 1, 90.0, "ppo")
    publish_to(tmp_path / "out", tmp_path, ["ppo"], None)
    options = Options(tmp_path / "out", 1, False, lambda *far: None)
    whole = read(tmp_path / "out" / "drones.json")["ppo"]
    swarm, *alone = whole.runs
    grounded = {**swarm.flights, "indoor-techno": swarm.flights["indoor-techno"][:1]}
    for runs, text in [
        ([*alone, swarm], "the first run is sa-0"),
        ([swarm, *alone[:3]], "no run sa-3"),
        ([replace(swarm, curves={}), *alone], "dcpg has curves of []"),
        ([replace(swarm, flights=grounded), *alone], "no stochastic flights in indoor-techno"),
    ]:
        kept = {"ppo": replace(whole, runs=runs)}
        with pytest.raises(ConfigError, match=re.escape(text)):
            table.study(options, [], 4 * 1024, root=tmp_path, beside=kept)


def test_the_kept_table_is_read_again(tmp_path: Path) -> None:
    kept = read(RESULTS / "drones.json")
    assert tuple(kept) == ESTIMATORS
    findings = table.study(Options(tmp_path, 1, False, lambda *far: None), [], beside=kept)
    page = (RESULTS / "drones.md").read_text()
    assert all(claim.ours in page for claim in findings.claims)
    bad = tmp_path / "bad.json"
    with pytest.raises(ConfigError, match="No such file"):
        read(bad)
    bad.write_text('{"made": 1}')
    with pytest.raises(ConfigError, match=r"bad\.json: Expected `object`"):
        read(bad)


def test_kept_policies_choose_by_what_they_see() -> None:
    files = [POLICIES / f"drones-{name}.safetensors" for name in ESTIMATORS]
    noise = np.random.default_rng(0).integers(256, size=(8, 103, 103, 3), dtype=np.uint8)
    for file in files:
        assert file.stat().st_size < 6e6
        pilot = Pilot.load(file)
        actions = pilot.actions(noise, greedy=True)
        assert ((actions >= 0) & (actions < pilot.form.actions)).all()
        assert pilot.form.actions == 25
        assert pilot.flat.choose(noise, None).log_probs.std() > 0


@pytest.mark.parametrize("budget", [5, 40])
def test_a_run_whose_step_has_fallen_is_not_taken_for_another_budget(
    tmp_path: Path, budget: int
) -> None:
    learn(plan(tmp_path, "ppo", budget=10 * 1024, seed=1)[1], rounds=8)
    asked = plan(tmp_path, "ppo", budget * 1024, seed=1)[1]
    with pytest.raises(SwarmError) as error:
        train([asked], 1, lambda *far: None)
    text = str(error.value)
    assert text.startswith(str(asked.folder.path))
    assert "begun for 10 rounds" in text
    assert "--budget 10240" in text


def test_the_last_report_is_found_without_reading_all(tmp_path: Path) -> None:
    run = plan(tmp_path, "ppo", budget=1024, seed=1)[1]
    agent = run.config.members[0]
    assert last(run.folder, agent) is None
    run.folder.prepare(agent)
    run.folder.metrics(agent).write_bytes(report(agent, 0, 7, 1.0) + b'{"agent": "tor')
    found = last(run.folder, agent)
    assert found is not None
    assert found.steps == 7
    assert not run.finished
