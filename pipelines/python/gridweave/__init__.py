"""Merges the maps of several robots into one, and runs the pipelines of Gridweave.

    import gridweave

    result = gridweave.merge(["a.yaml", "b.yaml"])      # map files, logs, numpy arrays, or messages
    print(result)                                       # the pose of each map, and why others could not be merged
    result.map.save("merged.yaml")

`merge` estimates the relative poses of maps and merges them, `run` runs a pipeline, `read_log` iterates over the messages of logs, and
`Stage` and `stage` make stages of one's own.
"""

import importlib
from typing import TYPE_CHECKING, Any

from ._native import GridweaveError, RequestError, __version__

__all__ = [
    "About", "Context", "Deformation", "Evidence", "Frame", "GridweaveError", "Group", "Input", "LoggedMessage", "Map", "MergeResult",
    "Output", "Pair", "Parameter", "RequestError", "Stage", "StageStatistics", "__version__", "merge", "read_log", "run", "stage",
]

if TYPE_CHECKING:
    from .log import LoggedMessage, read_log
    from .map import Map
    from .merging import merge
    from .result import Deformation, Evidence, Frame, Group, MergeResult, Pair, StageStatistics
    from .running import run
    from .stages import About, Context, Input, Output, Parameter, Stage, stage
else:
    #: The module of each name. They are imported when they are used, as the command needs none of them.
    _MODULES = {
        "LoggedMessage": "log", "read_log": "log", "Map": "map", "merge": "merging", "run": "running",
        "Deformation": "result", "Evidence": "result", "Frame": "result", "Group": "result", "MergeResult": "result", "Pair": "result",
        "StageStatistics": "result",
        "About": "stages", "Context": "stages", "Input": "stages", "Output": "stages", "Parameter": "stages", "Stage": "stages",
        "stage": "stages",
    }

    def __getattr__(name: str) -> Any:
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        # A module of the same name as what it defines would hide it.
        value = getattr(importlib.import_module(f".{_MODULES[name]}", __name__), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted(__all__)
