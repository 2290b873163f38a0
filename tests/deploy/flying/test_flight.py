"""``swarm fly``: what is refused before anything flies, and how a flight ends."""

import sys
from pathlib import Path

import numpy as np
import pytest

from deploy.cli import main as cli
from deploy.flying import flight
from deploy.viewer.film import turned
from sim.indoor.flight.env import IndoorFlight, Observation
from sim.indoor.render.camera import rays
from tests.notices import without_notices

SCENE = "indoor-long"
NOWHERE = "udpin:127.0.0.1:21999"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["runs/nothing"], "RUN needs --vehicle and no --pilot"),
        (["runs/nothing", "--pilot", "greedy"], "RUN needs --vehicle and no --pilot"),
        (["runs/nothing", "--vehicle", NOWHERE], '"runs/nothing" is not a run folder'),
        (["--vehicle", "smoke:1", "--scene", SCENE], "expected udpin:HOST:PORT"),
        (["--vehicle", NOWHERE, "--scene", "nowhere"], "nowhere"),
        (["--vehicle", NOWHERE, "--scene", SCENE, "--start", "77"], "start 77 of indoor-long"),
        (["--vehicle", NOWHERE, "--scene", SCENE, "--fence", "0"], "limit fence = 0.0"),
        (["--vehicle", NOWHERE, "--scene", SCENE, "--speed", "9"], "speed 9 m/s"),
        (["--vehicle", NOWHERE, "--scene", SCENE, "--pilot", "ace"], "no pilot 'ace'"),
        (["--vehicle", NOWHERE, "--scene", "a", "--scene", "b"], "expected one --scene"),
        (["--scene", "nowhere"], "nowhere"),
        (["--scene", SCENE, "--scene", "nowhere"], "nowhere"),
        (["--scene", SCENE, "--scene", "nothing.glb"], "nothing.glb"),
        (["--scene", SCENE, "--pilot", "ace"], "no pilot 'ace'"),
    ],
)
def test_a_mistake_is_one_line(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Told before anything is baked: the cache of a machine that has never flown stays empty."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(sys, "argv", ["swarm", "fly", *arguments])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code in {2, 5}
    (mistake,) = without_notices(capsys.readouterr().err).splitlines()
    assert mistake.startswith("swarm: ") and words in mistake
    assert not [path for path in tmp_path.rglob("*") if path.is_file()]


def test_recordings_lie_beside_what_flew(tmp_path: Path) -> None:
    assert flight.folder_of(tmp_path).parent == tmp_path / "flights"
    assert flight.folder_of(tmp_path / "policy.safetensors").parent == Path("runs")
    assert flight.folder_of(None).name.startswith("flight-")


def test_a_policy_is_rehearsed_on_the_ground() -> None:
    seen = []

    def decide(world: IndoorFlight, picture: Observation, fresh: bool) -> int:
        seen.append((picture.shape, fresh))
        return 12

    flight.rehearse(SCENE, decide)
    assert seen == [((103, 103, 3), True), ((103, 103, 3), False)]


def test_the_film_turns_the_drone_as_the_camera_does() -> None:
    roll, pitch, yaw = 0.1, -0.2, 2.5
    x, y, z, w = turned(roll, pitch, yaw)
    forward = np.array(
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
    )  # of the quaternion
    pose = np.array([0.0, 0.0, 0.0, roll, pitch, yaw])
    middle = rays(pose, 1, 1, (1.0, 1.0))[:, 2]  # of the only pixel
    assert forward == pytest.approx(middle)
