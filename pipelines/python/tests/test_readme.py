"""What the README shows is true."""

import contextlib
import io
import os
import re
import tempfile
import textwrap
import unittest
from pathlib import Path

from gridweave import About, Map, read_log, run
from gridweave.load import load
from gridweave.msg.nav_msgs import OccupancyGrid

from test_merge import room

FOLDER = Path(__file__).parent.parent
EXAMPLES = FOLDER / "examples"


def snippets(page):
    return re.findall(r"```python\n(.*?)```", (FOLDER / page).read_text(), re.DOTALL)


class ReadmeTest(unittest.TestCase):
    def test_what_the_readme_shows_works_in_its_order(self):
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()) as said:
            self.addCleanup(os.chdir, os.getcwd())
            os.chdir(folder)
            attic, cellar = room(), room(12, 7)
            Map(attic, 0.05).save("robot1.yaml")
            Map(cellar, 0.05).save("robot2.yaml")
            Path("thin.toml").write_text(
                '[pipeline]\nname = "thin"\n[stages.log]\nkind = "mcap_source"\n[stages.thin]\nkind = "thin"\ninputs = ["log.map"]\n'
                '[stages.out]\nkind = "mcap_sink"\ninputs = ["thin"]\n'
            )
            namespace = {"attic": attic, "cellar": cellar}
            merged, named, logged, pipeline = snippets("README.md")
            exec(merged, namespace)
            self.assertIn("robot2: merged", said.getvalue())
            self.assertTrue(Path("merged.yaml").exists())
            exec(named, namespace)
            self.assertEqual(list(namespace["result"].frames), ["attic", "cellar"])
            run("map_files_to_log", ["robot1.yaml", "robot2.yaml"], output="robots.mcap")
            # There are no poses in it.
            with self.assertWarns(UserWarning):
                exec(logged, namespace)
            # Functions are asked for their types, which stand in the module.
            exec(pipeline, namespace | {"__name__": "readme"})
            self.assertEqual({message.topic for message in read_log("out.mcap")}, {"/robot1/thin/thin", "/robot2/thin/thin"})

    def test_the_stages_that_are_shown_work(self):
        function, corners, own_type, source = snippets("STAGES.md")
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
