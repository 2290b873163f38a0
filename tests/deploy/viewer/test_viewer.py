"""The viewer: pure moments and rows, and recordings read back with Rerun's own reader."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from agent.config.experiment import AgentEntry, SwarmFile, Task
from agent.learning.estimators import Exact
from agent.storage.runfolder import RunFolder
from deploy.viewer import colours, record_run
from deploy.viewer.drawing import Scene
from deploy.viewer.moments import (
    Event,
    Links,
    Moment,
    errors,
    events,
    history,
    links,
    remembered,
    thin,
)
from deploy.viewer.network import drawn
from deploy.viewer.recorder import Recorder
from deploy.viewer.tasks import FREE, GOAL, OBSTACLE, START, CellWorld, world_of
from swarm.mixing.weights import Topology
from swarm.reports.telemetry import RoundReport
from tests.deploy.observe.crowds import crowd

GRID = Task("sim:GridWorld-v0", {"layout": "a", "task": 0})
RING = SwarmFile(
    name="test",
    rounds=100,
    estimator=Exact(),
    agents=tuple(AgentEntry(f"drone{i}", GRID) for i in range(4)),
)
ROUTE = (0, 1, 11)


@pytest.fixture(autouse=True)
def _strict() -> Iterator[None]:
    """Let Rerun raise what it would only warn of."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def report(agent: int, round_: int, **changes: object) -> RoundReport:
    """What drone ``agent`` of the ring says when nothing is wrong."""
    whole = RoundReport(
        agent=f"drone{agent}",
        round=round_,
        time=1000.0 + round_,
        seconds=0.01,
        waited=0.0,
        value=agent + round_ / 100,
        episodes=10,
        steps=100,
        gradient_norm=1.0,
        disagreement=0.5,
        weights={f"drone{(agent - 1) % 4}": 0.25, f"drone{(agent + 1) % 4}": 0.25},
    )
    return msgspec.structs.replace(whole, **changes)


def ring(round_: int, *agents: int, **changes: object) -> Moment:
    """A round of these agents, by default of all four."""
    return Moment.of(report(a, round_, **changes) for a in agents or range(4))


def folder_of(moments: list[Moment], path: Path, config: SwarmFile = RING) -> RunFolder:
    """A run folder that holds these rounds."""
    folder = RunFolder(path)
    folder.write_config(config)
    for agent in config.members:
        folder.prepare(agent)
        reports = [m.reports[agent] for m in moments if agent in m.reports]
        folder.metrics(agent).write_bytes(b"\n".join(map(msgspec.json.encode, reports)) + b"\n")
    return folder


def columns(path: Path, entity: str, component: str) -> tuple[list[int], list[Any]]:
    """Rounds and values of a component, in the recording's order; times must be there too."""
    rounds: list[int] = []
    values: list[Any] = []
    for chunk in RrdReader(path).stream():
        batch = None if chunk.is_static else chunk.to_record_batch()
        if chunk.entity_path == entity and batch is not None:
            assert set(chunk.timeline_names) == {"round", "time"}
            rounds += batch.column("round").to_pylist()
            values += batch.column(component).to_pylist()
    return rounds, values


def scalars(path: Path, entity: str) -> tuple[list[int], list[float]]:
    """Rounds and values of a time series."""
    rounds, values = columns(path, entity, "Scalars:scalars")
    return rounds, [value for (value,) in values]


# -- moments ---------------------------------------------------------------------------------------


def test_a_whole_ring_uses_its_edges_and_misses_none() -> None:
    used = (("drone0", "drone1"), ("drone0", "drone3"), ("drone1", "drone2"), ("drone2", "drone3"))
    assert links(RING, ring(0)) == Links(used, ())


def test_an_edge_is_missing_when_one_end_went_without_or_is_not_here() -> None:
    lossy = report(0, 5, weights={"drone3": 0.25}, missing=("drone1",))
    found = links(RING, Moment.of([lossy, *ring(5, 1, 2, 3).reports.values()]))
    assert found.missing == (("drone0", "drone1"),)
    assert ("drone0", "drone1") not in found.used  # though drone1 did mix drone0's

    gap = [
        report(0, 6),
        report(1, 6, weights={"drone0": 0.25, "drone3": 0.25}),
        report(3, 6, weights={"drone0": 0.25, "drone1": 0.25}),
    ]
    closed = links(RING, Moment.of(gap))
    assert closed.missing == (("drone1", "drone2"), ("drone2", "drone3"))
    assert closed.used == (("drone0", "drone1"), ("drone0", "drone3"), ("drone1", "drone3"))


def test_strangers_are_not_drawn() -> None:
    assert links(RING, ring(0, weights={"stranger": 0.5}, missing=("another",))) == Links()


def test_consensus_error_by_hand_and_only_of_sketches_that_belong_together() -> None:
    two = [report(0, 3, sketch=(3.0, 0.0)), report(1, 3, sketch=(-3.0, 8.0))]
    assert errors(Moment.of(two)) == {"drone0": 5.0, "drone1": 5.0}
    assert errors(Moment.of([two[0], report(1, 3)])) == {}
    assert errors(ring(3)) == errors(Moment()) == {}


def test_events_tell_who_joined_left_finished_and_went_without_whom() -> None:
    lossy = Moment.of([report(0, 41, missing=("drone1",), weights={}), report(1, 41)])
    assert events(Moment(), ring(40, 0, 1), 100) == [
        Event("INFO", "drone0 joined"),
        Event("INFO", "drone1 joined"),
    ]
    assert events(ring(40, 0, 1), lossy, 100) == [Event("WARN", "drone0 mixed without drone1")]
    assert events(lossy, ring(42, 0, 1), 100) == [Event("INFO", "drone0 mixed with drone1 again")]
    assert events(ring(42, 0, 1), ring(43, 0), 100) == [Event("WARN", "drone1 left after round 42")]
    assert events(ring(99, 0, 1), Moment(), 100)[0] == Event("INFO", "drone0 finished")
    silent = Moment(present=frozenset({"drone2"}))
    assert events(silent, Moment(), 100) == [Event("WARN", "drone2 left before its first report")]


def test_a_moment_follows_from_what_arrives_and_who_is_here() -> None:
    first = Moment().then([report(0, 7), report(0, 8)], {"drone0", "drone1"}, 5.0)
    assert (first.round, first.time, set(first.reports)) == (8, 5.0, {"drone0"})
    parting = first.then([report(1, 9)], {"drone0"}, 6.0)  # the last report of one that has left
    assert parting.present == {"drone0", "drone1"}
    last = parting.then([], set(), 7.0)
    assert (last.present, last.reports, last.round) == (frozenset(), {}, 9)


def test_what_agents_remember_becomes_rounds_that_all_have_finished() -> None:
    coarse = [report(0, k) for k in range(0, 12, 4)]  # an old agent remembers every fourth round
    fine = [report(1, k) for k in range(6, 11)]  # a young one all of its few
    moments = remembered({"drone0": coarse, "drone1": fine, "drone2": []})
    assert [moment.round for moment in moments] == [0, 4, 8]
    assert moments[-1].present == {"drone0", "drone1"}
    assert remembered({}) == []


def test_thinning_keeps_the_ends_the_sketches_and_the_faults() -> None:
    moments = [ring(k, sketch=(1.0,) if k % 100 == 0 else ()) for k in range(20_000)]
    moments[12_345] = ring(12_345, missing=("drone1",))
    kept = thin(moments, 2000)
    rounds = [moment.round for moment in kept]
    assert 1800 <= len(kept) <= 2000
    assert {0, 12_345, 19_999, *range(0, 20_000, 100)} <= set(rounds)
    assert max(b - a for a, b in pairwise(rounds)) <= 20
    assert thin(moments[:50], 50) == moments[:50]


# -- worlds and rows -------------------------------------------------------------------------------


def test_a_grid_world_is_drawn_as_its_cells() -> None:
    world = world_of(GRID)
    assert isinstance(world, CellWorld)
    cells = world.cells
    assert cells.shape == (10, 10)
    assert (cells[0, 0], cells[8, 2], cells[1, 8], cells[5, 5]) == (START, GOAL, OBSTACLE, FREE)
    assert world.centres(ROUTE).tolist() == [[0.5, 0.5], [1.5, 0.5], [1.5, 1.5]]


def test_a_chain_is_a_row_and_an_unknown_world_is_left_out() -> None:
    chain = world_of(Task("sim:Chain-v0", {"task": 1}))
    assert isinstance(chain, CellWorld)
    assert chain.cells.tolist() == [[GOAL, FREE, START, FREE, OBSTACLE]]
    assert world_of(Task("CartPole-v1")) is None
    assert world_of(Task("not_installed:World-v0")) is None


def crowd_scene(size: int) -> Scene:
    return Scene.of(msgspec.structs.replace(crowd(size), topology=Topology(kind="ring")))


def test_a_crowd_shares_worlds_has_short_names_and_no_words_on_its_edges() -> None:
    scene = crowd_scene(64)
    assert [len(agents) for agents in scene.sharing.values()] == [32, 32]  # two tasks
    assert scene.worlds["drone00"] is scene.worlds["drone62"]
    pictures = [path for path, _ in scene.still() if path.endswith("/cells")]
    assert set(pictures) == {"worlds/drone00/cells", "worlds/drone01/cells"}
    members = scene.config.members
    used = tuple(pairwise(members))
    found = Links(used[1:], used[:1])
    here, apart = frozenset(members), dict.fromkeys(used, 1.0)
    nodes, edges = drawn(scene.places, scene.colours, here, found, apart)
    assert [node.label for node in nodes] == [f"{i:02d}" for i in range(64)]
    assert edges == list(found.used)
    ends = [np.array(scene.places[member]) for member in members[:2]]
    assert np.linalg.norm(ends[1] - ends[0]) > 25


def test_a_crowd_has_two_lines_for_all_its_edges() -> None:
    scene = crowd_scene(64)
    members = scene.config.members
    told = [
        msgspec.structs.replace(
            report(0, 3), agent=agent, weights={members[(i + 1) % 64]: 0.25}, sketch=(float(i),)
        )
        for i, agent in enumerate(members)
    ]
    rows = {row.path: row.value for row in scene.rows(Moment(), Moment.of(told))}
    assert {path for path in rows if path.startswith("edges/")} == {"edges/largest", "edges/median"}
    assert (rows["edges/largest"], rows["edges/median"]) == (63.0, 1.0)


@pytest.mark.parametrize("count", [1, 6, 7, 16, 64])
def test_every_agent_has_a_colour_of_its_own(count: int) -> None:
    found = colours.of_agents(count)
    assert found[:6] == colours.FIRST[:count]
    assert found == colours.of_agents(64)[:count]
    places = colours.oklab(np.array([*found, *colours.TAKEN]))
    apart = np.linalg.norm(places[:, None] - places, axis=2)[np.triu_indices(len(places), 1)]
    assert apart.min() > 0.05  # 0.02 is what a careful eye just sees


def test_only_what_is_new_makes_rows() -> None:
    scene, now = Scene.of(RING), ring(3, sketch=(1.0,), route=ROUTE)
    paths = {row.path for row in scene.rows(Moment(), now)}
    assert {"return/drone0", "worlds/drone3/path", "consensus_error/drone1", "graph"} <= paths
    assert list(scene.rows(now, now.then([], now.present, 9.0))) == []


def test_a_missing_edge_is_broken_by_a_node_in_its_middle() -> None:
    scene = Scene.of(RING)
    here, cut = frozenset({"drone0"}), Links((), (("drone0", "drone2"),))
    nodes, edges = drawn(scene.places, scene.colours, here, cut, {})
    middle = nodes[-1]
    np.testing.assert_allclose(middle.place, (0, 0), atol=1e-4)  # across the circle
    assert edges == [("drone0", middle.name), (middle.name, "drone2")]
    assert nodes[0].colour != nodes[1].colour == nodes[2].colour  # here; not here


# -- recordings ------------------------------------------------------------------------------------


def test_a_run_folder_becomes_a_whole_recording(tmp_path: Path) -> None:
    moments = [ring(k, *([0, 1, 3] if 20 <= k < 30 else [])) for k in range(100)]
    for k in range(0, 100, 10):
        sketched = [
            msgspec.structs.replace(r, sketch=(float(r.agent[-1]),), route=ROUTE)
            for r in moments[k].reports.values()
        ]
        moments[k] = Moment.of(sketched)
    path = tmp_path / "recording.rrd"
    record_run(folder_of(moments, tmp_path / "run"), RING, path)

    rounds, values = scalars(path, "/return/drone1")
    assert rounds == list(range(100))
    assert values == [1 + k / 100 for k in range(100)]
    assert scalars(path, "/return/drone2")[0] == [*range(20), *range(30, 100)]
    assert scalars(path, "/disagreement/drone0")[1] == [0.5] * 100
    rounds, values = scalars(path, "/consensus_error/drone0")
    assert rounds == list(range(0, 100, 10))
    np.testing.assert_allclose(values, [1.5, 1.5, 4 / 3, *[1.5] * 7])  # mean of 0 1 (2) 3
    rounds, strips = columns(path, "/worlds/drone0/path", "LineStrips2D:strips")
    assert rounds == list(range(0, 100, 10))
    assert strips[0] == [[[0.5, 0.5], [1.5, 0.5], [1.5, 1.5]]]
    rounds, texts = columns(path, "/events", "TextLog:text")
    assert rounds == [0, 0, 0, 0, 20, 30]
    assert texts[4:] == [["drone2 left after round 19"], ["drone2 joined"]]
    rounds, nodes = columns(path, "/graph", "GraphNodes:node_ids")
    assert rounds == list(range(0, 100, 10))
    assert [len(row) for row in nodes] == [8] * 10  # a label on each of four edges
    rounds, apart = scalars(path, "/edges/drone0-drone1")
    assert (rounds, apart) == ([*range(0, 100, 10)], [1.0] * 10)
    assert scalars(path, "/consensus_error/decay")[1][:2] == pytest.approx([1.5, 1.5 / 2**10])

    views = {
        chunk.to_record_batch().column("ViewBlueprint:space_origin").to_pylist()[0][0]
        for chunk in RrdReader(path).stream(store=RrdReader(path).blueprints()[0])
        if "ViewBlueprint:space_origin" in chunk.to_record_batch().schema.names
    }
    worlds = {f"/worlds/drone{i}" for i in range(4)}
    assert {v if v.startswith("/") else f"/{v}" for v in views} == worlds | {
        "/graph",
        "/events",
        "/return",
        "/consensus_error",
        "/edges",
    }


def test_a_recording_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    folder = folder_of([ring(k) for k in range(3000)], tmp_path / "run")
    assert len(history(folder, RING)) == 2000
    record_run(folder, RING, path)
    assert len(scalars(path, "/return/drone0")[0]) == 2000
    assert path.stat().st_size < 2e6


def test_moments_may_come_one_by_one_or_all_at_once(tmp_path: Path) -> None:
    moments = [ring(k, sketch=(k / 3.0,), route=ROUTE) for k in range(6)]
    read = []
    for size in (1, 6):
        path = tmp_path / f"{size}.rrd"
        with rr.RecordingStream("test") as stream:
            stream.save(path)
            recorder = Recorder(stream, Scene.of(RING))
            for begin in range(0, 6, size):
                recorder.take(moments[begin : begin + size])
        ends = columns(path, "/worlds/drone2/drone", "Points2D:positions")
        log = columns(path, "/events", "TextLog:text")
        read.append((scalars(path, "/consensus_error/drone2"), ends, log))
    assert read[0] == read[1]


def test_a_swarm_of_worlds_unknown_shows_everything_else(tmp_path: Path) -> None:
    agents = tuple(AgentEntry(f"drone{i}", Task("CartPole-v1")) for i in range(4))
    config, path = msgspec.structs.replace(RING, agents=agents), tmp_path / "recording.rrd"
    record_run(folder_of([ring(0, route=ROUTE)], tmp_path / "run", config), config, path)
    entities = {chunk.entity_path for chunk in RrdReader(path).stream()}
    assert {"/return/drone0", "/graph", "/events"} <= entities
    assert not any(entity.startswith("/worlds") for entity in entities)


def test_an_agent_alone_has_a_graph_without_edges(tmp_path: Path) -> None:
    config = msgspec.structs.replace(RING, agents=RING.agents[:1])
    alone, path = ring(0, 0, weights={}), tmp_path / "recording.rrd"
    record_run(folder_of([alone], tmp_path / "run", config), config, path)
    assert columns(path, "/graph", "GraphNodes:node_ids") == ([0], [["drone0"]])
    assert columns(path, "/graph", "GraphEdges:edges") == ([0], [[]])


def test_an_empty_run_is_an_empty_recording(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    record_run(folder_of([], tmp_path / "run"), RING, path)
    assert columns(path, "/events", "TextLog:text") == ([], [])
