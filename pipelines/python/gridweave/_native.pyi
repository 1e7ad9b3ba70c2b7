"""The native part of the package: what the other modules make names and types of."""

from os import PathLike
from typing import Any, Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

__version__: str

class GridweaveError(Exception):
    """A run of Gridweave has failed; the text says what, and what would fix it."""

class RequestError(GridweaveError):
    """The request is wrong, such as a parameter that does not exist or a file that is no map."""

_Path = str | PathLike[str]
_Origin = tuple[float, float, float]
_Grid = tuple[NDArray[np.int8], float, _Origin]
_Answer = tuple[str, _Grid | None]
_Progress = Callable[[float], Any] | None

class Request:
    def __new__(
        cls,
        *,
        reference: str | None,
        initial: Sequence[str],
        accept: Sequence[str],
        rename: Sequence[str],
        lidar: Sequence[str],
        literal_thresholds: bool,
        settings: Sequence[str],
        seed: int | None,
        output: _Path | None,
    ) -> Request: ...

class LogMessages(Iterator[tuple[str, str, str, str, int, int, bytes]]):
    def __new__(cls, files: Sequence[_Path]) -> LogMessages: ...
    def __iter__(self) -> LogMessages: ...
    def __next__(self) -> tuple[str, str, str, str, int, int, bytes]: ...
    def damage(self) -> list[str]: ...

def command(program: Sequence[str], arguments: Sequence[str]) -> int: ...
def deform(spacing: float, nodes: Sequence[Sequence[float]], points: NDArray[np.float64]) -> NDArray[np.float64]: ...
def load_map(file: _Path) -> tuple[_Grid, str | None]: ...
def merge_files(files: Sequence[_Path], request: Request, progress: _Progress) -> _Answer: ...
def merge_maps(
    maps: Sequence[tuple[str, NDArray[np.int8], float, _Origin]], request: Request, progress: _Progress
) -> _Answer: ...
def message_texts() -> dict[str, str]: ...
def run_pipeline(
    pipeline: _Path,
    files: Sequence[_Path],
    request: Request,
    stages: Sequence[tuple[str, str, Callable[[str], Any]]],
    progress: _Progress,
) -> _Answer: ...
def save_map(file: _Path, cells: NDArray[np.int8], resolution: float, origin: _Origin) -> None: ...
