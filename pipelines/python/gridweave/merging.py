"""Merging maps."""

from typing import Any, Iterable, Mapping, Sequence

from numpy.typing import NDArray

from .inputs import MapInput, given
from .request import Accept, FilePath, Initial, Progress, settings
from .result import MergeResult, result_of


def merge(
    inputs: FilePath | Iterable[MapInput] | Mapping[str, MapInput] | NDArray[Any],
    *,
    resolution: float | None = None,
    reference: str | None = None,
    initial: Initial | None = None,
    accept: Accept | None = None,
    rename: Mapping[str, str] | None = None,
    lidar: Mapping[str, Sequence[float]] | None = None,
    literal_thresholds: bool = False,
    parameters: Mapping[str, Any] | None = None,
    seed: int | None = None,
    output: FilePath | None = None,
    progress: Progress = False,
) -> MergeResult:
    """Estimates the relative poses of the maps of several robots, and merges them into one map.

    A robot that cannot be merged is no error: `MergeResult.unmerged` says why. The same inputs give the same result on every machine.

    Args:
        inputs: Paths of map files (YAML of nav2's map server) or of logs (MCAP, rosbag2, ROS 1 bags), or maps: `Map` objects, numpy
            arrays (see `Map`), and ``nav_msgs/msg/OccupancyGrid`` messages of rclpy, rosbags, mcap or `gridweave.msg`. In a list, a
            map file is the map of a robot with the name of the file, and any other map that of ``robot1``, ``robot2``, ... by its
            place; an array of three dimensions is a list of maps. A mapping names the robots: of maps, of map files, or of logs. Logs are
            not merged with maps in memory.
        resolution: The side of a cell of arrays, metres.
        reference: The robot whose map frame is the frame of the result; by default the first by name.
        initial: Approximate poses of map frames by robot: a `Frame`, as in `MergeResult.frames`, or x, y (metres), yaw (radians) and,
            if two more numbers follow, the standard deviations of the position and of the yaw.
        accept: For a robot, the number of the hypothesis to accept, from 1, of the list in the reason why it was not merged; or
            ``"initial"`` to merge its map at its initial pose as it is. ``"robot1/robot2"`` is one pair of robots.
        rename: Other names of topics of logs, such as ``{"/r1/{robot}/map": "/{robot}/map"}``, where ``{robot}`` is one part of both.
        lidar: Poses of lidars on their robots, x, y (metres) and yaw (radians), instead of those in the log's tf; behind them the roll of
            one that is mounted upside down.
        literal_thresholds: Whether the thresholds of map files are applied literally, even where these leave no walls.
        parameters: Parameters of stages, such as ``{"elastic.enabled": False}``.
        seed: Seed of all random numbers.
        output: A log to write.
        progress: True shows a bar (tqdm); a function is called with the share that is done, 0 to 1.

    Raises:
        RequestError: The request is wrong, such as a file that is no map.
        GridweaveError: The merge has failed.
    """
    asked = settings(
        reference=reference,
        initial=initial,
        accept=accept,
        rename=rename,
        lidar=lidar,
        literal_thresholds=literal_thresholds,
        parameters=parameters,
        seed=seed,
    )
    return result_of(given(inputs, resolution), asked, output, progress, "merge")
