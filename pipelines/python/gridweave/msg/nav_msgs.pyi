"""The message types of `nav_msgs`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import builtin_interfaces, geometry_msgs, std_msgs

class GridCells:
    """The ROS 2 message `nav_msgs/msg/GridCells`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    cell_width: float
    cell_height: float
    cells: list[geometry_msgs.Point]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        cell_width: float = ...,
        cell_height: float = ...,
        cells: list[geometry_msgs.Point] = ...,
    ) -> None: ...

class MapMetaData:
    """The ROS 2 message `nav_msgs/msg/MapMetaData`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    map_load_time: builtin_interfaces.Time
    resolution: float
    width: int
    height: int
    origin: geometry_msgs.Pose
    def __init__(
        self,
        map_load_time: builtin_interfaces.Time = ...,
        resolution: float = ...,
        width: int = ...,
        height: int = ...,
        origin: geometry_msgs.Pose = ...,
    ) -> None: ...

class OccupancyGrid:
    """The ROS 2 message `nav_msgs/msg/OccupancyGrid`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    info: MapMetaData
    @property
    def data(self) -> NDArray[np.int8]: ...
    @data.setter
    def data(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        info: MapMetaData = ...,
        data: ArrayLike = ...,
    ) -> None: ...

class Odometry:
    """The ROS 2 message `nav_msgs/msg/Odometry`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    child_frame_id: str
    pose: geometry_msgs.PoseWithCovariance
    twist: geometry_msgs.TwistWithCovariance
    def __init__(
        self,
        header: std_msgs.Header = ...,
        child_frame_id: str = ...,
        pose: geometry_msgs.PoseWithCovariance = ...,
        twist: geometry_msgs.TwistWithCovariance = ...,
    ) -> None: ...

class Path:
    """The ROS 2 message `nav_msgs/msg/Path`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    poses: list[geometry_msgs.PoseStamped]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        poses: list[geometry_msgs.PoseStamped] = ...,
    ) -> None: ...
