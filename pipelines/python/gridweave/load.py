"""Finds the stage that a pipeline file names: `FILE.py` or `package.module`, with `:NAME` behind it where there are several."""

import importlib
import importlib.util
import sys
from pathlib import Path

from .stages import Stage


def load(module: str) -> type[Stage]:
    """The stage of a module."""
    place, _, name = module.partition(":")
    if place.endswith(".py"):
        path = Path(place)
        # Modules beside it can be imported by it.
        sys.path.insert(0, str(path.parent.absolute()))
        spec = importlib.util.spec_from_file_location(path.stem, path)
        if spec is None or spec.loader is None or not path.is_file():
            raise FileNotFoundError(f"there is no file {place}")
        loaded = importlib.util.module_from_spec(spec)
        sys.modules[path.stem] = loaded
        spec.loader.exec_module(loaded)
    else:
        loaded = importlib.import_module(place)
    stages = {}
    for key, member in vars(loaded).items():
        member = getattr(member, "__gridweave_stage__", member)
        if isinstance(member, type) and issubclass(member, Stage) and member.__module__ == loaded.__name__:
            stages[key] = member
    if name:
        if name not in stages:
            raise LookupError(f"{place} has no stage `{name}`; it has {', '.join(stages) or 'none'}")
        return stages[name]
    if len(stages) != 1:
        known = f"it has {', '.join(stages)}: write which, as {place}:NAME" if stages else "it has none"
        raise LookupError(f"{place} must have one stage, and {known}")
    return next(iter(stages.values()))
