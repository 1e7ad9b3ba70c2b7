"""The message types of `rosgraph_msgs`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

from . import builtin_interfaces

class Clock:
    """The ROS 2 message `rosgraph_msgs/msg/Clock`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    clock: builtin_interfaces.Time
    def __init__(
        self,
        clock: builtin_interfaces.Time = ...,
    ) -> None: ...
