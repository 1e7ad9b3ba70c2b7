"""Occupancy grids."""

import math
import operator
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _native
from .request import FilePath, path_of


@dataclass(frozen=True, eq=False)
class Map:
    """An occupancy grid: what the map server of ROS has in a YAML file and an image, or a ``nav_msgs/msg/OccupancyGrid``.

    It is made of an array of cells in one of these forms:

    - whole numbers: -1 unknown, 0 free to 100 occupied. In an array of uint8, 255 is unknown (-1, read as uint8) if some cell is from 1 to
      100; without one it could be a picture in black and white, and is refused. In one of floats, NaN is unknown, too.
    - fractions, if all are from 0 to 1: the probability that the cell is occupied, with NaN or -1 where it is unknown.
    - true for occupied, and false for free.

    The masked cells of a masked array are unknown.

    Attributes:
        cells: -1 unknown, 0 free to 100 occupied, as int8; rows by columns. Row 0 is at the origin, so the picture of a map file is
            upside down to it.
        resolution: The side of a cell, metres.
        origin: The pose of the outer corner of cell (0, 0) in the map frame, as x and y (metres) and yaw (radians).

    Raises:
        RequestError: The cells, the resolution or the origin are no such.
    """

    cells: NDArray[np.int8]
    resolution: float
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __init__(self, cells: ArrayLike, resolution: float, origin: Iterable[float] = (0.0, 0.0, 0.0)) -> None:
        object.__setattr__(self, "cells", _cells_of(cells))
        object.__setattr__(self, "resolution", _resolution_of(resolution))
        object.__setattr__(self, "origin", _origin_of(origin))

    @classmethod
    def load(cls, file: FilePath) -> "Map":
        """Reads a map file: the YAML of nav2's map server, with its image.

        Raises:
            RequestError: It cannot be read, is no map, or is the image alone.
        """
        if is_image(Path(path_of(file))):
            raise _native.RequestError(f"{file} is an image: give the YAML file of the map instead, which says how large its cells are")
        (cells, resolution, origin), warning = _native.load_map(file)
        if warning:
            warnings.warn(f"{file}: {warning}", stacklevel=2)
        return cls(cells, resolution, origin)

    @classmethod
    def from_message(cls, message: Any) -> "Map":
        """Makes a map of a ``nav_msgs/msg/OccupancyGrid`` of rclpy, rosbags, mcap or `gridweave.msg`: anything that has its fields.

        Raises:
            RequestError: Its fields are those of no map.
        """
        try:
            info = message.info
            position, q = info.origin.position, info.origin.orientation
            yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
            width, height = operator.index(info.width), operator.index(info.height)
            resolution, at = info.resolution, (position.x, position.y, yaw)
            cells = np.asarray(message.data)
        except (AttributeError, TypeError, ValueError) as error:
            raise _native.RequestError(f"this is no message with an occupancy grid: {error}") from None
        if cells.size and cells.dtype.kind not in "iu":
            raise _native.RequestError(f"the cells of a message are whole numbers from -1 to 100, and not {_kind(cells.dtype)}")
        if cells.size != height * width:
            raise _native.RequestError(f"the message says {width} x {height} cells, and has {cells.size}")
        return cls(cells.reshape(height, width) if cells.size else np.empty((height, width), np.int8), resolution, at)

    def to_message(self, frame_id: str = "map") -> Any:
        """Makes a ``nav_msgs/msg/OccupancyGrid`` of `gridweave.msg`."""
        from .msg.nav_msgs import OccupancyGrid

        message = OccupancyGrid(data=self.cells)
        message.header.frame_id = frame_id
        info, (x, y, yaw) = message.info, self.origin
        info.resolution, (info.height, info.width) = self.resolution, self.cells.shape
        info.origin.position.x, info.origin.position.y = x, y
        info.origin.orientation.z, info.origin.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        return message

    def save(self, file: FilePath) -> None:
        """Writes a map file: FILE.yaml of nav2's map server, with the image beside it.

        Raises:
            RequestError: The name of the file ends neither in .yaml nor in .yml.
            GridweaveError: It cannot be written.
        """
        if not is_yaml(Path(path_of(file))):
            instead = f"{Path(file).stem or 'map'}.yaml"
            raise _native.RequestError(f"a map is written as a YAML file, with its image beside it, and not as {file}: give {instead}")
        _native.save_map(file, self.cells, self.resolution, self.origin)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top of the map, metres, as ``matplotlib.pyplot.imshow`` takes it; without the yaw of the origin."""
        rows, columns = self.cells.shape
        x, y, _ = self.origin
        return x, x + columns * self.resolution, y, y + rows * self.resolution

    def __repr__(self) -> str:
        rows, columns = self.cells.shape
        return f"<Map of {columns} x {rows} cells of {self.resolution:.3g} m>"


def is_yaml(file: Path) -> bool:
    """Whether the name of a file is that of a map."""
    return file.suffix.lower() in (".yaml", ".yml")


def is_image(file: Path) -> bool:
    """Whether the name of a file is that of an image."""
    return file.suffix.lower() in (".pgm", ".png", ".pbm", ".ppm", ".bmp", ".jpg", ".jpeg")


def _resolution_of(given: Any) -> float:
    resolution = math.nan if isinstance(given, (str, bytes, bool)) else given
    try:
        resolution = float(resolution)
    except (TypeError, ValueError):
        resolution = math.nan
    if not _RESOLUTIONS[0] <= resolution <= _RESOLUTIONS[1]:
        raise _native.RequestError(f"the resolution of a map is a length in metres, and not {given!r}")
    return resolution


def _origin_of(given: Any) -> tuple[float, float, float]:
    try:
        x, y, yaw = (float(part) for part in given)
    except (TypeError, ValueError):
        x = y = yaw = math.nan
    if not all(map(math.isfinite, (x, y, yaw))):
        raise _native.RequestError(f"the origin of a map is (x, y, yaw), and not {given!r}")
    return x, y, yaw


def _cells_of(given: Any) -> NDArray[np.int8]:
    """The cells of an array, see `Map`."""
    try:
        mask = np.broadcast_to(given.mask, given.shape) if isinstance(given, np.ma.MaskedArray) else None
        given = np.asarray(given)
    except (TypeError, ValueError):
        raise _native.RequestError("the cells of a map are an array of rows and columns, and the rows of this one are of several lengths") from None
    if given.ndim != 2:
        hint = ": a picture in colours is converted to grey first" if given.ndim == 3 else ""
        raise _native.RequestError(f"a map is an array of rows and columns, and not of {given.ndim} dimensions{hint}")
    if given.size > _MOST_CELLS:
        size = f"{given.shape[1]} x {given.shape[0]}"
        raise _native.RequestError(f"a map of {size} cells has more than the maximum of {_MOST_CELLS}: crop it to what is known")
    known = np.ones(given.shape, bool) if mask is None else ~mask
    if given.dtype.kind == "b":
        scaled = np.where(given, np.int8(100), np.int8(0))
    elif given.dtype.kind in "iu":
        scaled = given
        # A picture in black and white has 0 and 255, too.
        if given.dtype == np.uint8 and ((given >= 1) & (given <= 100)).any():
            known &= given != 255
    elif given.dtype.kind == "f":
        known &= np.isfinite(given) & (given != -1)
        of_known = given[known]
        if ((of_known >= 0) & (of_known <= 1)).all():
            scaled = np.where(known, np.rint(np.where(known, given, 0) * 100), -1)
        elif (of_known == np.rint(of_known)).all():
            scaled = given
        else:
            raise _native.RequestError(
                "the cells of a map of fractions are probabilities from 0 to 1, with NaN or -1 where they are unknown, and these are from "
                f"{of_known.min():g} to {of_known.max():g}" + _OF_PICTURES
            )
    else:
        raise _native.RequestError(f"the cells of a map are numbers, and not {_kind(given.dtype)}")
    of_known = scaled[known]
    if of_known.size and not (-1 <= of_known.min() and of_known.max() <= 100):
        raise _native.RequestError(
            f"the cells of a map are from -1 (unknown) and 0 (free) to 100 (occupied), and these from {of_known.min():g} to "
            f"{of_known.max():g}" + _OF_PICTURES
        )
    if known.all():
        return np.ascontiguousarray(scaled, dtype=np.int8)
    cells = np.full(given.shape, -1, np.int8)
    cells[known] = of_known
    return cells


# The most cells of a map, as many as an image of a map file may have.
_MOST_CELLS = 1 << 28
# Messages hold the resolution in single precision.
_RESOLUTIONS = float(np.finfo(np.float32).tiny), float(np.finfo(np.float32).max)
_OF_PICTURES = (
    ": `Map.load` reads an image file by its YAML file, and an array of 8 bits with white floor and black walls, row 0 on top, is a map as "
    "`(255 - picture[::-1]) / 255`, though without unknown cells"
)


def _kind(dtype: np.dtype[Any]) -> str:
    return {"U": "texts", "S": "bytes", "O": "objects", "f": "fractions", "b": "true and false"}.get(dtype.kind, dtype.name)
