"""What a session draws, seen in pictures of its views: nothing is empty, everything has its colour.

Rerun's viewer without a window paints on the processor (Debian: mesa-vulkan-drivers).
"""

import io
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rerun as rr
from numpy.typing import NDArray
from PIL import Image
from rerun.experimental import ViewerClient

from agent.config.experiment import AgentEntry, SwarmFile, Task
from agent.daemon.pictures import png_of_depth, png_of_rgb
from agent.learning.estimators import Exact
from deploy.viewer import Output, colours, outputs
from deploy.viewer.moments import Moment
from deploy.viewer.outputs import opened
from deploy.viewer.trails import POINTS, Trail
from swarm.reports.telemetry import FlightSample, RoundReport
from tests.integration.harness import GRIDWORLD_A, swarm, until

DRIVERS = Path("/usr/share/vulkan/icd.d")
RED, BLUE = (200, 0, 0), (0, 0, 200)
SWARM = SwarmFile(
    name="drawn",
    estimator=Exact(),
    agents=(
        AgentEntry("flies", Task("sim:IndoorFlight-v0", {"scene": "indoor-pyramid"})),
        AgentEntry("walks", Task("sim:GridWorld-v0", {"layout": "a", "task": 0})),
    ),
)
PLOTS = ("Mean length of flights [m]", "Return", "Distance between neighbours")

Picture = NDArray[np.uint8]


def moment(round_: int) -> Moment:
    """Both agents, coming closer to each other."""
    return Moment.of(
        RoundReport(
            agent=agent, round=round_, time=1e9 + round_, seconds=0.1, waited=0.0,
            value=0.1 * round_, episodes=1, steps=9, gradient_norm=1.0, disagreement=0.5,
            weights={other: 0.5}, sketch=(place / (1.0 + round_),), route=(0, 1, 11),
            distance=2.0 * round_,
        )
        for place, (agent, other) in enumerate((("flies", "walks"), ("walks", "flies")))
    )  # fmt: skip


def sample(step: int) -> FlightSample:
    """On the way north-east through the pyramid; its camera sees red above blue."""
    view = np.zeros((40, 40, 3), np.uint8)
    view[:20], view[20:] = RED, BLUE
    depth = np.linspace(0.5, 9.0, 1600, dtype=np.float32).reshape(40, 40)
    return FlightSample(
        agent="flies", round=9, time=1e9 + 9 + step / 4, flight=0, step=step,
        position=(8.0 + 0.4 * step, 4.0 + 0.4 * step, -1.5), yaw=0.8, action=step % 25, reward=0.5,
        distance=0.4 * step, camera=png_of_rgb(view), depth=png_of_depth(depth),
    )  # fmt: skip


def share(picture: Picture, colour: colours.Colour, tolerance: int = 40) -> float:
    """Share of the pixels that have about this colour."""
    near = np.abs(picture.astype(int) - np.array(colour)).max(axis=2) <= tolerance
    return float(near.mean())


@pytest.fixture(scope="module")
def graphics() -> None:
    """What a viewer without a window paints with."""
    if not DRIVERS.is_dir():
        if os.environ.get("CI") == "true":
            pytest.fail(outputs.NO_GRAPHICS)
        pytest.skip(outputs.NO_GRAPHICS)


@pytest.fixture(scope="module")
def drawn(graphics: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Picture]]:
    """A picture of every view by its name, and of the whole window under the name ""."""
    pictures: dict[str, Picture] = {}
    complaints: list[object] = []

    def photograph(viewer: ViewerClient, path: Path) -> None:
        take(viewer, path)
        for view in viewer.get_state().views:
            complaints.extend(view.reports)
            image = Image.open(io.BytesIO(viewer.take_screenshot(view.view_id)))
            pictures[view.name or ""] = np.asarray(image.convert("RGB"))

    path, take = tmp_path_factory.mktemp("drawn") / "out.png", outputs._photograph
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(outputs, "_photograph", photograph)
        rr.set_strict_mode(True)
        with opened(SWARM, Output(headless=True, screenshot=path)) as recorder:
            recorder.take([moment(k) for k in range(10)], [sample(k) for k in range(20)])
        rr.set_strict_mode(False)
    assert complaints == []
    pictures[""] = np.asarray(Image.open(path).convert("RGB"))
    yield pictures


def test_every_view_is_there_and_none_is_empty(drawn: dict[str, Picture]) -> None:
    wanted = {"flies", "walks", "flies camera", "flies depth", "Who mixes with whom", "Events",
              "Actions", "Rewards", "Consensus error, its decay and bound", *PLOTS}  # fmt: skip
    assert wanted <= drawn.keys()
    for name in wanted:
        _, counts = np.unique(drawn[name].reshape(-1, 3), axis=0, return_counts=True)
        assert counts.max() < 0.999 * counts.sum(), f"view {name} is empty"
    assert drawn[""].shape[0] > 500


def test_a_room_shows_its_walls_and_the_path_in_its_drones_colour(
    drawn: dict[str, Picture],
) -> None:
    room = drawn["flies"]
    assert share(room, colours.FIRST[0]) > 0.0005
    assert (room.max(axis=2) > 60).mean() > 0.1


def test_a_grid_world_shows_goal_obstacles_and_path(drawn: dict[str, Picture]) -> None:
    cells = drawn["walks"]
    for colour in (colours.GOAL, colours.TROUBLE, colours.FIRST[1]):
        assert share(cells, colour) > 0.001


def test_the_camera_shows_what_the_drone_sees(drawn: dict[str, Picture]) -> None:
    seen = drawn["flies camera"]
    assert share(seen, RED) > 0.05
    assert share(seen, BLUE) > 0.05
    upper, lower = np.array_split(seen, 2)
    assert share(upper, RED) > share(lower, RED)


def test_plots_have_a_line_of_each_agent(drawn: dict[str, Picture]) -> None:
    for name in PLOTS[:2]:
        for place in range(2):
            assert share(drawn[name], colours.FIRST[place]) > 0.0002, name
    theory = drawn["Consensus error, its decay and bound"]
    assert share(theory, colours.TROUBLE) > 0.0002


def descendants(pid: int) -> set[int]:
    """Processes that this one has started, and those that they have."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        listed = [(task / "children").read_text(encoding="ascii") for task in tasks]
    except OSError:
        return set()
    children = {int(child) for line in listed for child in line.split()}
    return children.union(*(descendants(child) for child in children))


def is_running(pid: int) -> bool:
    """Whether a process runs, and is not merely to be buried."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] not in {"Z", "X"}


@pytest.mark.integration
def test_a_session_that_is_killed_leaves_no_viewer(graphics: None, tmp_path: Path) -> None:
    arguments = ("view", GRIDWORLD_A, "--headless", "--screenshot", tmp_path / "never.png",
                 "--seconds", "600", "--live")  # fmt: skip
    with swarm(*arguments, cwd=tmp_path) as session:
        session.says("watching swarm", 150.0)
        started = descendants(session.process.pid)
        assert any(b"headless" in Path(f"/proc/{pid}/cmdline").read_bytes() for pid in started)
        session.process.send_signal(signal.SIGKILL)
        session.wait()
        until(lambda: not any(map(is_running, started)), f"end of {started}")


def test_a_long_path_is_thinned_and_keeps_its_ends() -> None:
    trail = Trail()
    for step in range(5 * POINTS):
        (path,) = trail.take(sample(step))
        assert len(path) <= POINTS
    assert path[0] == pytest.approx([8.0, 4.0, -1.5])
    assert path[-1] == pytest.approx([8 + 0.4 * step, 4 + 0.4 * step, -1.5], rel=1e-6)
