"""What a stage is: its ports and parameters, and what it does with a message."""

import functools
import inspect
import operator
import typing
from dataclasses import dataclass
from typing import Any, Callable, TypeVar

from .msg import definition, ros_type

#: The version of the protocol of a call, in which the stage is spoken to.
PROTOCOL = 1

_JSON_TYPES = {float: "number", int: "integer", str: "string", bool: "boolean"}


@dataclass(frozen=True)
class Input:
    """An input, for messages of one type. A method ``on_NAME(self, message, about)`` is given each message that comes in on it.

    Attributes:
        type: The type of its messages.
        summary: What it is for.
        many: Whether any number of outputs may be wired to it; otherwise it is one.
        optional: Whether it may be left unwired.
    """

    type: type
    summary: str = ""
    many: bool = False
    optional: bool = False


class Output:
    """An output, for messages of one type."""

    def __init__(self, type: type, summary: str = "", *, topic: str | None = None, side: bool = False):
        """
        Args:
            type: The type of its messages.
            summary: What it is for.
            topic: The topic of its messages in a log, with ``{robot}`` and ``{stage}`` as placeholders; by default
                ``/{robot}/{stage}/NAME``.
            side: Whether the output is beside what the stage is for: the name of a stage alone does not mean it.
        """
        self.type, self.summary, self.topic, self.side = type, summary, topic, side
        self._send: Callable[..., None] | None = None

    def send(self, message: Any, robot: str = "", log_time: int | None = None) -> None:
        """Sends a message about ``robot`` (empty: about none in particular). Its log time is that of the message that is handled; a
        source, which handles none, sets ``log_time``: nanoseconds, which never fall.
        """
        if type(message) is not self.type:
            raise TypeError(f"this output takes {ros_type(self.type)}, not {type(message).__name__}")
        if self._send is None:
            raise RuntimeError("a stage sends through its own outputs, as `self.NAME.send(...)`")
        self._send(message, robot, log_time)

    def _tied(self, send: Callable[..., None]) -> "Output":
        tied = Output(self.type, self.summary, topic=self.topic, side=self.side)
        tied._send = send
        return tied


@dataclass(frozen=True)
class Parameter:
    """A parameter of a stage, which a pipeline file may set; in the stage it is the value. It is of the type of its default.

    Attributes:
        default: Its value where none is set: a number, a text, true or false, or a list of one of these.
        summary: What it means, with its unit: metres, radians, seconds.
        minimum: The least value.
        maximum: The greatest value.
        above: Values are greater than this.
        below: Values are less than this.
        choices: The only values that a text may have.
    """

    default: Any
    summary: str = ""
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None
    below: float | None = None
    choices: tuple[str, ...] | None = None

    def schema(self) -> dict[str, Any]:
        """Its JSON schema."""
        schema = _schema_of(self.default) | {"default": self.default, "description": self.summary}
        limited = schema["items"] if schema["type"] == "array" else schema
        limits = {"minimum": self.minimum, "maximum": self.maximum, "exclusiveMinimum": self.above,
                  "exclusiveMaximum": self.below, "enum": self.choices and list(self.choices)}
        limited |= {name: limit for name, limit in limits.items() if limit is not None}
        return schema

    def value(self, given: Any) -> Any:
        """A given value as the stage has it: a whole number is accepted for one with a fraction."""
        if isinstance(self.default, float):
            return float(given)
        if isinstance(self.default, list) and self.default and isinstance(self.default[0], float):
            return [float(item) for item in given]
        return given


def _schema_of(default: Any) -> dict[str, Any]:
    if isinstance(default, list) and default:
        return {"type": "array", "items": _schema_of(default[0])}
    if type(default) in _JSON_TYPES:
        return {"type": _JSON_TYPES[type(default)]}
    raise TypeError(f"a parameter is a number, a text, true or false, or a list of such that is not empty, not {default!r}")


@dataclass(frozen=True)
class About:
    """Metadata of a message.

    Attributes:
        robot: The robot that it is about; empty if it is about none in particular.
        log_time: When it was logged, nanoseconds.
        topic: The topic that it has, or will have, in a log.
        wire: Which of the stage's wires it came on, as an index into `Context.inputs`.
    """

    robot: str
    log_time: int
    topic: str
    wire: int


@dataclass(frozen=True)
class Context:
    """Context of a stage in its pipeline.

    Attributes:
        stage: The stage's name in the pipeline.
        seed: Seeds the stage's randomness: ``numpy.random.default_rng(self.context.seed)``.
        reference: The robot whose map frame is the world, if the pipeline says so.
        robots: Topics of each robot, as in the section ``[robots]``.
        inputs: What is wired to the stage, each with ``port``, ``from``, ``type`` and ``topic``.
    """

    stage: str = ""
    seed: int = 0
    reference: str | None = None
    robots: dict[str, Any] | None = None
    inputs: tuple[dict[str, str], ...] = ()


class Stage:
    """A stage: `Input`, `Output` and `Parameter` objects as attributes of the class, and a method ``on_NAME`` for each input.

    For example::

        class Corners(Stage):
            \"\"\"Sends the pose of each map's corner.\"\"\"
            map = Input(OccupancyGrid, "the robots' maps")
            corner = Output(PoseStamped, "the pose of the outer corner of cell (0, 0)")
            height = Parameter(0.0, "how high above the map it lies, metres")

            def on_map(self, map, about):
                self.corner.send(PoseStamped(map.header, map.info.origin), about.robot)

    One without inputs is a source, and has a generator ``messages(self)`` instead: it sends with ``log_time``, and yields after each
    message or after a few that belong together.

    The first line of its documentation is what ``gridweave kinds`` shows. ``__init__`` takes nothing and may use the parameters and
    ``self.context``. A stage keeps its state itself, and reads no clock: what it sends follows from what it was given, so that a replay
    gives the same output each time.
    """

    context: Context

    def finish(self) -> None:
        """All inputs have ended. What is sent here has the last log time of the inputs. It is not called for a source."""

    def abort(self, reason: str) -> None:
        """The run has failed elsewhere: leave what was made in a state that can be used."""

    def warn(self, what: str) -> None:
        """Counts something that is wrong with the input and that the stage can live with. The summary shows each text with its
        count."""
        self._warn(what)

    _warn: Callable[[str], None] = staticmethod(lambda what: None)

    @classmethod
    def _members(cls, kind: type) -> dict[str, Any]:
        members: dict[str, Any] = {}
        for base in reversed(cls.__mro__):
            members |= {name: member for name, member in vars(base).items() if isinstance(member, kind)}
        return members

    @classmethod
    def _is_source(cls) -> bool:
        return not cls._members(Input)

    @classmethod
    def interface(cls) -> dict[str, Any]:
        """The ports and parameters as JSON, for the program that runs a pipeline."""
        for name in cls._members(Input):
            if not callable(getattr(cls, f"on_{name}", None)):
                raise TypeError(f"{cls.__name__} has an input `{name}`, and no method on_{name}(self, message, about)")
        handlers = [name[3:] for name in dir(cls) if name.startswith("on_")]
        for name in handlers:
            if name not in cls._members(Input):
                raise TypeError(f"{cls.__name__} has a method on_{name}, and no input `{name}`")
        makes = getattr(cls, "messages", None)
        if cls._is_source() and not inspect.isgeneratorfunction(makes):
            raise TypeError(f"{cls.__name__} has no inputs, so it is a source, which has a generator messages(self): one that yields")
        inputs = [{"name": name, "type": ros_type(port.type), "many": port.many, "optional": port.optional,
                   "summary": port.summary} for name, port in cls._members(Input).items()]
        outputs = [{"name": name, "type": ros_type(port.type), "topic": port.topic, "side": port.side,
                    "summary": port.summary} for name, port in cls._members(Output).items()]
        properties = {name: parameter.schema() for name, parameter in cls._members(Parameter).items()}
        summary = " ".join(inspect.cleandoc(cls.__dict__.get("__doc__") or cls.__name__).split("\n\n")[0].split())
        interface = {"protocol": PROTOCOL, "name": cls.__name__, "summary": summary, "inputs": inputs, "outputs": outputs,
                     "parameters": {"type": "object", "properties": properties, "additionalProperties": False}}
        own = {port["type"]: text for port in inputs + outputs if (text := definition(port["type"])) is not None}
        return interface | ({"definitions": own} if own else {})

    @classmethod
    def begin(cls, parameters: dict[str, Any] | None = None, context: Context | None = None,
              send: Callable[..., None] = lambda output, message, robot, log_time=None: None,
              warn: Callable[[str], None] = lambda what: None) -> "Stage":
        """Makes the stage as a pipeline does, for tests of a stage by itself.

        Args:
            parameters: Its parameters by their names; the others have their defaults.
            context: Its context.
            send: Takes its messages: the name of the output, the message, the robot and, of a source, the log time.
            warn: Takes its warnings.
        """
        made = cls.__new__(cls)
        known = cls._members(Parameter)
        given = parameters or {}
        if unknown := sorted(set(given) - set(known)):
            raise TypeError(f"{cls.__name__} has no parameter `{unknown[0]}`")
        for name, parameter in known.items():
            setattr(made, name, parameter.value(given.get(name, parameter.default)))
        timed = _rising if cls._is_source() else _untimed
        send = timed(send)
        for name, output in cls._members(Output).items():
            setattr(made, name, output._tied(functools.partial(send, name)))
        made._warn = warn
        made.context = context or Context()
        made.__init__()  # type: ignore[misc]  # that of a stage takes nothing
        return made


def _untimed(send: Callable[..., None]) -> Callable[..., None]:
    """How a stage with inputs sends."""
    def checked(output: str, message: Any, robot: str, log_time: int | None) -> None:
        if log_time is not None:
            raise TypeError("only a source sets log times: messages of other stages have that of the message that they handle")
        send(output, message, robot)

    return checked


def _rising(send: Callable[..., None]) -> Callable[..., None]:
    """How a source sends."""
    reached = 0

    def checked(output: str, message: Any, robot: str, log_time: int | None) -> None:
        nonlocal reached
        if log_time is None:
            raise TypeError("a source sets the log time of a message: send(message, robot, log_time=NANOSECONDS)")
        log_time = operator.index(log_time)
        if not reached <= log_time < 1 << 64:
            raise ValueError(f"the log time {log_time} ns comes after {reached} ns: those of a source never fall, and fit in 64 bits")
        reached = log_time
        send(output, message, robot, log_time)

    return checked


Function = TypeVar("Function", bound=Callable[..., Any])


@typing.overload
def stage(function: Function, *, output: str = "out") -> Function: ...


@typing.overload
def stage(*, output: str = "out") -> Callable[[Function], Function]: ...


def stage(function: Any = None, *, output: str = "out") -> Any:
    """Makes a stage of a function: its first argument is the input, its result goes to the output, and its keyword arguments are
    parameters.

    The types of the argument and of the result are message types. A result of None sends nothing, and of a list each of its
    messages. What is sent is about the robot that the input was about. A second argument is given the `About` of the message. The
    function itself stays as it was. ``output`` is the name of the output.
    """
    if function is None:
        return lambda function: _stage_of(function, output)
    return _stage_of(function, output)


def _stage_of(function: Any, output: str) -> Any:
    """Makes a stage of a function, see `stage`."""
    arguments = list(inspect.signature(function).parameters.values())
    hints = typing.get_type_hints(function)
    positional = [argument for argument in arguments if argument.kind is argument.POSITIONAL_OR_KEYWORD]
    keywords = [argument for argument in arguments if argument.kind is argument.KEYWORD_ONLY]
    name = function.__name__
    if not 1 <= len(positional) <= 2 or len(positional) + len(keywords) != len(arguments):
        raise TypeError(f"{name} must have one input, an `about` if it likes, and parameters behind a `*`")
    message = positional[0].name
    if message not in hints or "return" not in hints:
        raise TypeError(f"{name} must declare the types of its input and of its result, such as (map: OccupancyGrid) -> Segments")
    for keyword in keywords:
        if keyword.default is keyword.empty:
            raise TypeError(f"the parameter `{keyword.name}` of {name} has no default")

    def on_message(self: Stage, received: Any, about: About) -> None:
        values = {keyword.name: getattr(self, keyword.name) for keyword in keywords}
        result = function(received, *[about][: len(positional) - 1], **values)
        for sent in result if isinstance(result, list) else [result]:
            if sent is not None:
                getattr(self, output).send(sent, about.robot)

    members: dict[str, Any] = {keyword.name: Parameter(keyword.default) for keyword in keywords}
    members |= {message: Input(hints[message]), output: Output(_sent_type(hints["return"])), f"on_{message}": on_message,
                "__doc__": function.__doc__, "__module__": function.__module__}
    function.__gridweave_stage__ = type(name, (Stage,), members)
    return function


def _sent_type(hint: Any) -> type:
    """The message type of a result that may be None, or a list."""
    given = [item for item in typing.get_args(hint) if item is not type(None)]
    return _sent_type(given[0]) if given else hint
