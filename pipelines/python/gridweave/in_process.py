"""A stage in this process, as the native part calls it."""

import contextlib
import json
from typing import Any, Iterator

from rosbags.serde import SerdeError

from .msg import decode, encode
from .stages import About, Context, Input, Stage

#: What a call returns: the sent messages (output, robot, log time, bytes), the warnings, and whether a source has ended.
Sent = tuple[list[tuple[int, str, int, bytes]], list[str], bool]


class InProcess:
    """A stage with what it has sent and not handed over yet. What it raises is also put into ``raised``."""

    def __init__(self, made: type[Stage], raised: list[Exception], request: str):
        self._raised = raised
        with self._noted():
            self._begin(made, request)

    def _begin(self, made: type[Stage], request: str) -> None:
        asked = json.loads(request)
        self._sent: list[tuple[int, str, int, bytes]] = []
        self._warnings: list[str] = []
        self._outputs = {output["name"]: number for number, output in enumerate(made.interface()["outputs"])}
        context = Context(asked["stage"], asked["seed"], asked["reference"], asked["robots"], tuple(asked["inputs"]))
        self._stage = made.begin(asked["parameters"], context, self._send, self._warnings.append)
        self._inputs = [(name, port.type, getattr(self._stage, f"on_{name}")) for name, port in made._members(Input).items()]
        self._messages = self._stage.messages() if made._is_source() else iter(())  # type: ignore[attr-defined]

    @contextlib.contextmanager
    def _noted(self) -> Iterator[None]:
        """Keeps an exception of the stage for who has started the run: the native part hands over its text alone."""
        try:
            yield
        except Exception as error:
            self._raised.append(error)
            raise

    def _send(self, output: str, message: Any, robot: str, log_time: int = 0) -> None:
        self._sent.append((self._outputs[output], robot, log_time, encode(message)))

    def _taken(self, has_ended: bool = False) -> Sent:
        taken = (self._sent, list(self._warnings), has_ended)
        self._sent = []
        self._warnings.clear()
        return taken

    def receive(self, port: int, robot: str, log_time: int, topic: str, wire: int, data: bytes) -> Sent:
        """Hands a message to the stage. One that cannot be read is left out with a warning."""
        name, message_type, take = self._inputs[port]
        try:
            message = decode(message_type, memoryview(data))
        except (SerdeError, AssertionError, IndexError, TypeError) as error:
            self._warnings.append(f"messages on the input `{name}` that cannot be read are left out: {error}")
        else:
            with self._noted():
                take(message, About(robot, log_time, topic, wire))
        return self._taken()

    def advance(self) -> Sent:
        """Lets a source send what comes next."""
        with self._noted():
            try:
                next(self._messages)
            except StopIteration:
                return self._taken(has_ended=True)
        return self._taken()

    def finish(self) -> Sent:
        """All inputs have ended."""
        with self._noted():
            self._stage.finish()
        return self._taken()

    def abort(self, reason: str) -> None:
        """The run has failed elsewhere."""
        self._stage.abort(reason)
