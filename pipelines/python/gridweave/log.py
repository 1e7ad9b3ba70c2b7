"""Reading logs."""

import functools
import warnings
from dataclasses import dataclass, field
from typing import Any, Iterable, Iterator

from . import _native
from .request import FilePath, paths_of


@dataclass(frozen=True, eq=False)
class LoggedMessage:
    """A message of a log.

    Attributes:
        topic: Its topic.
        type: Its type, such as ``nav_msgs/msg/OccupancyGrid``.
        log_time: When it was logged, nanoseconds.
        publish_time: When it was sent, nanoseconds.
        encoding: Its encoding; ``cdr`` for the messages of ROS, also for those of ROS 1 bags.
        data: Its bytes.
    """

    topic: str
    type: str
    log_time: int
    publish_time: int
    encoding: str
    data: bytes = field(repr=False)
    _definition: str = field(repr=False)

    @functools.cached_property
    def message(self) -> Any:
        """The decoded message: a dataclass as those in `gridweave.msg`, made from the definition in the log."""
        from . import msg

        if self.encoding != "cdr":
            raise _native.GridweaveError(f"messages on {self.topic} are encoded as {self.encoding or 'nothing known'}, and not as CDR")
        return msg.decode_as(self.type, self._definition, self.data)


def read_log(logs: FilePath | Iterable[FilePath], topics: str | Iterable[str] | None = None) -> Iterator[LoggedMessage]:
    """Iterates over the messages of logs (MCAP, rosbag2, ROS 1 bags) in log time order.

    A damaged log is read as far as it goes, with a warning at the end; so is there one of topics without a message.

    Args:
        logs: The log, or several.
        topics: The topic, or several; by default all.

    Raises:
        RequestError: What is given is no path, or no topic.
        GridweaveError: A log cannot be opened.
    """
    paths = paths_of(logs)
    wanted = None if topics is None else _topics_of(topics)
    return _messages(_native.LogMessages(paths), wanted)


def _topics_of(topics: Any) -> list[str]:
    try:
        listed = [topics] if isinstance(topics, str) else list(topics)
    except TypeError:
        listed = [None]
    if not all(isinstance(topic, str) for topic in listed):
        raise _native.RequestError(f'`topics` are texts, such as ["/robot1/map"], and not {topics!r}')
    return listed


def _messages(messages: _native.LogMessages, topics: list[str] | None) -> Iterator[LoggedMessage]:
    missed = dict.fromkeys(topics or [])
    for topic, type_name, encoding, definition, log_time, publish_time, data in messages:
        if topics is None or topic in topics:
            missed.pop(topic, None)
            yield LoggedMessage(topic, _full(type_name), log_time, publish_time, encoding, data, definition)
    for damage in messages.damage():
        warnings.warn(damage, stacklevel=2)
    if missed:
        warnings.warn(f"no message was read on {', '.join(missed)}", stacklevel=2)


def _full(name: str) -> str:
    """The name of a type in ROS 2; ROS 1 has no `msg` in it."""
    parts = name.split("/")
    return "/".join([parts[0], "msg", parts[1]]) if len(parts) == 2 else name
