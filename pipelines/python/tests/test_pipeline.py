"""Running pipelines with stages in this process."""

import os
import tempfile
import unittest
from pathlib import Path
from unittest import mock

import numpy as np

from gridweave import GridweaveError, Input, Map, Output, RequestError, Stage, read_log, run, stage
from gridweave.load import load
from gridweave.msg.nav_msgs import OccupancyGrid

PIPELINE = """
[pipeline]
name = "own"

[stages.files]
kind = "map_file_source"

[stages.own]
kind = "own"
inputs = ["files"]

[stages.output]
kind = "mcap_sink"
inputs = ["own"]
"""

EXAMPLES = Path(__file__).parent.parent / "examples"


@stage(output="raised")
def raised(map: OccupancyGrid, *, level: int = 50) -> OccupancyGrid:
    """Raises the level of what is occupied."""
    return OccupancyGrid(map.header, map.info, np.where(map.data > 0, level, map.data))


class PipelineTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = Path(self.folder.name)
        (self.path / "own.toml").write_text(PIPELINE)
        Map(np.array([[0, 100], [-1, 0]], np.int8), 0.05).save(self.path / "a.yaml")

    def run_own(self, made, **more):
        return run(self.path / "own.toml", [self.path / "a.yaml"], output=self.path / "out.mcap", stages={"own": made}, **more)

    def messages(self):
        return [logged.message for logged in read_log(self.path / "out.mcap")]

    def test_a_function_is_a_stage_in_this_process(self):
        result = self.run_own(raised, parameters={"own.level": 70})
        (grid,) = self.messages()
        self.assertEqual(grid.data.tolist(), [0, 70, -1, 0])
        self.assertEqual(result.stages["own"].messages_out, 1)
        self.assertEqual(result.frames, {})

    def test_a_stage_in_a_process_of_its_own_runs_in_this_interpreter(self):
        text = PIPELINE.replace('kind = "own"', f'kind = "python"\nmodule = "{EXAMPLES / "invert.py"}"')
        (self.path / "process.toml").write_text(text)
        with mock.patch.dict(os.environ, {"PATH": "/nonexistent"}):
            os.environ.pop("GRIDWEAVE_PYTHON", None)
            run(self.path / "process.toml", [self.path / "a.yaml"], output=self.path / "out.mcap")
        (grid,) = self.messages()
        self.assertEqual(grid.data.tolist(), [100, 0, -1, 100])

    def test_a_stage_that_the_pipeline_does_not_have_is_refused(self):
        with self.assertRaisesRegex(RequestError, "no stage of the kind `other`"):
            run(self.path / "own.toml", [self.path / "a.yaml"], stages={"own": raised, "other": raised})

    def test_a_class_has_what_it_has_in_a_process_of_its_own(self):
        seen = []

        class Seer(Stage):
            """Sees maps."""

            map = Input(OccupancyGrid)
            last = Output(OccupancyGrid)

            def __init__(self):
                self.kept = None

            def on_map(self, map, about):
                seen.append((about.robot, about.topic, self.context.stage, self.context.inputs[about.wire]["from"]))
                self.kept = (map, about.robot)
                self.warn("seen")

            def finish(self):
                self.last.send(*self.kept)

        result = self.run_own(Seer)
        self.assertEqual(seen, [("a", "/a/map", "own", "files")])
        self.assertEqual(result.warnings, {"own: seen": 1})
        self.assertEqual(len(self.messages()), 1)

    def test_a_source_runs_to_its_end(self):
        (self.path / "circle.toml").write_text(
            '[pipeline]\nname = "circle"\n[stages.circle]\nkind = "circle"\n[stages.out]\nkind = "mcap_sink"\ninputs = ["circle"]\n'
        )
        circle = load(f"{EXAMPLES}/circle.py")
        run(self.path / "circle.toml", output=self.path / "out.mcap", stages={"circle": circle}, parameters={"circle.seconds": 2})
        times = [logged.log_time for logged in read_log(self.path / "out.mcap")]
        self.assertEqual(times, [tick * 100_000_000 for tick in range(20)])

    def test_an_exception_of_a_stage_ends_the_run_with_its_traceback(self):
        @stage(output="broken")
        def broken(map: OccupancyGrid) -> OccupancyGrid:
            """Breaks."""
            raise ValueError("a map of no use")

        with self.assertRaisesRegex(GridweaveError, "(?s)own.*a map of no use.*in broken"):
            self.run_own(broken)

    def test_what_is_no_stage_or_no_parameter_is_said(self):
        with self.assertRaisesRegex(RequestError, "made of Stage"):
            self.run_own(print)
        with self.assertRaisesRegex(RequestError, "(?s)level.*whole number"):
            self.run_own(raised, parameters={"own.level": "high"})
        with self.assertRaisesRegex(RequestError, "own"):
            run(self.path / "own.toml", [self.path / "a.yaml"], output=self.path / "out.mcap")
        with self.assertRaisesRegex(RequestError, "gridweave run live_merge"):
            run("live_merge")
        with self.assertRaisesRegex(RequestError, "no_such_pipeline"):
            run("no_such_pipeline")


if __name__ == "__main__":
    unittest.main()
