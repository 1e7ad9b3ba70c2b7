"""Merging maps."""

from os import PathLike
from typing import Any, Iterable, Mapping, Sequence

import numpy as np

from . import _native
from .map import Map
from .request import Progress, request, watch
from .result import MergeResult

#: What a map may be given as: a file, a log, a `Map`, an array, or a `nav_msgs/msg/OccupancyGrid`.
Input = Any


def merge(
    inputs: Iterable[Input] | Mapping[str, Input],
    *,
    resolution: float | None = None,
    reference: str | None = None,
    initial: Mapping[str, Sequence[float]] | None = None,
    accept: Mapping[str, int | str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    seed: int | None = None,
    output: str | PathLike[str] | None = None,
    progress: Progress = False,
) -> MergeResult:
    """Estimates the relative poses of the maps of several robots, and merges them into one map.

    A robot that cannot be merged is no error: `MergeResult.unmerged` says why. The same inputs give the same result on every machine.

    Args:
        inputs: Paths of map files (YAML of nav2's map server) or of logs (MCAP, rosbag2, ROS 1 bags), or maps: `Map` objects, numpy
            arrays (see `Map.cells`), and ``nav_msgs/msg/OccupancyGrid`` messages of rclpy, rosbags, mcap or `gridweave.msg`. Maps in
            a list are those of ``robot1``, ``robot2``, ...; a mapping names their robots. A map file is the map of a robot with the
            name of the file.
        resolution: The side of a cell of arrays, metres.
        reference: The robot whose map frame is the frame of the result; by default the first by name.
        initial: Approximate poses of map frames by robot: x, y (metres), yaw (radians) and, if two more numbers follow, the standard
            deviations of the position and of the yaw.
        accept: For a robot, the number of the hypothesis to accept, from the list in its refusal, or ``"initial"``.
        parameters: Parameters of stages, such as ``{"elastic.enabled": False}``.
        seed: Seed of all random numbers.
        output: A log to write.
        progress: True shows a bar (tqdm); a function is called with the share that is done, 0 to 1.

    Raises:
        RequestError: The request is wrong, such as a file that is no map.
        GridweaveError: The merge has failed.
    """
    named = inputs if isinstance(inputs, Mapping) else None
    given = list(named.values()) if named is not None else _listed(inputs)

    def run(output: str | PathLike[str] | None, progress: Progress = False) -> tuple[str, Any]:
        asked = request(reference=reference, initial=initial, accept=accept, parameters=parameters, seed=seed, output=output)
        with watch(progress, "merge") as report:
            if named is None and all(isinstance(one, (str, PathLike)) for one in given):
                return _native.merge_files(given, asked, report)
            names = list(named) if named is not None else [f"robot{number}" for number in range(1, len(given) + 1)]
            return _native.merge_maps([_native_map(name, one, resolution) for name, one in zip(names, given)], asked, report)

    return MergeResult(*run(output, progress), rerun=run)


def _listed(inputs: Any) -> list[Input]:
    if isinstance(inputs, (str, PathLike)):
        return [inputs]
    if isinstance(inputs, (Map, np.ndarray)) and getattr(inputs, "ndim", 2) == 2 or hasattr(inputs, "info"):
        raise _native.RequestError("one map alone is not merged: give a list of maps")
    return list(inputs)


def _native_map(name: str, given: Input, resolution: float | None) -> tuple[str, np.ndarray, float, tuple[float, float, float]]:
    """A map as the native part takes it."""
    if isinstance(given, (str, PathLike)):
        given = Map.load(given)
    elif hasattr(given, "info") and hasattr(given, "data"):
        given = Map.from_message(given)
    elif not isinstance(given, Map):
        if resolution is None:
            raise _native.RequestError("an array does not say how large its cells are: give `resolution`, in metres")
        given = Map(given, resolution)
    return str(name), given.cells, given.resolution, given.origin
