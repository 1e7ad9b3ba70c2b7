"""What the README shows is true."""

import re
import tempfile
import textwrap
import unittest
from pathlib import Path

from gridweave import About
from gridweave.load import load
from gridweave.msg.nav_msgs import OccupancyGrid

README = Path(__file__).parent.parent / "README.md"
EXAMPLES = Path(__file__).parent.parent / "examples"


class ReadmeTest(unittest.TestCase):
    def test_the_class_of_the_readme_works(self):
        function, corners, own_type, source = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
        self.assertIn(function.strip(), (EXAMPLES / "invert.py").read_text())
        self.assertIn(source.strip(), (EXAMPLES / "circle.py").read_text())
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "Room.msg").write_text("string name\n")
            namespace = {"__file__": f"{folder}/room_types.py"}
            exec(textwrap.dedent(own_type), namespace)
            self.assertEqual(namespace["Room"](name="kitchen").name, "kitchen")
            path = Path(folder) / "corners.py"
            path.write_text(corners)
            sent, warned = [], []
            stage = load(str(path)).begin({"height": 1.0}, send=lambda *what: sent.append(what), warn=warned.append)
        grid = OccupancyGrid()
        stage.on_map(grid, About("robot1", 0, "/robot1/map", 0))
        grid.info.width = 5
        stage.on_map(grid, About("robot1", 0, "/robot1/map", 0))
        self.assertEqual((warned, sent[0][1].pose.position.z, stage.seen), (["empty maps are left out"], 1.0, 1))


if __name__ == "__main__":
    unittest.main()
