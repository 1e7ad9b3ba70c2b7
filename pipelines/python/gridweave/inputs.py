"""What a merge is given: files, or maps in memory."""

import os
import re
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Callable, Iterable, Mapping, Protocol, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _native
from .map import Map, is_image, is_yaml
from .request import FilePath, path_of


class GridMessage(Protocol):
    """A ``nav_msgs/msg/OccupancyGrid`` of rclpy, rosbags, mcap or `gridweave.msg`: anything that has its fields."""

    @property
    def info(self) -> Any:
        """The resolution, the width, the height and the origin."""

    @property
    def data(self) -> Any:
        """The cells, row by row."""


#: What a map may be given as: a file, a log, a `Map`, an array, or a message.
MapInput = FilePath | Map | NDArray[Any] | Sequence[Sequence[float]] | GridMessage

Run = Callable[[_native.Request, Callable[[float], Any] | None], tuple[str, Any]]


@dataclass(frozen=True)
class Given:
    """The inputs of a run, as they were when it was asked for.

    Attributes:
        run: Runs on them.
        files: The files among them, absolute.
    """

    run: Run
    files: list[Path]


def given(inputs: Any, resolution: float | None) -> Given:
    """The inputs of a merge.

    Raises:
        RequestError: They are none, or cannot be merged with each other.
    """
    named: list[tuple[str | None, Any]]
    if isinstance(inputs, Mapping):
        named = [(_robot(name), one) for name, one in inputs.items()]
    else:
        named = [(None, one) for one in _listed(inputs)]
    if all(is_path(one) for _, one in named):
        if resolution is not None and named:
            raise _native.RequestError("`resolution` is the side of a cell of arrays, and files and logs say their own: leave it out")
        return of_files([path_of(one) if name is None else f"{name}={path_of(one)}" for name, one in named], _native.merge_files)
    if resolution is not None and all(is_path(one) or _is_message(one) or isinstance(one, Map) for _, one in named):
        raise _native.RequestError("`resolution` is the side of a cell of arrays, and none of these is one: leave it out")
    for name, one in named:
        if is_path(one):
            _check_is_map_file(name, one)
    maps = [_named_map(name, one, place, resolution) for place, (name, one) in enumerate(named, 1)]
    names = [name for name, *_ in maps]
    if twice := [name for number, name in enumerate(names) if name in names[:number]]:
        raise _native.RequestError(f"two maps are of `{twice[0]}`: give each robot a name of its own, as {{NAME: MAP, ...}}")
    files = [_robot_and_path(name, one)[1].absolute() for name, one in named if is_path(one)]
    return Given(lambda asked, report: _native.merge_maps(maps, asked, report), files)


def of_files(typed: list[str], run: Callable[..., tuple[str, Any]]) -> Given:
    """Files, each as PATH or ROBOT=PATH, with what runs on them.

    Raises:
        RequestError: One is not there.
    """
    folder = os.getcwd()
    parts = [_parts(one) for one in typed]
    if missing := [path for _, path in parts if not path.exists()]:
        raise _native.RequestError(f"there is no file {missing[0]}")
    absolute = [str(path.absolute()) if robot is None else f"{robot}={path.absolute()}" for robot, path in parts]

    def on_files(asked: _native.Request, report: Callable[[float], Any] | None) -> tuple[str, Any]:
        # What a run shows of its inputs is as it was typed, where that still means the same.
        return run(typed if os.getcwd() == folder else absolute, asked, report)

    return Given(on_files, [path.absolute() for _, path in parts])


def is_path(one: Any) -> bool:
    """Whether something is the path of a file."""
    return isinstance(one, (str, PathLike))


def _is_message(one: Any) -> bool:
    return hasattr(one, "info") and hasattr(one, "data")


def _listed(inputs: Any) -> list[Any]:
    if is_path(inputs):
        return [inputs]
    if isinstance(inputs, Map) or _is_message(inputs) or isinstance(inputs, np.ndarray) and inputs.ndim < 3:
        raise _native.RequestError("one map alone is not merged: give a list of maps")
    if not isinstance(inputs, Iterable) or isinstance(inputs, (bytes, bytearray)):
        raise _native.RequestError(f"the inputs are a list or a mapping of files, logs or maps, and not {_short(inputs)}")
    return list(inputs)


def _robot(name: Any) -> str:
    if not isinstance(name, str) or not name or re.search(r"[/={}\x00-\x1f\x7f]", name):
        raise _native.RequestError(
            f"{name!r} is no name of a robot: that is a text without /, =, {{ and }}, as its topics are /ROBOT/map and others"
        )
    return name


def _parts(typed: FilePath) -> tuple[str | None, Path]:
    """The robot, if one is named, and the path of PATH or ROBOT=PATH. If a file with the whole name exists, it is a path."""
    text = path_of(typed)
    robot, is_named, path = text.partition("=")
    if is_named and path and re.fullmatch(r"[^/\x00-\x1f\x7f]+", robot) and not os.path.exists(text):
        return robot, Path(path)
    return None, Path(text)


def _robot_and_path(name: str | None, one: FilePath) -> tuple[str | None, Path]:
    return (name, Path(path_of(one))) if name else _parts(one)


def _check_is_map_file(name: str | None, one: FilePath) -> None:
    _, path = _robot_and_path(name, one)
    if not is_image(path) and (not is_yaml(path) or path.is_dir()):
        what = "a topological map" if path.suffix.lower() == ".json" else "a log"
        raise _native.RequestError(f"{path} is {what}, which is not merged with maps in memory: merge such files by themselves")


def _named_map(
    name: str | None, one: Any, place: int, resolution: float | None
) -> tuple[str, NDArray[np.int8], float, tuple[float, float, float]]:
    """A map with the name of its robot, as the native part takes it. It stays as it is whatever becomes of the array."""
    if is_path(one):
        robot, path = _robot_and_path(name, one)
        name, loaded = robot or path.stem, Map.load(path)
    else:
        name, loaded = name or f"robot{place}", _map(one, resolution)
    return name, loaded.cells.copy(), loaded.resolution, loaded.origin


def _map(one: Any, resolution: float | None) -> Map:
    if isinstance(one, Map):
        return one
    if _is_message(one):
        return Map.from_message(one)
    if one is None or isinstance(one, (bytes, bytearray)) or not hasattr(one, "__array__") and not isinstance(one, Sequence):
        raise _native.RequestError(f"an input is a path, a Map, an array or a message with an occupancy grid, and not {_short(one)}")
    if resolution is None:
        raise _native.RequestError("an array does not say how large its cells are: give `resolution`, in metres")
    return Map(one, resolution)


def _short(value: Any) -> str:
    """A value as an error shows it."""
    text = repr(value)
    return text if len(text) <= 60 else f"a {type(value).__name__}"


def check_is_no_input(file: Path, inputs: Iterable[Path]) -> None:
    """Checks that a file that is written is none of the inputs, nor the image of one that is a map.

    Raises:
        RequestError: It is one.
    """
    if file.exists() and any(_is_or_holds(one, file) for one in inputs):
        raise _native.RequestError(f"{file} is an input, and would be overwritten: choose another name")


def _is_or_holds(one: Path, file: Path) -> bool:
    if one.is_dir():
        return one.resolve() in file.resolve().parents
    parts = [one]
    if is_yaml(one) and one.is_file():
        image = re.search(rb"^\s*image\s*:\s*[\"']?([^\"'#\r\n]+)", one.read_bytes(), re.MULTILINE)
        parts += [one.parent / os.fsdecode(image[1].strip())] if image else []
    return any(part.exists() and part.samefile(file) for part in parts)
