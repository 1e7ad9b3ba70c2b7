"""The message types of `std_msgs`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

from . import builtin_interfaces

class Bool:
    """The ROS 2 message `std_msgs/msg/Bool`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    data: bool
    def __init__(
        self,
        data: bool = ...,
    ) -> None: ...

class ColorRGBA:
    """The ROS 2 message `std_msgs/msg/ColorRGBA`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    r: float
    g: float
    b: float
    a: float
    def __init__(
        self,
        r: float = ...,
        g: float = ...,
        b: float = ...,
        a: float = ...,
    ) -> None: ...

class Empty:
    """The ROS 2 message `std_msgs/msg/Empty`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    structure_needs_at_least_one_member: int
    def __init__(
        self,
        structure_needs_at_least_one_member: int = ...,
    ) -> None: ...

class Float32:
    """The ROS 2 message `std_msgs/msg/Float32`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    data: float
    def __init__(
        self,
        data: float = ...,
    ) -> None: ...

class Float64:
    """The ROS 2 message `std_msgs/msg/Float64`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    data: float
    def __init__(
        self,
        data: float = ...,
    ) -> None: ...

class Header:
    """The ROS 2 message `std_msgs/msg/Header`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    stamp: builtin_interfaces.Time
    frame_id: str
    def __init__(
        self,
        stamp: builtin_interfaces.Time = ...,
        frame_id: str = ...,
    ) -> None: ...

class Int32:
    """The ROS 2 message `std_msgs/msg/Int32`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    data: int
    def __init__(
        self,
        data: int = ...,
    ) -> None: ...

class String:
    """The ROS 2 message `std_msgs/msg/String`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    data: str
    def __init__(
        self,
        data: str = ...,
    ) -> None: ...
