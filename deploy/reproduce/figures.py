"""The look of all figures: size, type and colours that everybody can tell apart."""

from io import BytesIO
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from agent.storage.files import drafted

# Okabe and Ito 2008, in an order of good contrast on white.
BLUE, ORANGE, GREEN, PINK, SKY, RED, YELLOW, BLACK = COLOURS = (
    "#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#000000",
)  # fmt: skip
DPI = 150

__all__ = ["Axes", "Figure", "canvas", "label", "rgb", "save"]

mpl.rcParams.update(
    {
        "font.size": 9,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlesize": 10,
        "axes.titleweight": "bold",
        "axes.titlelocation": "left",
        "axes.grid": True,
        "grid.color": "#dddddd",
        "grid.linewidth": 0.6,
        "legend.frameon": False,
        "legend.fontsize": 8,
        "lines.linewidth": 1.6,
    }
)


def canvas(
    columns: int, rows: int = 1, size: tuple[float, float] = (4.0, 3.2)
) -> tuple[Figure, Any]:
    """A figure and its (rows, columns) array of axes, each of ``size`` inches."""
    figure = Figure(figsize=(size[0] * columns, size[1] * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False)
    return figure, axes


def rgb(colour: str) -> tuple[float, float, float]:
    """Red, green and blue, 0 to 1."""
    return to_rgb(colour)


def label(axes: Axes, title: str, x: str, y: str) -> None:
    """Title and axis labels."""
    axes.set_title(title)
    axes.set_xlabel(x)
    axes.set_ylabel(y)


def save(figure: Figure, path: Path) -> Path:
    """Write a PNG, small enough for a repository: 128 colours do."""
    picture = BytesIO()
    figure.savefig(picture, dpi=DPI)
    with drafted(path) as draft:
        Image.open(picture).convert("RGB").quantize(128).save(draft, optimize=True)
    return path
