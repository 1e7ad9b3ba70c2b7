"""The message types of `tf2_msgs`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

from . import geometry_msgs

class TFMessage:
    """The ROS 2 message `tf2_msgs/msg/TFMessage`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    transforms: list[geometry_msgs.TransformStamped]
    def __init__(
        self,
        transforms: list[geometry_msgs.TransformStamped] = ...,
    ) -> None: ...
