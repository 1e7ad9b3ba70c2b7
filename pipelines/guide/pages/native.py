"""Stands in for the compiled module of the package, so that its docstrings are read where nothing is compiled."""

import ast
import sys
import types
from pathlib import Path


def install(package: Path) -> None:
    """Makes `gridweave._native` of its stub, which has the documentation of what it defines, and lets `gridweave` be imported."""
    stub = package / "gridweave/_native.pyi"
    module = types.ModuleType("gridweave._native")
    # Names are used in the stub before they are defined.
    exec("from __future__ import annotations\n" + ast.unparse(ast.parse(stub.read_text())), vars(module))
    module.__version__ = ""
    messages = package.parents[1] / "logs/msg"
    module.message_texts = lambda: {
        f"{file.parent.name}/msg/{file.stem}": file.read_text() for file in sorted(messages.glob("*/*.msg"))
    }
    sys.modules["gridweave._native"] = module
    sys.path.insert(0, str(package))
