"""The settings of a run, and its progress."""

import contextlib
from os import PathLike
from typing import Any, Callable, Iterator, Mapping, Sequence

from . import _native

#: True for a bar of tqdm, or a function that is given the share that is done, 0 to 1.
Progress = bool | Callable[[float], None]


def request(
    *,
    reference: str | None,
    initial: Mapping[str, Sequence[float]] | None,
    accept: Mapping[str, int | str] | None,
    parameters: Mapping[str, Any] | None,
    seed: int | None,
    output: str | PathLike[str] | None,
) -> _native.Request:
    """The settings as the command line has them."""
    if seed is not None and not 0 <= seed < 1 << 64:
        raise _native.RequestError(f"a seed is a number from 0 on of at most 64 bits, and not {seed}")
    return _native.Request(
        reference=reference,
        initial=[f"{robot}={_pose(robot, pose)}" for robot, pose in (initial or {}).items()],
        accept=[f"{robot}={number}" for robot, number in (accept or {}).items()],
        settings=[f"{name}={_toml(value)}" for name, value in (parameters or {}).items()],
        seed=seed,
        output=output,
    )


def _pose(robot: str, pose: Sequence[float]) -> str:
    try:
        return ",".join(repr(float(number)) for number in pose)
    except (TypeError, ValueError):
        raise _native.RequestError(f"the initial pose of `{robot}` is (x, y, yaw) in numbers, and not {pose!r}") from None


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


@contextlib.contextmanager
def watch(progress: Progress, what: str) -> Iterator[Callable[[float], None] | None]:
    """What reports the progress of a run."""
    if not progress:
        yield None
    elif callable(progress):
        yield progress
    else:
        from tqdm.auto import tqdm

        with tqdm(total=1.0, desc=what, bar_format="{desc} {percentage:3.0f} % |{bar}| {elapsed}") as bar:
            yield lambda share: bar.update(share - bar.n)
            bar.update(1.0 - bar.n)
