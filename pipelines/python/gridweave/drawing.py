"""Drawings of results by matplotlib."""

import math
import textwrap
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .map import Map
from .request import needed

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .result import MergeResult

#: The most cells of a side that are drawn: several for each pixel of a figure, for who looks at a part of it.
_DRAWN = 2000


def draw(result: "MergeResult", axes: "Axes | None") -> "Axes":
    """Draws a result, see `MergeResult.plot`."""
    if axes is None:
        axes = needed("matplotlib.pyplot", "a plot", "plot").subplots(layout="constrained")[1]
    if result.map is not None:
        shade, extent = _shades(result.map)
        axes.imshow(shade, origin="lower", extent=extent, cmap="gray", vmin=0, vmax=100, interpolation="antialiased")
    for number, (robot, frame) in enumerate(result.frames.items()):
        ahead = (frame.x + math.cos(frame.yaw), frame.y + math.sin(frame.yaw))
        arrow = {"arrowstyle": "->", "color": f"C{number}", "lw": 2, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", ahead, (frame.x, frame.y), arrowprops=arrow)
        axes.text(*ahead, f" {robot}", color=f"C{number}", va="center")
    if result.unmerged:
        axes.set_title(textwrap.fill(f"not merged: {', '.join(result.unmerged)}", 60), fontsize="medium")
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    return axes


def _shades(map: Map) -> "tuple[NDArray[np.float64], tuple[float, float, float, float]]":
    """The shades of a map, 0 to 100 white, and where they are. Of a large map each stands for a block of cells, and is that of the most
    occupied one, as walls are thin."""
    step = max(1, -(-max(map.cells.shape) // _DRAWN))
    rows, columns = (-(-side // step) for side in map.cells.shape)
    cells = np.full((rows * step, columns * step), -1, np.int8)
    cells[: map.cells.shape[0], : map.cells.shape[1]] = map.cells
    most = cells.reshape(rows, step, columns, step).max(axis=(1, 3))
    x, y, _ = map.origin
    side = step * map.resolution
    return np.where(most < 0, 70.0, 100.0 - most), (x, x + columns * side, y, y + rows * side)
