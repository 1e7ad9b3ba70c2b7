"""The message types that stages exchange, as dataclasses made from the ``.msg`` texts, and their encoding (CDR). ::

    from gridweave.msg.nav_msgs import OccupancyGrid
    from gridweave.msg.gridweave_msgs import Segment, Segments

Every field has a default: numbers are 0, texts empty, arrays of numbers are numpy arrays of the type that the text says, other
arrays are lists, and messages in messages are such dataclasses. Constants of a text are attributes of its class.

A type of one's own is made from its text, once, in a module that all stages import it from::

    from gridweave.msg import define

    Room = define("my_msgs/msg/Room", "string name\\nfloat64 area")

The parser and the encoding are those of the package ``rosbags``.
"""

import dataclasses
import functools
import re
import sys
import types
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from .._native import GridweaveError, message_texts

__all__ = ["decode", "decode_as", "define", "encode", "ros_type"]


_NUMPY = {"float32": "f4", "float64": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4",
          "uint32": "u4", "int64": "i8", "uint64": "u8", "bool": "?", "byte": "u1", "char": "u1", "octet": "u1"}
_STORE = get_typestore(Stores.EMPTY)
#: The texts of all types by their names, and the names of those that are not shipped.
_KNOWN: dict[str, str] = {}
_OWN: set[str] = set()


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


def _arrays(fields: Any) -> dict[str, np.dtype[Any]]:
    """The fields that are arrays of numbers."""
    numbers = ((name, desc[1][0]) for name, desc in fields if desc[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE))
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


def _checked(given: NDArray[Any], dtype: np.dtype[Any], name: str) -> NDArray[Any]:
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


def _add(texts: dict[str, str]) -> None:
    """Makes types of texts, which may use each other and those that are there."""
    parsed: dict[str, Any] = {}
    for name, text in texts.items():
        parsed |= get_types_from_msg(text, name)
    _STORE.register(parsed)
    _KNOWN.update(texts)
    for name in texts:
        package, _, short = name.split("/")
        module = sys.modules.setdefault(f"{__name__}.{package}", types.ModuleType(f"{__name__}.{package}"))
        setattr(sys.modules[__name__], package, module)
        _STORE.types[name] = _make(name, *_STORE.fielddefs[name])
        setattr(module, short, _STORE.types[name])


_add(message_texts())


def define(name: str, text: str) -> type:
    """Makes a message type of one's own of a ``.msg`` text, and gives its class, which can be imported from `gridweave.msg` from then on.

    To define a type again changes nothing; in another way it is an error, as two stages would read the same bytes differently.

    Args:
        name: The name of the type, as ``package/msg/Type``.
        text: Its text, which may use all types that are known.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*/msg/[A-Z][A-Za-z0-9]*", name):
        raise ValueError(f"`{name}` is no name of a message type, such as my_msgs/msg/Room")
    if name in _KNOWN:
        if _KNOWN[name].split() != text.split():
            raise ValueError(f"{name} is known already, and is defined otherwise")
        return _STORE.types[name]
    if re.search(r"^={80}$", text, re.MULTILINE):
        raise ValueError(f"the text of {name} holds several types: define each by itself, those that are used first")
    try:
        (_, fields), = get_types_from_msg(text, name).values()
    except Exception as error:  # noqa: BLE001: the parser has its own, and gets others from what it reads
        raise ValueError(f"the text of {name} cannot be read: {error}") from None
    if unknown := sorted(_used(fields) - set(_KNOWN)):
        raise ValueError(f"{name} uses {unknown[0]}, which is not known: define it before")
    _add({name: text})
    _OWN.add(name)
    return _STORE.types[name]


def _used(fields: Any) -> set[str]:
    """The types of messages in a message."""
    plain = (desc[1][0] if desc[0] in (Nodetype.ARRAY, Nodetype.SEQUENCE) else desc for _, desc in fields)
    return {content for node, content in plain if node == Nodetype.NAME}


def definition(name: str) -> str | None:
    """The text of a type that is not shipped with those of all that it uses, as logs hold it (`ros2msg`); None of one that is."""
    if name not in _OWN:
        return None
    parts, used = [_KNOWN[name]], [name]
    for at in used:
        for inner in sorted(_used(_STORE.fielddefs[at][1]) - set(used)):
            used.append(inner)
            parts.append(f"{'=' * 80}\nMSG: {inner.replace('/msg/', '/')}\n{_KNOWN[inner]}")
    return "".join(part if part.endswith("\n") else part + "\n" for part in parts)


def ros_type(message_class: type) -> str:
    """The name of a message type, such as ``nav_msgs/msg/OccupancyGrid``."""
    name: Any = getattr(message_class, "__msgtype__", None)
    if name not in _STORE.types:
        raise TypeError(f"{message_class!r} is no message type: import one from gridweave.msg")
    return str(name)


def decode(message_class: type, data: memoryview) -> Any:
    """Reads a message. Arrays of numbers are views of ``data``, not copies.

    Raises:
        SerdeError: It is no such message.
    """
    return _STORE.deserialize_cdr(data, ros_type(message_class))


def decode_as(name: str, text: str, data: bytes) -> Any:
    """Reads a message of a log, whose type has the definition ``text`` there (``ros2msg``), with all types that it uses; without one it is
    that of the same name here.

    Raises:
        GridweaveError: The definition or the message cannot be read.
    """
    try:
        return _store_of(name, text).deserialize_cdr(data, name)
    except Exception as error:  # noqa: BLE001: the parser has its own, and gets others from what it reads
        raise GridweaveError(f"a message of the type {name} cannot be read: {error}") from error


@functools.lru_cache(maxsize=1024)
def _store_of(name: str, text: str) -> Any:
    """The types by which a log has written its messages: those here if they are the same."""
    if not text:
        return _STORE
    parsed = get_types_from_msg(text, name)
    if all(_STORE.fielddefs.get(other) == definition for other, definition in parsed.items()):
        return _STORE
    store = get_typestore(Stores.EMPTY)
    store.register(parsed)
    return store


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
