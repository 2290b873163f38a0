import json
import math
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from deploy.cli import main as cli
from deploy.cli import reproduce
from deploy.reproduce import examples, theorem2
from deploy.reproduce.claims import (
    Claim,
    Findings,
    Options,
    at_most,
    bounded,
    close,
    markdown,
    noted,
)
from deploy.simulate import simulate
from sim.tabular.chain import S3
from swarm.errors import SwarmError

ROOT = Path(__file__).parents[3]
GAMMAS = (0.3, math.sqrt(0.5), 0.9, 0.99)


@pytest.mark.parametrize("gamma", GAMMAS)
def test_example_1(gamma: float) -> None:
    models = examples.both(modified=False, gamma=gamma)
    best = examples.maximise(lambda x: examples.value(models, x, (1.0, 0.0)))
    assert best == pytest.approx(0.5, abs=1e-6)
    assert examples.value(models, 0.5, (1.0, 0.0)) == pytest.approx(
        2 * gamma / (2 - gamma**2), abs=1e-9
    )
    for pure in (0.0, 1.0):
        assert examples.value(models, pure, (1.0, 0.0)) == pytest.approx(gamma, abs=1e-9)


@pytest.mark.parametrize("p", [0.51, 0.75, 1.0])
@pytest.mark.parametrize("gamma", GAMMAS)
def test_example_2(gamma: float, p: float) -> None:
    models = examples.both(modified=True, p=p, gamma=gamma)
    for pure in (0.0, 1.0):
        found = examples.value(models, pure)
        assert found == pytest.approx(examples.pure_value(p, gamma), abs=1e-9)
    assert examples.value(models, 0.5) == pytest.approx(examples.even_value(p, gamma), abs=1e-9)
    assert examples.slope(models, 0.5) == pytest.approx(0, abs=1e-9)
    xs = np.linspace(0, 1, 11)
    slopes = np.array([examples.slope(models, x) for x in xs])
    assert (slopes[:5] < 0).all()
    assert (slopes[6:] > 0).all()
    middle = (examples.value(models, 0.3 + 1e-6) - examples.value(models, 0.3 - 1e-6)) / 2e-6
    assert examples.slope(models, 0.3) == pytest.approx(middle, abs=1e-6)


@pytest.mark.parametrize("p", [0.6, 0.75, 0.9])
def test_corrected_numbers_of_the_appendix(p: float) -> None:
    gamma = math.sqrt(0.5)
    pure = math.sqrt(2) * (2 * p - 1) / ((p - 2) * (p + 1))
    assert examples.pure_value(p, gamma) == pytest.approx(pure, abs=1e-12)
    even = 2 * math.sqrt(2) * (1 - 2 * p) / 3
    assert examples.even_value(p, gamma) == pytest.approx(even, abs=1e-12)


@pytest.mark.parametrize("tilt", [-0.2, 0.05, 0.2])
def test_the_trap_of_theorem_2_attracts_from_both_sides(tilt: float) -> None:
    step = theorem2.BEYOND * examples.critical_step(0.75, theorem2.GAMMA)
    config = examples.trap_swarm("dcpg", step, 300, 0.75, theorem2.GAMMA)
    start = np.zeros((2, 10))
    start[:, 2 * S3] = tilt
    theta = simulate(config, initial=start).thetas.mean(axis=0)
    assert theta[2 * S3] - theta[2 * S3 + 1] == pytest.approx(0, abs=1e-6)


def test_the_chain_of_theorem_2_is_judged_by_derivatives() -> None:
    claims = theorem2.chain()
    assert all(claim.holds for claim in claims)
    assert len(claims) == 3


def test_a_short_study_does_not_claim_what_it_does_not_keep() -> None:
    claim = noted(bounded("x", 1.0, high=0.5))
    assert (claim.mark, claim.holds, claim.ours) == ("", True, "1.000")


def test_claims_judge() -> None:
    assert close("x", 1.0, 2.0, 2.0 + 1e-10, 1e-9).holds
    assert not close("x", 2.0, 1.0, 2.0, 1e-9).holds
    assert bounded("x", 0.5, 0.4, 0.6).holds
    assert not bounded("x", 0.5, low=0.6).holds
    assert not bounded("x", 0.5, high=0.4).holds
    assert bounded("x", 0.5).holds
    assert at_most("x", 1e-3, 1.0).holds
    assert not at_most("x", float("nan"), 1.0).holds


def test_a_line_that_requires_nothing_has_no_mark() -> None:
    assert Claim("what", "1", "", "2", holds=True).mark == ""
    assert Claim("what", "1", "2", "2", holds=True).mark == "✔"
    assert Claim("what", "1", "2", "3", holds=False).mark == "✘"


def test_markdown_has_a_line_for_each_claim() -> None:
    claim = Claim("what | where", "1", "2", "2", holds=True)
    page = markdown(Findings("Title", [claim], ["note"], {}, [Path("a/b.png")]), {"seeds": 1})
    assert "| what \\| where | 1 | 2 | 2 | ✔ |" in page
    assert "![b](b.png)" in page


def test_a_study_from_the_command_line(tmp_path: Path) -> None:
    arguments = ["reproduce", "examples", "--quick", "--out", str(tmp_path)]
    done = CliRunner().invoke(cli.app, arguments)
    assert done.exit_code == 0, done.output
    written = tmp_path / "examples"
    assert sorted(file.name for file in written.iterdir()) == [
        "examples.json", "examples.md", "examples.png",
    ]  # fmt: skip
    record = json.loads((written / "examples.json").read_text())
    assert all(claim["holds"] for claim in record["claims"])
    assert {"seeds", "commit", "machine", "seconds"} <= record["made"].keys()


def test_a_claim_that_does_not_hold_is_exit_code_1(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def wrong(options: Options) -> Findings:
        return Findings("Wrong", [bounded("x", 1.0, high=0.5)], [], {}, [])

    monkeypatch.setattr(examples, "study", wrong)
    arguments = ["reproduce", "examples", "--json", "--out", str(tmp_path)]
    done = CliRunner().invoke(cli.app, arguments)
    assert done.exit_code == 1
    assert json.loads(done.stdout)["claims"][0]["holds"] is False


def test_without_matplotlib_one_line_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reproduce, "find_spec", lambda name: None)
    with pytest.raises(SwarmError, match='pip install "matplotlib>='):
        reproduce.run_studies(["examples"], 1, True, tmp_path, False)


def test_every_study_has_kept_its_results() -> None:
    for name in (*reproduce.STUDIES, "network"):
        record = json.loads((ROOT / "deploy" / "docs" / "results" / f"{name}.json").read_text())
        assert all(claim["holds"] for claim in record["claims"]), name
        assert not record["made"]["quick"]
    assert (ROOT / "deploy" / "docs" / "results" / "fig2.png").stat().st_size < 300_000
