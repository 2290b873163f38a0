"""Which view shows what, and where, for few agents as for many.

Of many agents, those with the same task share the view of its world; what does not fit one page
goes to tabs.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import rerun as rr
import rerun.blueprint as rrb

from deploy.viewer.rooms import Room
from deploy.viewer.tasks import CellWorld

PAGE = 9  # views of worlds on one page
EYES = 4  # drones whose pictures stand side by side
NAMED = 12  # lines up to which a plot has room for their names
CORNER = rrb.Corner2D.RightTop
PLOTS = {
    "distance": "Mean length of flights [m]",
    "return": "Return",
    "consensus_error": "Consensus error, its decay and bound",
    "edges": "Distance between neighbours",
}

World = CellWorld | Room
Thing = TypeVar("Thing")


def blueprint(
    worlds: Mapping[str, World], sharing: Mapping[str, Sequence[str]], members: Sequence[str]
) -> rrb.Blueprint:
    """The layout of a swarm.

    Args:
        worlds: by agent, of one agent for each task that can be drawn.
        sharing: by the same agents, all whose task it is.
        members: all agents.
    """
    flying = [a for a, world in worlds.items() if isinstance(world, Room) for a in sharing[a]]
    log = rrb.TextLogView(
        name="Events",
        origin="events",
        columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
    )
    middle = rrb.Vertical(
        rrb.GraphView(name="Who mixes with whom", origin="graph"), log, row_shares=[3, 2]
    )
    legend = rrb.PlotLegend(CORNER, visible=len(members) <= NAMED)
    shown = [plot for plot in PLOTS if flying or plot != "distance"]
    plots = rrb.Vertical(*(_plot(PLOTS[plot], plot, legend) for plot in shown))
    parts: list[rrb.Container] = [middle, plots]
    if worlds:
        views = [_world(world, agent, sharing[agent]) for agent, world in worlds.items()]
        left: rrb.Container = _pages(list(worlds), views, PAGE, lambda page: rrb.Grid(*page))
        if flying:
            acts = rrb.Horizontal(
                _plot("Actions", "action", legend), _plot("Rewards", "reward", legend)
            )
            left = rrb.Vertical(left, _eyes(flying), acts, row_shares=[5, 3, 2])
        parts.insert(0, left)
    return rrb.Blueprint(
        rrb.Horizontal(*parts, column_shares=[4, 2, 3][-len(parts) :]),
        rrb.TimePanel(state="collapsed", timeline="round", play_state="following"),
        collapse_panels=True,
    )


def _world(world: World, agent: str, sharing: Sequence[str]) -> rrb.View:
    """A world, and what moves in it of all that share the task."""
    name = agent if len(sharing) == 1 else f"{agent} and {len(sharing) - 1} more"
    others = [f"/worlds/{other}/**" for other in sharing if other != agent]
    return world.view(name, f"worlds/{agent}", [f"/worlds/{agent}/**", *others])


def _eyes(flying: Sequence[str]) -> rrb.Container:
    """What drones see: pictures above, depth below."""

    def page(agents: Sequence[str]) -> rrb.Container:
        sights = [
            rrb.Spatial2DView(name=f"{agent} {what}", origin=f"sight/{agent}/{what}")
            for what in ("camera", "depth")
            for agent in agents
        ]
        return rrb.Grid(*sights, grid_columns=len(agents))

    return _pages(flying, flying, EYES, page)


def _pages(
    names: Sequence[str], things: Sequence[Thing], most: int,
    page: Callable[[Sequence[Thing]], rrb.Container],
) -> rrb.Container:  # fmt: skip
    """One page, or tabs of pages of at most ``most`` things each."""
    if len(things) <= most:
        return page(things)
    tabs = []
    for first in range(0, len(things), most):
        last = min(first + most, len(things)) - 1
        tab = page(things[first : last + 1])
        tab.name = f"{names[first]} to {names[last]}" if last > first else names[first]
        tabs.append(tab)
    return rrb.Tabs(*tabs)


def _plot(name: str, origin: str, legend: rrb.PlotLegend) -> rrb.View:
    """A plot of all rounds; by default a live one shows the newest only."""
    ever = rr.TimeRangeBoundary.infinite()
    axis = rrb.TimeAxis(view_range=rr.TimeRange(ever, ever))
    return rrb.TimeSeriesView(name=name, origin=origin, plot_legend=legend, axis_x=axis)
