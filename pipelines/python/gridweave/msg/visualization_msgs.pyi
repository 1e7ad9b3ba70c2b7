"""The message types of `visualization_msgs`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import builtin_interfaces, geometry_msgs, sensor_msgs, std_msgs

class Marker:
    """The ROS 2 message `visualization_msgs/msg/Marker`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    ARROW: ClassVar[int]
    CUBE: ClassVar[int]
    SPHERE: ClassVar[int]
    CYLINDER: ClassVar[int]
    LINE_STRIP: ClassVar[int]
    LINE_LIST: ClassVar[int]
    CUBE_LIST: ClassVar[int]
    SPHERE_LIST: ClassVar[int]
    POINTS: ClassVar[int]
    TEXT_VIEW_FACING: ClassVar[int]
    MESH_RESOURCE: ClassVar[int]
    TRIANGLE_LIST: ClassVar[int]
    ARROW_STRIP: ClassVar[int]
    ADD: ClassVar[int]
    MODIFY: ClassVar[int]
    DELETE: ClassVar[int]
    DELETEALL: ClassVar[int]
    header: std_msgs.Header
    ns: str
    id: int
    type: int
    action: int
    pose: geometry_msgs.Pose
    scale: geometry_msgs.Vector3
    color: std_msgs.ColorRGBA
    lifetime: builtin_interfaces.Duration
    frame_locked: bool
    points: list[geometry_msgs.Point]
    colors: list[std_msgs.ColorRGBA]
    texture_resource: str
    texture: sensor_msgs.CompressedImage
    uv_coordinates: list[UVCoordinate]
    text: str
    mesh_resource: str
    mesh_file: MeshFile
    mesh_use_embedded_materials: bool
    def __init__(
        self,
        header: std_msgs.Header = ...,
        ns: str = ...,
        id: int = ...,
        type: int = ...,
        action: int = ...,
        pose: geometry_msgs.Pose = ...,
        scale: geometry_msgs.Vector3 = ...,
        color: std_msgs.ColorRGBA = ...,
        lifetime: builtin_interfaces.Duration = ...,
        frame_locked: bool = ...,
        points: list[geometry_msgs.Point] = ...,
        colors: list[std_msgs.ColorRGBA] = ...,
        texture_resource: str = ...,
        texture: sensor_msgs.CompressedImage = ...,
        uv_coordinates: list[UVCoordinate] = ...,
        text: str = ...,
        mesh_resource: str = ...,
        mesh_file: MeshFile = ...,
        mesh_use_embedded_materials: bool = ...,
    ) -> None: ...

class MarkerArray:
    """The ROS 2 message `visualization_msgs/msg/MarkerArray`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    markers: list[Marker]
    def __init__(
        self,
        markers: list[Marker] = ...,
    ) -> None: ...

class MeshFile:
    """The ROS 2 message `visualization_msgs/msg/MeshFile`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    filename: str
    @property
    def data(self) -> NDArray[np.uint8]: ...
    @data.setter
    def data(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        filename: str = ...,
        data: ArrayLike = ...,
    ) -> None: ...

class UVCoordinate:
    """The ROS 2 message `visualization_msgs/msg/UVCoordinate`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    u: float
    v: float
    def __init__(
        self,
        u: float = ...,
        v: float = ...,
    ) -> None: ...
