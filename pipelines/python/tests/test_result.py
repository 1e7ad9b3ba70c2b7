"""What is done with the result of a merge."""

import copy
import os
import pickle
import unittest

import numpy as np

from gridweave import GridweaveError, Map, merge, read_log, run, stage
from gridweave.msg.nav_msgs import OccupancyGrid

from test_inputs import A, B, InFolder

EMPTY = np.zeros((100, 100), np.int8)


class LogTest(InFolder):
    def test_arrays_that_were_changed_since_give_the_log_of_the_merge(self):
        a, b, initial = A.copy(), B.copy(), {"robot2": [-0.6, -0.35, 0.0]}
        result = merge([a, b], resolution=0.05, initial=initial, reference="robot1")
        a[:], initial["robot2"][0] = 0, 9.0
        result.to_mcap(self.log)
        grid = [logged.message for logged in read_log(self.log, topics="/map")][-1]
        np.testing.assert_array_equal(Map.from_message(grid).cells, result.map.cells)
        self.assertEqual([one.name for one in self.path.iterdir() if one.name.startswith(".")], [])

    def test_a_file_that_was_changed_since_is_an_error_and_nothing_is_written(self):
        result = merge([self.a, self.b])
        self.log.write_text("what was there")
        Map(np.roll(B, 20, axis=1), 0.05).save(self.b)
        with self.assertRaisesRegex(GridweaveError, "robots.mcap was not written.*an input has changed since"):
            result.to_mcap(self.log)
        self.assertEqual(self.log.read_text(), "what was there")

    def test_the_inputs_are_those_of_the_folder_in_which_they_were_given(self):
        self.addCleanup(os.chdir, os.getcwd())
        os.chdir(self.path)
        result = merge({"x": "a.yaml", "y": "b.yaml"})
        os.chdir("/")
        result.to_mcap(self.log)
        self.assertEqual({logged.topic for logged in read_log(self.log, topics=["/x/map", "/y/map"])}, {"/x/map", "/y/map"})

    def test_a_result_can_be_pickled_and_copied_and_then_writes_no_log(self):
        result = merge([A, B], resolution=0.05)
        for other in (pickle.loads(pickle.dumps(result)), copy.copy(result), copy.deepcopy(result)):
            self.assertEqual((repr(other), other.summary, other.frames["robot2"].x), (repr(result), result.summary, result.frames["robot2"].x))
            np.testing.assert_array_equal(other.map.cells, result.map.cells)
            with self.assertRaisesRegex(GridweaveError, "`output=`"):
                other.to_mcap(self.log)
        result.to_mcap(self.log)
        for logged in read_log(self.log, topics="/map"):
            self.assertEqual(pickle.loads(pickle.dumps(logged)).message.info.width, logged.message.info.width)

    def test_an_input_is_not_overwritten(self):
        link = self.path / "link.yaml"
        link.symlink_to(self.a)
        result = merge([self.a, self.b])
        for file in (self.a, self.path / "a.yml", link):
            self.refuses("is an input, and would be overwritten", result.to_yaml, file)
        of_both = merge([self.a, Map(B, 0.05)])
        self.refuses("is an input, and would be overwritten", of_both.to_yaml, str(self.a))
        self.refuses("is an input, and would be overwritten", merge, [self.a, Map(B, 0.05)], output=self.a)
        self.make_log()
        self.refuses("is an input, and would be overwritten", merge(self.log).to_mcap, self.log)
        np.testing.assert_array_equal(Map.load(self.a).cells, A)

    def test_a_file_of_another_format_is_refused(self):
        result = merge([self.a, self.b])
        for name in ("odd.png", "odd.mcap", "odd", ".yaml", ""):
            self.refuses("a map is written as a YAML file", result.to_yaml, self.path / name if name else "")
            self.refuses("a map is written as a YAML file", result.map.save, self.path / name if name else "")
        self.refuses("by its path", result.to_yaml, 3)
        error = self.refuses("a log is written as MCAP", result.to_mcap, self.path / "odd.png")
        self.assertIn(str(self.path / "odd.png"), str(error))
        with self.assertRaisesRegex(GridweaveError, "cannot write .*No such file"):
            result.to_mcap(self.path / "no/such/folder/log.mcap")
        self.assertFalse(any(one.name.startswith("odd") for one in self.path.iterdir()))

    def test_points_of_another_shape_are_refused(self):
        result = merge([A, B], resolution=0.05)
        for points in (np.zeros((2, 3)), np.zeros((2, 2, 2)), 3, [], [[1, 2], [3]], ["a", "b"], None):
            for robot in ("robot1", "robot2"):
                self.refuses("points are N x 2 or one", result.transform, robot, points)
        self.assertEqual(result.transform("robot2", np.zeros((0, 2))).shape, (0, 2))
        for deformation in result.deformations.values():
            self.refuses("points are N x 2 or one", deformation, np.zeros((2, 3)))

    def test_the_exception_of_a_stage_is_the_cause_of_that_of_the_run(self):
        broken = ValueError("a map of no use")

        @stage(output="broken")
        def breaks(map: OccupancyGrid) -> OccupancyGrid:
            """Breaks."""
            raise broken

        (self.path / "own.toml").write_text(
            '[pipeline]\nname = "own"\n[stages.files]\nkind = "map_file_source"\n[stages.own]\nkind = "own"\ninputs = ["files"]\n'
            '[stages.output]\nkind = "mcap_sink"\ninputs = ["own"]\n'
        )
        with self.assertRaises(GridweaveError) as caught:
            run(self.path / "own.toml", [self.a], output=self.log, stages={"own": breaks})
        self.assertIs(caught.exception.__cause__, broken)


class ShownTest(InFolder):
    def grey(self):
        image = np.full((40, 40), 205, np.uint8)
        image[5:35, 5:35], image[10, 5:35] = 254, 100
        (self.path / "grey.pgm").write_bytes(b"P5 40 40 255\n" + image.tobytes())
        file = self.path / "grey<b>.yaml"
        file.write_text("image: grey.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n")
        return file

    def test_warnings_of_map_files_are_shown_behind_the_robots(self):
        result = merge([self.a, self.grey()])
        self.assertEqual(len(result.warnings), 1)
        lines = repr(result).splitlines()
        self.assertTrue(lines[-2].startswith("  warning: files: ") and "grey<b>.yaml" in lines[-2], lines)
        self.assertIn("grey&lt;b&gt;.yaml", result._repr_html_().split("</table>")[1])

    def test_a_result_without_a_map_shows_none(self):
        self.assertEqual(repr(run("map_files_to_log", [self.a], output=self.log)), "<MergeResult>")

    def test_reasons_name_the_arguments_of_python(self):
        result = merge([A, B], resolution=0.05, accept={"robot2": "initial"})
        (reason,) = result.unmerged.values()
        self.assertIn('initial={"robot2": (X, Y, YAW)}', reason)
        self.assertNotIn("--", reason + repr(result) + result.pairs[0].reason)
        self.assertIn("--initial", result.summary["unmerged"]["robot2"])
        result.summary["unmerged"]["robot2"] = "missing: 0.98 (--set verifier.accept)\ntry: --accept b c=N of these, --initial b c=X,Y,YAW,STDDEV, or tags"
        self.assertEqual(
            result.unmerged["robot2"],
            'missing: 0.98 (parameters={"verifier.accept": ...})\ntry: accept={"b c": N} of these, initial={"b c": (X, Y, YAW, STDDEV)}, or tags',
        )


class PlotTest(unittest.TestCase):
    def setUp(self):
        try:
            from matplotlib.figure import Figure
        except ImportError:
            self.skipTest("matplotlib is not installed")
        self.figure = Figure(figsize=(4, 4))

    def test_robots_that_are_not_merged_are_in_the_title(self):
        axes = merge({"attic": A, "cellar": EMPTY}, resolution=0.05).plot(self.figure.subplots())
        self.assertEqual(axes.get_title(), "not merged: cellar")
        self.assertEqual(merge([A, B], resolution=0.05).plot(self.figure.subplots()).get_title(), "")

    def test_a_thin_wall_of_a_large_map_is_seen(self):
        result = merge([A, B], resolution=0.05)
        cells = np.zeros((4100, 4000), np.int8)
        cells[::501] = 100
        result.map = Map(cells, 0.05)
        axes = self.figure.add_axes((0, 0, 1, 1))
        result.plot(axes)
        (image,) = axes.images
        np.testing.assert_allclose(image.get_extent(), (0, 200, 0, 205), atol=0.15)
        for artist in axes.texts:
            artist.set_visible(False)
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas = FigureCanvasAgg(self.figure)
        canvas.draw()
        column = np.asarray(canvas.buffer_rgba())[:, 200, 0].astype(int)
        dark = (column < 225) & (np.roll(column, 1) >= 225)
        self.assertEqual(dark[5:-5].sum(), 8, column.tolist())


if __name__ == "__main__":
    unittest.main()
