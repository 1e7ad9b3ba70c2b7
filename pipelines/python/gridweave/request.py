"""The settings of a run, and its progress."""

import contextlib
import functools
import importlib
import math
import operator
import os
import sys
from os import PathLike
from typing import Any, Callable, Iterable, Iterator, Literal, Mapping, Protocol, Sequence

from . import _native

#: The path of a file.
FilePath = str | PathLike[str]
#: True for a bar of tqdm, or a function that is given the share that is done, 0 to 1.
Progress = bool | Callable[[float], Any]


class Posed(Protocol):
    """What has a pose, such as a `gridweave.Frame`."""

    @property
    def x(self) -> float:
        """Metres."""

    @property
    def y(self) -> float:
        """Metres."""

    @property
    def yaw(self) -> float:
        """Radians."""


Initial = Mapping[str, Sequence[float] | Posed]
Accept = Mapping[str, int | Literal["initial"]]


def settings(
    *,
    reference: str | None,
    initial: Initial | None = None,
    accept: Accept | None = None,
    rename: Mapping[str, str] | None = None,
    lidar: Mapping[str, Sequence[float]] | None = None,
    literal_thresholds: bool = False,
    parameters: Mapping[str, Any] | None,
    seed: int | None,
) -> Callable[[str | None], _native.Request]:
    """The settings as the command line has them, as they are at the time of the call: a function of the file of the output.

    Raises:
        RequestError: One is of a kind that it cannot be.
    """
    if not isinstance(reference, (str, type(None))):
        raise _native.RequestError(f"`reference` is the name of a robot, and not {reference!r}")
    return functools.partial(
        _request,
        reference=reference,
        initial=[f"{robot}={_pose(robot, pose)}" for robot, pose in _items("initial", initial, "(x, y, yaw)")],
        accept=[f"{robot}={_hypothesis(robot, number)}" for robot, number in _items("accept", accept, "2")],
        rename=[f"{old}={_topic(old, new)}" for old, new in _items("rename", rename, '"/NEW"', "/OLD")],
        lidar=[f"{robot}={_mount(robot, pose)}" for robot, pose in _items("lidar", lidar, "(x, y, yaw)")],
        literal_thresholds=bool(literal_thresholds),
        settings=[f"{name}={_toml(value)}" for name, value in _items("parameters", parameters, "VALUE", "STAGE.PARAMETER")],
        seed=_seed(seed),
    )


def _request(output: str | None, **asked: Any) -> _native.Request:
    return _native.Request(output=output, **asked)


def _items(argument: str, given: Any, value: str, name: str = "ROBOT") -> list[tuple[str, Any]]:
    if given is None:
        return []
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise _native.RequestError(f'`{argument}` is a mapping, as {{"{name}": {value}}}, and not {given!r}')
    return list(given.items())


def _seed(seed: Any) -> int | None:
    if seed is None:
        return None
    try:
        number = operator.index(seed)
    except TypeError:
        number = -1
    if isinstance(seed, bool) or not 0 <= number < 1 << 64:
        raise _native.RequestError(f"a seed is a whole number from 0 on of at most 64 bits, and not {seed!r}")
    return number


def _topic(old: str, new: Any) -> str:
    if "=" in old or not isinstance(new, str):
        raise _native.RequestError(
            f"`rename` gives a topic its name, as {{'/r1/{{robot}}/map': '/{{robot}}/map'}}, and not {{{old!r}: {new!r}}}"
        )
    return new


def _mount(robot: str, pose: Any) -> str:
    numbers = _numbers(pose)
    if not 3 <= len(numbers) <= 4:
        raise _native.RequestError(
            f"the lidar of `{robot}` is at (x, y, yaw) or (x, y, yaw, roll) on its robot, in metres and radians, and not at {pose!r}"
        )
    return ",".join(map(repr, numbers))


def _numbers(given: Any) -> list[float]:
    """Finite numbers; none if something is no sequence of such."""
    try:
        numbers = [] if isinstance(given, (str, bytes)) else [float(number) for number in given]
    except (TypeError, ValueError):
        numbers = []
    return numbers if all(map(math.isfinite, numbers)) else []


def _pose(robot: str, pose: Any) -> str:
    if all(hasattr(pose, part) for part in ("x", "y", "yaw")):
        pose = (pose.x, pose.y, pose.yaw)
    numbers = _numbers(pose)
    if not 3 <= len(numbers) <= 5:
        raise _native.RequestError(
            f"the initial pose of `{robot}` is a Frame or (x, y, yaw) in numbers, with the standard deviations of the position and of the "
            f"yaw behind them if they are known, and not {pose!r}"
        )
    return ",".join(map(repr, numbers))


def _hypothesis(robot: str, number: Any) -> str:
    if isinstance(number, str) and number == "initial":
        return number
    try:
        index = operator.index(number)
    except TypeError:
        index = 0
    if isinstance(number, bool) or index < 1:
        raise _native.RequestError(
            f'`accept` of `{robot}` is the number of a hypothesis that a refusal has listed, from 1, or "initial" for its initial pose as it '
            f"is, and not {number!r}"
        )
    return str(index)


def use_this_interpreter() -> None:
    """Makes this interpreter, which has the package, that of stages in Python, unless ``GRIDWEAVE_PYTHON`` names another."""
    if sys.executable:
        os.environ.setdefault("GRIDWEAVE_PYTHON", sys.executable)


def path_of(file: Any) -> str:
    """The path of a file, as a text.

    Raises:
        RequestError: It is no path.
    """
    path = os.fspath(file) if isinstance(file, (str, PathLike)) else None
    if not isinstance(path, str):
        raise _native.RequestError(f"a file is given by its path, a text or a Path, and not by {file!r}")
    return path


def paths_of(files: Any) -> list[str]:
    """The paths of one file or of several.

    Raises:
        RequestError: They are no paths.
    """
    if isinstance(files, (str, PathLike)):
        return [path_of(files)]
    if not isinstance(files, Iterable) or isinstance(files, (bytes, bytearray)):
        raise _native.RequestError(f"a file is given by its path, and several by a list of paths, and not by {files!r}")
    return [path_of(file) for file in files]


def _toml(value: Any) -> str:
    """A value of a parameter in the format of pipeline files."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in escaped) + '"'
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_toml(str(key))} = {_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if hasattr(value, "item"):  # a number of numpy
        return _toml(value.item())
    raise _native.RequestError(f"a parameter is a number, a text, true or false, or a list of these, and not {value!r}")


def needed(module: str, what: str, extra: str) -> Any:
    """A module of a package that is not installed with this one.

    Raises:
        RequestError: It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        package = module.partition(".")[0]
        raise _native.RequestError(f"{what} needs {package}, which is not installed: pip install 'gridweave[{extra}]'") from None


@contextlib.contextmanager
def watch(progress: Progress, what: str) -> Iterator[Callable[[float], Any] | None]:
    """What reports the progress of a run."""
    if not progress:
        yield None
    elif callable(progress):
        yield progress
    else:
        tqdm = needed("tqdm.auto", "`progress=True`", "progress").tqdm
        with tqdm(total=1.0, desc=what, bar_format="{desc} {percentage:3.0f} % |{bar}| {elapsed}") as bar:
            yield lambda share: bar.update(share - bar.n)
            bar.update(1.0 - bar.n)
