"""The message types of `builtin_interfaces`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

class Duration:
    """The ROS 2 message `builtin_interfaces/msg/Duration`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    sec: int
    nanosec: int
    def __init__(
        self,
        sec: int = ...,
        nanosec: int = ...,
    ) -> None: ...

class Time:
    """The ROS 2 message `builtin_interfaces/msg/Time`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    sec: int
    nanosec: int
    def __init__(
        self,
        sec: int = ...,
        nanosec: int = ...,
    ) -> None: ...
