"""Merging maps, and what comes of it."""

import _thread
import math
import signal
import tempfile
import threading
import unittest
import warnings
from array import array
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import gridweave
from gridweave import GridweaveError, Map, RequestError, merge, read_log


def room(x: int = 0, y: int = 0) -> np.ndarray:
    """A room of 8 m by 6 m in cells of 0.05 m, with a table and a side wall, whose corner is at the cell (x, y)."""
    cells = np.full((180, 220), -1, np.int8)
    inside = np.zeros((120, 160), np.int8)
    inside[[0, -1], :] = inside[:, [0, -1]] = 100
    inside[30:50, 60:75] = 100
    inside[80, 91:] = 100
    cells[y : y + 120, x : x + 160] = inside
    return cells


def message(cells: np.ndarray) -> SimpleNamespace:
    """A message as rclpy has it."""
    orientation = SimpleNamespace(x=0.0, y=0.0, z=math.sin(0.25), w=math.cos(0.25))
    origin = SimpleNamespace(position=SimpleNamespace(x=1.0, y=2.0, z=0.0), orientation=orientation)
    info = SimpleNamespace(resolution=0.05, width=cells.shape[1], height=cells.shape[0], origin=origin)
    return SimpleNamespace(info=info, data=array("b", cells.tobytes()))


class MergeTest(unittest.TestCase):
    def test_arrays_are_merged_and_the_result_has_frames_map_and_reasons(self):
        result = merge([room(), room(12, 7)], resolution=0.05)
        self.assertTrue(result.is_complete)
        frame = result.frames["robot2"]
        np.testing.assert_allclose((frame.x, frame.y, frame.yaw), (-0.6, -0.35, 0.0), atol=0.03)
        self.assertEqual(frame.covariance.shape, (3, 3))
        self.assertEqual(result.reference, "robot1")
        # A corner of the table, as both robots have it.
        np.testing.assert_allclose(result.transform("robot2", (3.6, 1.85)), result.transform("robot1", (3.0, 1.5)), atol=0.05)
        np.testing.assert_allclose(result.transform("robot2", [(3.6, 1.85)] * 2), [(3.0, 1.5)] * 2, atol=0.05)
        self.assertEqual(result.map.cells.dtype, np.int8)
        self.assertGreater((result.map.cells == 100).sum(), 700)
        (pair,) = result.pairs
        self.assertTrue(pair.accepted and pair.probability > 0.98, pair)
        self.assertIn("log-odds", pair.reason)
        self.assertEqual(result.stages["files"].messages_out, 2)
        self.assertIn("robot2: merged", repr(result))
        self.assertIn("<td>robot2</td>", result._repr_html_())

    def test_a_map_is_the_same_however_it_is_given(self):
        a, b = room(), room(12, 7)
        expected = merge([a, b], resolution=0.05)
        origin = (1.0, 2.0, 0.5)
        of_messages = merge([message(a), message(b)])
        of_maps = merge([Map(a, 0.05, origin), Map(b, 0.05, origin).to_message()])
        self.assertEqual(of_messages.summary["frames"], of_maps.summary["frames"])
        fractions = np.where(b < 0, np.nan, b / 100.0)
        self.assertEqual(merge([a.astype(int), fractions], resolution=0.05).summary["frames"], expected.summary["frames"])
        self.assertEqual(list(merge({"attic": a, "cellar": b}, resolution=0.05).frames), ["attic", "cellar"])

    def test_files_are_merged_and_results_written(self):
        with tempfile.TemporaryDirectory() as folder:
            files = [Path(folder) / "a.yaml", Path(folder) / "b.yaml"]
            for file, cells in zip(files, (room(), room(12, 7))):
                Map(cells, 0.05).save(file)
            np.testing.assert_array_equal(Map.load(files[1]).cells, room(12, 7))
            result = merge(files)
            self.assertEqual(set(result.frames), {"a", "b"})
            result.to_yaml(Path(folder) / "merged.yaml")
            np.testing.assert_array_equal(Map.load(Path(folder) / "merged.yaml").cells == 100, result.map.cells == 100)
            result.to_mcap(Path(folder) / "merged.mcap")
            logged = {message.topic: message for message in read_log(Path(folder) / "merged.mcap")}
            grid = logged["/map"].message
            self.assertIsInstance(grid, __import__("gridweave.msg.nav_msgs", fromlist=["OccupancyGrid"]).OccupancyGrid)
            np.testing.assert_array_equal(Map.from_message(grid).cells, result.map.cells)
            only = list(read_log([Path(folder) / "merged.mcap"], topics=["/map"]))
            self.assertEqual({message.topic for message in only}, {"/map"})

    def test_what_cannot_be_merged_is_no_error_and_says_why(self):
        result = merge([room(), np.zeros((100, 100), np.int8)], resolution=0.05)
        self.assertFalse(result.is_complete)
        self.assertTrue(result.unmerged["robot2"])
        with self.assertRaisesRegex(RequestError, "robot2` is not merged"):
            result.transform("robot2", (0, 0))

    def test_known_poses_and_parameters_are_those_of_the_command(self):
        pose = (-0.6, -0.35, 0.0, 0.5, 0.1)
        given = {"initial": {"robot2": pose}, "reference": "robot1", "parameters": {"elastic.enabled": False}, "seed": 7}
        result = merge([room(), room(12, 7)], resolution=0.05, **given)
        self.assertTrue(result.is_complete)
        self.assertEqual(result.deformations, {})
        accepted = merge([room(), room(12, 7)], resolution=0.05, **given, accept={"robot2": "initial"})
        np.testing.assert_allclose((accepted.frames["robot2"].x, accepted.frames["robot2"].y), pose[:2], atol=1e-6)

    def test_wrong_requests_are_exceptions_of_their_own(self):
        for inputs, more, text in [
            ([room()], {}, "resolution"),
            ([], {"resolution": 0.05}, "nothing to merge"),
            (room(), {"resolution": 0.05}, "a list of maps"),
            ([room() + 100], {"resolution": 0.05}, "Map.load"),
            ([room()[0]], {"resolution": 0.05}, "rows and columns"),
            ([room()], {"resolution": -1}, "resolution"),
            ([room()], {"resolution": 0.05, "parameters": {"icp.nonsense": 1}}, "nonsense"),
            ([room()], {"resolution": 0.05, "parameters": {"icp.nonsense": object()}}, "a parameter is"),
            ([room(), room()], {"resolution": 0.05, "reference": "nobody"}, "nobody"),
            ([room()], {"resolution": 0.05, "initial": {"robot1": ("x", 0, 0)}}, "initial pose of `robot1`"),
            ([room()], {"resolution": 0.05, "seed": -1}, "seed"),
            ({"": room(), "b": room()}, {"resolution": 0.05}, "no name of a robot"),
            (["no/such/file.yaml"], {}, "no/such/file.yaml"),
        ]:
            with self.subTest(text), self.assertRaisesRegex(GridweaveError, text):
                merge(inputs, **more)
        with self.assertRaisesRegex(GridweaveError, "no/such/log"):
            read_log("no/such/log.mcap")

    def test_progress_is_reported_and_its_errors_end_the_merge(self):
        shares = []
        merge([room(), room(12, 7)], resolution=0.05, progress=shares.append)
        self.assertTrue(all(0 <= share <= 1 for share in shares), shares)

        class Tired(Exception):
            pass

        def tire(share):
            raise Tired

        with self.assertRaises(Tired):
            big = np.kron(room(), np.ones((8, 8), np.int8))
            merge([big, np.roll(big, 100)], resolution=0.05, progress=tire)

    def test_an_interrupt_ends_a_merge_and_other_threads_go_on(self):
        # Large enough to take far longer than the interrupt takes to come.
        big = np.kron(room(), np.ones((24, 24), np.int8))
        went_on = threading.Event()
        # A test that a shell runs in the background may have been told to ignore interrupts.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self.addCleanup(signal.signal, signal.SIGINT, before)

        def interrupt():
            went_on.set()
            _thread.interrupt_main()

        timer = threading.Timer(0.05, interrupt)
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            merge([big, np.roll(big, 900), np.rot90(big).copy()], resolution=0.02)
        timer.join()
        self.assertTrue(went_on.is_set())

    def test_warnings_of_files_are_warnings(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "grey.yaml"
            image = np.full((40, 40), 205, np.uint8)
            image[5:35, 5:35], image[10, 5:35] = 254, 100
            (Path(folder) / "grey.pgm").write_bytes(b"P5 40 40 255\n" + image.tobytes())
            file.write_text("image: grey.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n")
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                Map.load(file)
            self.assertTrue(any("grey.yaml" in str(warning.message) for warning in caught))

    def test_a_plot_shows_the_map_and_the_frames(self):
        try:
            from matplotlib.figure import Figure
        except ImportError:
            self.skipTest("matplotlib is not installed")
        result = merge([room(), room(12, 7)], resolution=0.05)
        axes = result.plot(Figure().subplots())
        self.assertEqual({text.get_text().strip() for text in axes.texts} - {""}, {"robot1", "robot2"})
        self.assertIn("data:image/png", result._repr_html_())

    def test_the_names_of_the_package_are_there(self):
        for name in gridweave.__all__:
            self.assertIsNotNone(getattr(gridweave, name))
        with self.assertRaises(AttributeError):
            gridweave.nothing_of_that_name


if __name__ == "__main__":
    unittest.main()
