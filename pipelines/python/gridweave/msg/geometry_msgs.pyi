"""The message types of `geometry_msgs`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import std_msgs

class Accel:
    """The ROS 2 message `geometry_msgs/msg/Accel`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    linear: Vector3
    angular: Vector3
    def __init__(
        self,
        linear: Vector3 = ...,
        angular: Vector3 = ...,
    ) -> None: ...

class AccelStamped:
    """The ROS 2 message `geometry_msgs/msg/AccelStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    accel: Accel
    def __init__(
        self,
        header: std_msgs.Header = ...,
        accel: Accel = ...,
    ) -> None: ...

class Point:
    """The ROS 2 message `geometry_msgs/msg/Point`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    x: float
    y: float
    z: float
    def __init__(
        self,
        x: float = ...,
        y: float = ...,
        z: float = ...,
    ) -> None: ...

class Point32:
    """The ROS 2 message `geometry_msgs/msg/Point32`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    x: float
    y: float
    z: float
    def __init__(
        self,
        x: float = ...,
        y: float = ...,
        z: float = ...,
    ) -> None: ...

class PointStamped:
    """The ROS 2 message `geometry_msgs/msg/PointStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    point: Point
    def __init__(
        self,
        header: std_msgs.Header = ...,
        point: Point = ...,
    ) -> None: ...

class Polygon:
    """The ROS 2 message `geometry_msgs/msg/Polygon`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    points: list[Point32]
    def __init__(
        self,
        points: list[Point32] = ...,
    ) -> None: ...

class PolygonStamped:
    """The ROS 2 message `geometry_msgs/msg/PolygonStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    polygon: Polygon
    def __init__(
        self,
        header: std_msgs.Header = ...,
        polygon: Polygon = ...,
    ) -> None: ...

class Pose:
    """The ROS 2 message `geometry_msgs/msg/Pose`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    position: Point
    orientation: Quaternion
    def __init__(
        self,
        position: Point = ...,
        orientation: Quaternion = ...,
    ) -> None: ...

class PoseArray:
    """The ROS 2 message `geometry_msgs/msg/PoseArray`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    poses: list[Pose]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        poses: list[Pose] = ...,
    ) -> None: ...

class PoseStamped:
    """The ROS 2 message `geometry_msgs/msg/PoseStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    pose: Pose
    def __init__(
        self,
        header: std_msgs.Header = ...,
        pose: Pose = ...,
    ) -> None: ...

class PoseWithCovariance:
    """The ROS 2 message `geometry_msgs/msg/PoseWithCovariance`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    pose: Pose
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @covariance.setter
    def covariance(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        pose: Pose = ...,
        covariance: ArrayLike = ...,
    ) -> None: ...

class PoseWithCovarianceStamped:
    """The ROS 2 message `geometry_msgs/msg/PoseWithCovarianceStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    pose: PoseWithCovariance
    def __init__(
        self,
        header: std_msgs.Header = ...,
        pose: PoseWithCovariance = ...,
    ) -> None: ...

class Quaternion:
    """The ROS 2 message `geometry_msgs/msg/Quaternion`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    x: float
    y: float
    z: float
    w: float
    def __init__(
        self,
        x: float = ...,
        y: float = ...,
        z: float = ...,
        w: float = ...,
    ) -> None: ...

class QuaternionStamped:
    """The ROS 2 message `geometry_msgs/msg/QuaternionStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    quaternion: Quaternion
    def __init__(
        self,
        header: std_msgs.Header = ...,
        quaternion: Quaternion = ...,
    ) -> None: ...

class Transform:
    """The ROS 2 message `geometry_msgs/msg/Transform`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    translation: Vector3
    rotation: Quaternion
    def __init__(
        self,
        translation: Vector3 = ...,
        rotation: Quaternion = ...,
    ) -> None: ...

class TransformStamped:
    """The ROS 2 message `geometry_msgs/msg/TransformStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    child_frame_id: str
    transform: Transform
    def __init__(
        self,
        header: std_msgs.Header = ...,
        child_frame_id: str = ...,
        transform: Transform = ...,
    ) -> None: ...

class Twist:
    """The ROS 2 message `geometry_msgs/msg/Twist`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    linear: Vector3
    angular: Vector3
    def __init__(
        self,
        linear: Vector3 = ...,
        angular: Vector3 = ...,
    ) -> None: ...

class TwistStamped:
    """The ROS 2 message `geometry_msgs/msg/TwistStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    twist: Twist
    def __init__(
        self,
        header: std_msgs.Header = ...,
        twist: Twist = ...,
    ) -> None: ...

class TwistWithCovariance:
    """The ROS 2 message `geometry_msgs/msg/TwistWithCovariance`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    twist: Twist
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @covariance.setter
    def covariance(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        twist: Twist = ...,
        covariance: ArrayLike = ...,
    ) -> None: ...

class TwistWithCovarianceStamped:
    """The ROS 2 message `geometry_msgs/msg/TwistWithCovarianceStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    twist: TwistWithCovariance
    def __init__(
        self,
        header: std_msgs.Header = ...,
        twist: TwistWithCovariance = ...,
    ) -> None: ...

class Vector3:
    """The ROS 2 message `geometry_msgs/msg/Vector3`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    x: float
    y: float
    z: float
    def __init__(
        self,
        x: float = ...,
        y: float = ...,
        z: float = ...,
    ) -> None: ...

class Vector3Stamped:
    """The ROS 2 message `geometry_msgs/msg/Vector3Stamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    vector: Vector3
    def __init__(
        self,
        header: std_msgs.Header = ...,
        vector: Vector3 = ...,
    ) -> None: ...

class Wrench:
    """The ROS 2 message `geometry_msgs/msg/Wrench`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    force: Vector3
    torque: Vector3
    def __init__(
        self,
        force: Vector3 = ...,
        torque: Vector3 = ...,
    ) -> None: ...

class WrenchStamped:
    """The ROS 2 message `geometry_msgs/msg/WrenchStamped`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    wrench: Wrench
    def __init__(
        self,
        header: std_msgs.Header = ...,
        wrench: Wrench = ...,
    ) -> None: ...
