"""The message types of `map_msgs`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import std_msgs

class OccupancyGridUpdate:
    """The ROS 2 message `map_msgs/msg/OccupancyGridUpdate`."""

    __msgtype__: ClassVar[str]
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
    header: std_msgs.Header
    x: int
    y: int
    width: int
    height: int
    @property
    def data(self) -> NDArray[np.int8]: ...
    @data.setter
    def data(self, value: ArrayLike) -> None: ...
    def __init__(
        self,
        header: std_msgs.Header = ...,
        x: int = ...,
        y: int = ...,
        width: int = ...,
        height: int = ...,
        data: ArrayLike = ...,
    ) -> None: ...
