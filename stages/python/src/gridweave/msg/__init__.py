"""The message types that stages exchange, as dataclasses made from the `.msg` texts, and their encoding (CDR).

    from gridweave.msg.nav_msgs import OccupancyGrid
    from gridweave.msg.gridweave_msgs import Segment, Segments

Every field has a default: numbers are 0, texts empty, arrays of numbers are numpy arrays of the type that the text says, other
arrays are lists, and messages in messages are such dataclasses. Constants of a text are attributes of its class.

The parser and the encoding are those of the package `rosbags`.
"""

import dataclasses
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

__all__ = ["decode", "encode", "ros_type"]


def _texts() -> Path:
    """The folder of the `.msg` texts: in the package or, where it runs from the repository, their home there."""
    packaged = Path(__file__).parent / "texts"
    return packaged if packaged.is_dir() else Path(__file__).parents[5] / "logs" / "msg"


_NUMPY = {"float32": "f4", "float64": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4",
          "uint32": "u4", "int64": "i8", "uint64": "u8", "bool": "?", "byte": "u1", "char": "u1", "octet": "u1"}
_STORE = get_typestore(Stores.EMPTY)


def _zero(kind: str) -> Any:
    if kind == "string":
        return ""
    if kind == "bool":
        return False
    return 0.0 if kind.startswith("float") else 0


def _field(name: str, desc: Any) -> tuple[str, Any, Any]:
    """A field of a dataclass: its name, type and default."""
    node, content = desc
    if node == Nodetype.NAME:
        # The class is looked up when it is needed, as texts name each other in any order.
        return name, content, dataclasses.field(default_factory=lambda: _STORE.types[content]())
    if node == Nodetype.BASE:
        return name, {"string": str, "bool": bool}.get(content[0], float if "float" in content[0] else int), _zero(content[0])
    (sub, inner), length = content
    if sub == Nodetype.NAME:
        return name, list, dataclasses.field(default_factory=lambda: [_STORE.types[inner]() for _ in range(length or 0)])
    if inner[0] == "string":
        return name, list, dataclasses.field(default_factory=lambda: [""] * (length or 0))
    dtype = np.dtype(_NUMPY[inner[0]])
    return name, np.ndarray, dataclasses.field(default_factory=lambda: np.zeros(length or 0, dtype))


def _arrays(fields: Any) -> dict[str, np.dtype]:
    """The fields that are arrays of numbers."""
    is_array = lambda desc: desc[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE)  # noqa: E731
    numbers = ((name, desc[1][0]) for name, desc in fields if is_array(desc))
    return {name: np.dtype(_NUMPY[sub[1][0]]) for name, sub in numbers if sub[0] == Nodetype.BASE and sub[1][0] != "string"}


def _set_attribute(self: Any, name: str, value: Any) -> None:
    """What is set for an array of numbers becomes one of its type, without a copy where it is one; rows are put behind each
    other."""
    dtype = self._arrays.get(name)
    if dtype is not None:
        given = np.asarray(value)
        # A type that cannot hold the values is a mistake, and must not change them silently.
        value = (given if given.size == 0 else _checked(given, dtype, name)).astype(dtype, copy=False).reshape(-1)
    object.__setattr__(self, name, value)


def _checked(given: np.ndarray, dtype: np.dtype, name: str) -> np.ndarray:
    if given.dtype.kind in "iu" and dtype.kind in "iu":
        fits = np.can_cast(given.dtype, dtype) or np.array_equal(given.astype(dtype), given)
    else:
        fits = np.can_cast(given.dtype, dtype, "same_kind")
    if not fits:
        raise TypeError(f"`{name}` takes {dtype.name}, and not all values of this {given.dtype.name} array are such")
    return given


def _make(name: str, constants: Any, fields: Any) -> type:
    package, _, short = name.split("/")
    namespace: dict[str, Any] = {constant: value for constant, _, value in constants}
    namespace |= {"__msgtype__": name, "_arrays": _arrays(fields), "__doc__": f"The ROS 2 message `{name}`.",
                  "__module__": f"{__name__}.{package}"}
    if namespace["_arrays"]:
        namespace["__setattr__"] = _set_attribute
    annotated = [_field(field, desc) for field, desc in fields]
    made = dataclasses.make_dataclass(short, annotated, namespace=namespace, eq=False)
    made.__module__ = namespace["__module__"]
    return made


def _load() -> None:
    texts = {}
    for path in sorted(_texts().rglob("*.msg")):
        package = path.relative_to(_texts()).parts[0]
        texts |= get_types_from_msg(path.read_text(), f"{package}/msg/{path.stem}")
    if not texts:
        raise ImportError(f"there are no message texts in {_texts()}: install the package by `pip install stages/python`")
    _STORE.register(texts)
    for name, (constants, fields) in _STORE.fielddefs.items():
        package, _, short = name.split("/")
        module = sys.modules.setdefault(f"{__name__}.{package}", types.ModuleType(f"{__name__}.{package}"))
        setattr(sys.modules[__name__], package, module)
        _STORE.types[name] = _make(name, constants, fields)
        setattr(module, short, _STORE.types[name])


_load()


def ros_type(message_class: type) -> str:
    """The name of a message type, such as `nav_msgs/msg/OccupancyGrid`."""
    name = getattr(message_class, "__msgtype__", None)
    if name not in _STORE.types:
        raise TypeError(f"{message_class!r} is no message type: import one from gridweave.msg")
    return name


def decode(message_class: type, data: memoryview) -> Any:
    """Reads a message. Arrays of numbers are views of `data`, not copies.

    Raises `SerdeError` if it is no such message.
    """
    return _STORE.deserialize_cdr(data, ros_type(message_class))


def size(message: Any) -> int:
    """How many bytes a message takes."""
    return 4 + _STORE.get_msgdef(ros_type(type(message))).getsize_cdr(0, message, _STORE)


def encode_into(message: Any, data: memoryview) -> None:
    """Writes a message into memory of its `size`."""
    # What lies between the fields is not written, and must not be what was there before.
    np.frombuffer(data, np.uint8).fill(0)
    data[:4] = b"\x00\x01\x00\x00"
    written = _STORE.get_msgdef(ros_type(type(message))).serialize_cdr_le(data[4:], 0, message, _STORE)
    assert written + 4 == len(data)


def encode(message: Any) -> bytes:
    """The bytes of a message."""
    data = bytearray(size(message))
    encode_into(message, memoryview(data))
    return bytes(data)
