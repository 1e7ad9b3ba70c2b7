"""What a type checker knows of the package, and what `help` shows."""

import dataclasses
import importlib.util
import inspect
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import gridweave
from gridweave import msg

PROGRAM = '''
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from typing_extensions import assert_type

import gridweave
from gridweave import About, Frame, Map, MergeResult, stage
from gridweave.msg import nav_msgs
from gridweave.msg.geometry_msgs import Point
from gridweave.msg.nav_msgs import OccupancyGrid

def merged(a: NDArray[np.uint8], grid: OccupancyGrid, first: MergeResult) -> gridweave.MergeResult:
    gridweave.merge("robots.mcap")
    gridweave.merge(Path("robots.mcap"), accept={"robot2": 1, "robot3": "initial"})
    gridweave.merge({"attic": a, "cellar": Map(a, 0.05), "shed": grid, "roof": "roof.yaml"}, initial={"attic": (0, 0, 0.5)})
    gridweave.merge([a, a], resolution=0.05, initial=first.frames, progress=lambda share: print(share))
    return gridweave.merge(["x.mcap", "y.mcap"])

@stage(output="thin")
def thin(map: OccupancyGrid, about: About, *, level: int = 65) -> OccupancyGrid | None:
    cells = np.where(map.data < level, 0, map.data)
    return nav_msgs.OccupancyGrid(map.header, map.info, cells)

@stage
def copied(map: OccupancyGrid) -> OccupancyGrid:
    map.data = [0, 100]
    return map

def shown(result: MergeResult) -> Axes:
    assert_type(result.frames["robot2"], Frame)
    assert_type(result.map, Map | None)
    assert_type(OccupancyGrid().data, NDArray[np.int8])
    assert_type(OccupancyGrid().info.origin.position, Point)
    assert_type(thin(OccupancyGrid(), About("robot1", 0, "/map", 0), level=3), OccupancyGrid | None)
    result = gridweave.run("thin.toml", ["robots.mcap"], stages={"thin": thin})
    for logged in gridweave.read_log("robots.mcap", topics="/robot1/pose"):
        assert_type(logged.log_time, int)
    return result.plot()
'''

WRONG = '''
import gridweave
from gridweave.msg.nav_msgs import OccupancyGrid

gridweave.merge(3)
gridweave.merge(["a.yaml"], accept={"robot2": "first"})
gridweave.nothing
OccupancyGrid(nothing=3)
OccupancyGrid().info.width = "wide"
'''


@unittest.skipUnless(importlib.util.find_spec("mypy") and importlib.util.find_spec("matplotlib"), "mypy or matplotlib is not installed")
class TypesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name)

    def check(self, *arguments):
        command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary", "--no-incremental", *arguments]
        return subprocess.run(command, cwd=self.path, capture_output=True, text=True).stdout

    def test_a_program_and_the_package_itself_are_without_an_error(self):
        (self.path / "program.py").write_text(PROGRAM)
        self.assertEqual(self.check("-p", "gridweave", "-m", "program"), "")

    def test_a_wrong_program_has_an_error_in_each_line(self):
        (self.path / "wrong.py").write_text(WRONG)
        lines = [int(line.split(":")[1]) for line in self.check("wrong.py").splitlines() if " error: " in line]
        self.assertEqual(sorted(set(lines)), [5, 6, 7, 8, 9])


class StubsTest(unittest.TestCase):
    def test_the_stubs_are_those_of_the_messages(self):
        file = Path(__file__).parent.parent / "stubs.py"
        spec = importlib.util.spec_from_file_location("stubs", file)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        shipped = {stub.stem: stub.read_text() for stub in Path(msg.__file__).parent.glob("*.pyi")}
        self.assertEqual(shipped, module.stubs(), "python pipelines/python/stubs.py writes them")

    def test_the_names_of_the_package_are_those_that_it_imports(self):
        imported = {"GridweaveError", "RequestError", "__version__"}
        self.assertEqual(sorted(gridweave.__all__), gridweave.__all__)
        self.assertEqual(set(gridweave.__all__) - imported, set(gridweave._MODULES))


class HelpTest(unittest.TestCase):
    def test_every_attribute_has_its_meaning_where_help_shows_it(self):
        classes = [made for name in gridweave.__all__ if isinstance(made := getattr(gridweave, name), type)]
        for made in filter(dataclasses.is_dataclass, classes):
            _, _, attributes = inspect.getdoc(made).partition("Attributes:\n")
            for field in dataclasses.fields(made):
                if not field.name.startswith("_"):
                    with self.subTest(f"{made.__name__}.{field.name}"):
                        self.assertRegex(attributes, rf"(?m)^    {field.name}: \S")
        for name in ("summary", "map"):
            self.assertRegex(inspect.getdoc(gridweave.MergeResult), rf"(?m)^    {name}: \S")

    def test_a_map_says_what_its_cells_mean(self):
        text = inspect.getdoc(gridweave.Map)
        for words in ("-1 unknown, 0 free to 100 occupied", "0 to 1", "NaN"):
            self.assertIn(words, text)


if __name__ == "__main__":
    unittest.main()
