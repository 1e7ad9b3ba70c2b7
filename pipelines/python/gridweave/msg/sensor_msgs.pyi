"""The message types of `sensor_msgs`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import geometry_msgs, std_msgs

class CameraInfo:
    """The ROS 2 message `sensor_msgs/msg/CameraInfo`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    height: int
    width: int
    distortion_model: str
    @property
    def d(self) -> NDArray[np.float64]: ...
    @d.setter
    def d(self, value: ArrayLike) -> None: ...
    @property
    def k(self) -> NDArray[np.float64]: ...
    @k.setter
    def k(self, value: ArrayLike) -> None: ...
    @property
    def r(self) -> NDArray[np.float64]: ...
    @r.setter
    def r(self, value: ArrayLike) -> None: ...
    @property
    def p(self) -> NDArray[np.float64]: ...
    @p.setter
    def p(self, value: ArrayLike) -> None: ...
    binning_x: int
    binning_y: int
    roi: RegionOfInterest
    def __init__(
        self,
        header: std_msgs.Header = ...,
        height: int = ...,
        width: int = ...,
        distortion_model: str = ...,
        d: ArrayLike = ...,
        k: ArrayLike = ...,
        r: ArrayLike = ...,
        p: ArrayLike = ...,
        binning_x: int = ...,
        binning_y: int = ...,
        roi: RegionOfInterest = ...,
    ) -> None: ...

class CompressedImage:
    """The ROS 2 message `sensor_msgs/msg/CompressedImage`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    format: str
    @property
    def data(self) -> NDArray[np.uint8]: ...
    @data.setter
    def data(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        format: str = ...,
        data: ArrayLike = ...,
    ) -> None: ...

class Image:
    """The ROS 2 message `sensor_msgs/msg/Image`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    @property
    def data(self) -> NDArray[np.uint8]: ...
    @data.setter
    def data(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        height: int = ...,
        width: int = ...,
        encoding: str = ...,
        is_bigendian: int = ...,
        step: int = ...,
        data: ArrayLike = ...,
    ) -> None: ...

class Imu:
    """The ROS 2 message `sensor_msgs/msg/Imu`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    orientation: geometry_msgs.Quaternion
    @property
    def orientation_covariance(self) -> NDArray[np.float64]: ...
    @orientation_covariance.setter
    def orientation_covariance(self, value: ArrayLike) -> None: ...
    angular_velocity: geometry_msgs.Vector3
    @property
    def angular_velocity_covariance(self) -> NDArray[np.float64]: ...
    @angular_velocity_covariance.setter
    def angular_velocity_covariance(self, value: ArrayLike) -> None: ...
    linear_acceleration: geometry_msgs.Vector3
    @property
    def linear_acceleration_covariance(self) -> NDArray[np.float64]: ...
    @linear_acceleration_covariance.setter
    def linear_acceleration_covariance(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        orientation: geometry_msgs.Quaternion = ...,
        orientation_covariance: ArrayLike = ...,
        angular_velocity: geometry_msgs.Vector3 = ...,
        angular_velocity_covariance: ArrayLike = ...,
        linear_acceleration: geometry_msgs.Vector3 = ...,
        linear_acceleration_covariance: ArrayLike = ...,
    ) -> None: ...

class JointState:
    """The ROS 2 message `sensor_msgs/msg/JointState`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    name: list[str]
    @property
    def position(self) -> NDArray[np.float64]: ...
    @position.setter
    def position(self, value: ArrayLike) -> None: ...
    @property
    def velocity(self) -> NDArray[np.float64]: ...
    @velocity.setter
    def velocity(self, value: ArrayLike) -> None: ...
    @property
    def effort(self) -> NDArray[np.float64]: ...
    @effort.setter
    def effort(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        name: list[str] = ...,
        position: ArrayLike = ...,
        velocity: ArrayLike = ...,
        effort: ArrayLike = ...,
    ) -> None: ...

class LaserEcho:
    """The ROS 2 message `sensor_msgs/msg/LaserEcho`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    @property
    def echoes(self) -> NDArray[np.float32]: ...
    @echoes.setter
    def echoes(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        echoes: ArrayLike = ...,
    ) -> None: ...

class LaserScan:
    """The ROS 2 message `sensor_msgs/msg/LaserScan`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    angle_min: float
    angle_max: float
    angle_increment: float
    time_increment: float
    scan_time: float
    range_min: float
    range_max: float
    @property
    def ranges(self) -> NDArray[np.float32]: ...
    @ranges.setter
    def ranges(self, value: ArrayLike) -> None: ...
    @property
    def intensities(self) -> NDArray[np.float32]: ...
    @intensities.setter
    def intensities(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        angle_min: float = ...,
        angle_max: float = ...,
        angle_increment: float = ...,
        time_increment: float = ...,
        scan_time: float = ...,
        range_min: float = ...,
        range_max: float = ...,
        ranges: ArrayLike = ...,
        intensities: ArrayLike = ...,
    ) -> None: ...

class MagneticField:
    """The ROS 2 message `sensor_msgs/msg/MagneticField`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    magnetic_field: geometry_msgs.Vector3
    @property
    def magnetic_field_covariance(self) -> NDArray[np.float64]: ...
    @magnetic_field_covariance.setter
    def magnetic_field_covariance(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        magnetic_field: geometry_msgs.Vector3 = ...,
        magnetic_field_covariance: ArrayLike = ...,
    ) -> None: ...

class MultiEchoLaserScan:
    """The ROS 2 message `sensor_msgs/msg/MultiEchoLaserScan`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    angle_min: float
    angle_max: float
    angle_increment: float
    time_increment: float
    scan_time: float
    range_min: float
    range_max: float
    ranges: list[LaserEcho]
    intensities: list[LaserEcho]
    def __init__(
        self,
        header: std_msgs.Header = ...,
        angle_min: float = ...,
        angle_max: float = ...,
        angle_increment: float = ...,
        time_increment: float = ...,
        scan_time: float = ...,
        range_min: float = ...,
        range_max: float = ...,
        ranges: list[LaserEcho] = ...,
        intensities: list[LaserEcho] = ...,
    ) -> None: ...

class NavSatFix:
    """The ROS 2 message `sensor_msgs/msg/NavSatFix`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    COVARIANCE_TYPE_UNKNOWN: ClassVar[int]
    COVARIANCE_TYPE_APPROXIMATED: ClassVar[int]
    COVARIANCE_TYPE_DIAGONAL_KNOWN: ClassVar[int]
    COVARIANCE_TYPE_KNOWN: ClassVar[int]
    header: std_msgs.Header
    status: NavSatStatus
    latitude: float
    longitude: float
    altitude: float
    @property
    def position_covariance(self) -> NDArray[np.float64]: ...
    @position_covariance.setter
    def position_covariance(self, value: ArrayLike) -> None: ...
    position_covariance_type: int
    def __init__(
        self,
        header: std_msgs.Header = ...,
        status: NavSatStatus = ...,
        latitude: float = ...,
        longitude: float = ...,
        altitude: float = ...,
        position_covariance: ArrayLike = ...,
        position_covariance_type: int = ...,
    ) -> None: ...

class NavSatStatus:
    """The ROS 2 message `sensor_msgs/msg/NavSatStatus`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    STATUS_NO_FIX: ClassVar[int]
    STATUS_FIX: ClassVar[int]
    STATUS_SBAS_FIX: ClassVar[int]
    STATUS_GBAS_FIX: ClassVar[int]
    SERVICE_GPS: ClassVar[int]
    SERVICE_GLONASS: ClassVar[int]
    SERVICE_COMPASS: ClassVar[int]
    SERVICE_GALILEO: ClassVar[int]
    status: int
    service: int
    def __init__(
        self,
        status: int = ...,
        service: int = ...,
    ) -> None: ...

class PointCloud2:
    """The ROS 2 message `sensor_msgs/msg/PointCloud2`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    height: int
    width: int
    fields: list[PointField]
    is_bigendian: bool
    point_step: int
    row_step: int
    @property
    def data(self) -> NDArray[np.uint8]: ...
    @data.setter
    def data(self, value: ArrayLike) -> None: ...
    is_dense: bool
    def __init__(
        self,
        header: std_msgs.Header = ...,
        height: int = ...,
        width: int = ...,
        fields: list[PointField] = ...,
        is_bigendian: bool = ...,
        point_step: int = ...,
        row_step: int = ...,
        data: ArrayLike = ...,
        is_dense: bool = ...,
    ) -> None: ...

class PointField:
    """The ROS 2 message `sensor_msgs/msg/PointField`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    INT8: ClassVar[int]
    UINT8: ClassVar[int]
    INT16: ClassVar[int]
    UINT16: ClassVar[int]
    INT32: ClassVar[int]
    UINT32: ClassVar[int]
    FLOAT32: ClassVar[int]
    FLOAT64: ClassVar[int]
    name: str
    offset: int
    datatype: int
    count: int
    def __init__(
        self,
        name: str = ...,
        offset: int = ...,
        datatype: int = ...,
        count: int = ...,
    ) -> None: ...

class Range:
    """The ROS 2 message `sensor_msgs/msg/Range`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    ULTRASOUND: ClassVar[int]
    INFRARED: ClassVar[int]
    header: std_msgs.Header
    radiation_type: int
    field_of_view: float
    min_range: float
    max_range: float
    range: float
    def __init__(
        self,
        header: std_msgs.Header = ...,
        radiation_type: int = ...,
        field_of_view: float = ...,
        min_range: float = ...,
        max_range: float = ...,
        range: float = ...,
    ) -> None: ...

class RegionOfInterest:
    """The ROS 2 message `sensor_msgs/msg/RegionOfInterest`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    x_offset: int
    y_offset: int
    height: int
    width: int
    do_rectify: bool
    def __init__(
        self,
        x_offset: int = ...,
        y_offset: int = ...,
        height: int = ...,
        width: int = ...,
        do_rectify: bool = ...,
    ) -> None: ...
