"""Occupancy grids."""

import math
import warnings
from dataclasses import dataclass
from os import PathLike
from typing import Any

import numpy as np

from . import _native


@dataclass(frozen=True, eq=False)
class Map:
    """An occupancy grid: what the map server of ROS has in a YAML file and an image, or a ``nav_msgs/msg/OccupancyGrid``."""

    #: -1 unknown, 0 free to 100 occupied, as int8; rows by columns. Row 0 is at the origin, so the picture of a map file is upside
    #: down to it.
    cells: np.ndarray
    #: The side of a cell, metres.
    resolution: float
    #: The pose of the outer corner of cell (0, 0) in the map frame, as x and y (metres) and yaw (radians).
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cells", _cells_of(self.cells))
        object.__setattr__(self, "origin", tuple(float(part) for part in self.origin))
        if len(self.origin) != 3 or not all(map(math.isfinite, self.origin)):
            raise _native.RequestError(f"the origin of a map is (x, y, yaw), and not {self.origin}")
        if not (math.isfinite(self.resolution) and self.resolution > 0):
            raise _native.RequestError(f"the resolution of a map is a length in metres, and not {self.resolution}")

    @classmethod
    def load(cls, file: str | PathLike[str]) -> "Map":
        """Reads a map file: the YAML of nav2's map server, with its image."""
        (cells, resolution, origin), warning = _native.load_map(file)
        if warning:
            warnings.warn(f"{file}: {warning}", stacklevel=2)
        return cls(cells, resolution, origin)

    @classmethod
    def from_message(cls, message: Any) -> "Map":
        """Makes a map of a ``nav_msgs/msg/OccupancyGrid`` of rclpy, rosbags, mcap or `gridweave.msg`: anything that has its fields."""
        info = message.info
        position, q = info.origin.position, info.origin.orientation
        yaw = math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y * q.y + q.z * q.z))
        cells = np.asarray(message.data, dtype=np.int8)
        if cells.size != info.height * info.width:
            raise _native.RequestError(f"the message says {info.width} x {info.height} cells, and has {cells.size}")
        return cls(cells.reshape(info.height, info.width), info.resolution, (position.x, position.y, yaw))

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

    def save(self, file: str | PathLike[str]) -> None:
        """Writes a map file: FILE.yaml of nav2's map server, with the image beside it."""
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


def _cells_of(given: Any) -> np.ndarray:
    """The cells of an array: integers are occupancies from -1 to 100, fractions probabilities with NaN for unknown cells, and true
    is occupied."""
    given = np.asarray(given)
    if given.ndim != 2:
        raise _native.RequestError(f"a map is an array of rows and columns, and not of {given.ndim} dimensions")
    if given.dtype == np.int8:
        cells = given
    elif given.dtype.kind == "b":
        cells = np.where(given, np.int8(100), np.int8(0))
    elif given.dtype.kind in "iu":
        cells = given
    elif given.dtype.kind == "f":
        known = np.isfinite(given)
        if known.any() and not (0 <= given[known].min() and given[known].max() <= 1):
            raise _native.RequestError("the cells of a map of fractions are probabilities from 0 to 1, or NaN where they are unknown")
        cells = np.full(given.shape, -1, np.int8)
        cells[known] = np.rint(given[known] * 100)
    else:
        raise _native.RequestError(f"the cells of a map are numbers, and not {given.dtype}")
    if cells.size and not (-1 <= cells.min() and cells.max() <= 100):
        raise _native.RequestError(
            f"the cells of a map are from -1 (unknown) and 0 (free) to 100 (occupied), and these from {cells.min()} to {cells.max()}: "
            "an image is read by `Map.load` with its YAML file"
        )
    return np.ascontiguousarray(cells, dtype=np.int8)
