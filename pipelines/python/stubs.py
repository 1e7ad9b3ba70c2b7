"""Writes the stubs of the message types, `gridweave/msg/PACKAGE.pyi`, by which type checkers and editors know what `gridweave.msg` makes of
the `.msg` texts when it is imported:

    python pipelines/python/stubs.py        # where the package is installed
"""

import argparse
import keyword
from pathlib import Path
from typing import Any, Iterator

import numpy as np

from gridweave import msg
from rosbags.interfaces import Nodetype

FOLDER = Path(__file__).parent / "gridweave/msg"

HEADER = '''"""The message types of `{package}`."""

# Written by `pipelines/python/stubs.py` from the texts in `logs/msg`.

from dataclasses import Field
from typing import Any, ClassVar
'''

NUMPY = '''
import numpy as np
from numpy.typing import ArrayLike, NDArray
'''


def stubs() -> dict[str, str]:
    """The stub of each package of messages, by its name."""
    # Those that a program has defined are not shipped.
    names = sorted(name for name in msg._KNOWN if name not in msg._OWN)
    packages = sorted({name.split("/")[0] for name in names})
    return {package: _stub(package, [name for name in names if name.startswith(f"{package}/")]) for package in packages}


def _stub(package: str, names: list[str]) -> str:
    classes = ["\n".join(_class(package, name)) for name in names]
    used = {inner.split("/")[0] for name in names for inner in msg._used(msg._STORE.fielddefs[name][1])} - {package}
    imports = f"\nfrom . import {', '.join(sorted(used))}\n" if used else ""
    numpy = NUMPY if any("NDArray" in one for one in classes) else ""
    return HEADER.format(package=package) + numpy + imports + "".join(f"\n{one}\n" for one in classes)


def _class(package: str, name: str) -> Iterator[str]:
    constants, fields = msg._STORE.fielddefs[name]
    yield f"class {name.split('/')[2]}:"
    yield f'    """The ROS 2 message `{name}`."""\n'
    yield "    __msgtype__: ClassVar[str]"
    yield "    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]"
    for constant, _, value in constants:
        yield f"    {constant}: ClassVar[{type(value).__name__}]"
    for field, desc in fields:
        kept, taken = _types(package, desc)
        if kept == taken:
            yield f"    {field}: {kept}"
        else:
            yield "    @property"
            yield f"    def {field}(self) -> {kept}: ..."
            yield f"    @{field}.setter"
            yield f"    def {field}(self, value: {taken}) -> None: ..."
    yield "    def __init__("
    yield "        self,"
    for field, desc in fields:
        assert not keyword.iskeyword(field), f"{name} has a field that is a word of Python"
        yield f"        {field}: {_types(package, desc)[1]} = ...,"
    yield "    ) -> None: ..."


def _types(package: str, desc: Any) -> tuple[str, str]:
    """The type of a field, and of what it can be set to."""
    node, content = desc
    if node == Nodetype.NAME:
        other, _, short = content.split("/")
        return (short if other == package else f"{other}.{short}",) * 2
    if node == Nodetype.BASE:
        return ({"string": "str", "bool": "bool"}.get(content[0], "float" if "float" in content[0] else "int"),) * 2
    sub, _ = content
    if sub[0] == Nodetype.NAME or sub[1][0] == "string":
        return (f"list[{_types(package, sub)[0]}]",) * 2
    return f"NDArray[np.{np.dtype(msg._NUMPY[sub[1][0]]).type.__name__}]", "ArrayLike"


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    for old in FOLDER.glob("*.pyi"):
        old.unlink()
    for package, text in stubs().items():
        (FOLDER / f"{package}.pyi").write_text(text)


if __name__ == "__main__":
    main()
