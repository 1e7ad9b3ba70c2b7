"""Running pipelines."""

import functools
import json
from os import PathLike
from typing import Any, Callable, Iterable, Mapping

from . import _native
from .in_process import InProcess
from .request import Progress, request, watch
from .result import MergeResult
from .stages import Stage


def run(
    pipeline: str | PathLike[str],
    inputs: Iterable[str | PathLike[str]] = (),
    *,
    output: str | PathLike[str] | None = None,
    stages: Mapping[str, type[Stage] | Callable[..., Any]] | None = None,
    reference: str | None = None,
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
        GridweaveError: A stage has failed.
    """
    files = [inputs] if isinstance(inputs, (str, PathLike)) else list(inputs)
    kinds = [_kind(name, made) for name, made in (stages or {}).items()]

    def start(output: str | PathLike[str] | None, progress: Progress = False) -> tuple[str, Any]:
        asked = request(reference=reference, initial=None, accept=None, parameters=parameters, seed=seed, output=output)
        with watch(progress, "run") as report:
            return _native.run_pipeline(pipeline, files, asked, kinds, report)

    return MergeResult(*start(output, progress), rerun=start)


def _kind(name: str, made: Any) -> tuple[str, str, Callable[[str], InProcess]]:
    """A kind of stage: its name, its interface, and what makes one."""
    made = getattr(made, "__gridweave_stage__", made)
    if not (isinstance(made, type) and issubclass(made, Stage)):
        raise _native.RequestError(f"the stage `{name}` is a class made of Stage, or a function made a stage by @stage, and not {made!r}")
    return name, json.dumps(made.interface()), functools.partial(InProcess, made)
