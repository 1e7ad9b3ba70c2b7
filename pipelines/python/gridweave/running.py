"""Running pipelines."""

import functools
import json
import os
from typing import Any, Callable, Iterable, Mapping, Sequence

from . import _native
from .in_process import InProcess
from .inputs import of_files
from .request import Accept, FilePath, Initial, Progress, path_of, paths_of, settings, use_this_interpreter
from .result import MergeResult, result_of
from .stages import Stage


def run(
    pipeline: FilePath,
    inputs: FilePath | Iterable[FilePath] = (),
    *,
    output: FilePath | None = None,
    stages: Mapping[str, type[Stage] | Callable[..., Any]] | None = None,
    reference: str | None = None,
    initial: Initial | None = None,
    accept: Accept | None = None,
    rename: Mapping[str, str] | None = None,
    lidar: Mapping[str, Sequence[float]] | None = None,
    literal_thresholds: bool = False,
    parameters: Mapping[str, Any] | None = None,
    seed: int | None = None,
    progress: Progress = False,
) -> MergeResult:
    """Runs a pipeline file, or the shipped pipeline of that name, on files. A live pipeline is started by the command instead.

    Args:
        pipeline: The file, or the name, such as ``"map_merge"``.
        inputs: Paths of logs or map files, as the pipeline takes them.
        output: The log that the pipeline's ``mcap_sink`` writes.
        stages: Stages of one's own, by the name that the pipeline has for their kind: subclasses of `Stage`, or functions decorated with
            `stage`. They run in this process, so a debugger stops in them, and they share what the caller has.
        reference: As for `merge`, and so are the arguments that follow.

    Raises:
        RequestError: The pipeline or the request is wrong.
        GridweaveError: A stage has failed. Its cause (``__cause__``) is the exception of a stage of one's own.
    """
    use_this_interpreter()
    listed = paths_of(inputs)
    named = path_of(pipeline)
    # A shipped pipeline has no file.
    place = os.path.abspath(named) if os.path.exists(named) else named
    kinds = [_interface(name, made) for name, made in (stages or {}).items()]

    def start(files: list[str], asked: _native.Request, report: Callable[[float], Any] | None) -> tuple[str, Any]:
        raised: list[Exception] = []
        made = [(name, interface, functools.partial(InProcess, kind, raised)) for name, interface, kind in kinds]
        try:
            return _native.run_pipeline(named if os.path.abspath(named) == place else place, files, asked, made, report)
        except _native.GridweaveError as error:
            if raised:
                raise error from raised[0]
            raise

    asked = settings(
        reference=reference,
        initial=initial,
        accept=accept,
        rename=rename,
        lidar=lidar,
        literal_thresholds=literal_thresholds,
        parameters=parameters,
        seed=seed,
    )
    return result_of(of_files(listed, start), asked, output, progress, "run")


def _interface(name: str, made: Any) -> tuple[str, str, type[Stage]]:
    """A kind of stage: its name, its interface, and its class."""
    made = getattr(made, "__gridweave_stage__", made)
    if not (isinstance(made, type) and issubclass(made, Stage)):
        raise _native.RequestError(f"the stage `{name}` is a class made of Stage, or a function made a stage by @stage, and not {made!r}")
    return name, json.dumps(made.interface()), made
