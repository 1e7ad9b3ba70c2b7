"""Reading logs."""

import functools
import warnings
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, Iterable, Iterator

from . import _native


@dataclass(frozen=True, eq=False)
class LoggedMessage:
    """A message of a log."""

    topic: str
    #: Its type, such as ``nav_msgs/msg/OccupancyGrid``.
    type: str
    #: When it was logged, nanoseconds.
    log_time: int
    #: When it was sent, nanoseconds.
    publish_time: int
    #: Its encoding; ``cdr`` for the messages of ROS, also for those of ROS 1 bags.
    encoding: str
    #: Its bytes.
    data: bytes = field(repr=False)
    _definition: str = field(repr=False)

    @functools.cached_property
    def message(self) -> Any:
        """The decoded message: a dataclass as those in `gridweave.msg`, made from the definition in the log."""
        from . import msg

        if self.encoding != "cdr":
            raise _native.GridweaveError(f"messages on {self.topic} are encoded as {self.encoding or 'nothing known'}, and not as CDR")
        return msg.decode_as(self.type, self._definition, self.data)


def read_log(
    logs: str | PathLike[str] | Iterable[str | PathLike[str]], topics: Iterable[str] | None = None
) -> Iterator[LoggedMessage]:
    """Iterates over the messages of logs (MCAP, rosbag2, ROS 1 bags) in log time order; of all topics, or of some.

    A damaged log is read as far as it goes, with a warning at the end.

    Raises:
        GridweaveError: A log cannot be opened.
    """
    paths = [logs] if isinstance(logs, (str, PathLike)) else list(logs)
    messages = _native.LogMessages(paths)
    return _messages(messages, None if topics is None else set(topics))


def _messages(messages: Any, topics: set[str] | None) -> Iterator[LoggedMessage]:
    for topic, type_name, encoding, definition, log_time, publish_time, data in messages:
        if topics is None or topic in topics:
            yield LoggedMessage(topic, _full(type_name), log_time, publish_time, encoding, data, definition)
    for damage in messages.damage():
        warnings.warn(damage, stacklevel=2)


def _full(name: str) -> str:
    """The name of a type in ROS 2; ROS 1 has no `msg` in it."""
    parts = name.split("/")
    return "/".join([parts[0], "msg", parts[1]]) if len(parts) == 2 else name
