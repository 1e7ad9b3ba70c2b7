"""What a merge may be given, and how what it may not is refused."""

import tempfile
import unittest
import warnings
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np

import gridweave
from gridweave import Frame, Map, RequestError, merge, read_log, run

from test_merge import message, room

A, B = room(), room(12, 7)


class InFolder(unittest.TestCase):
    """Has the map files a.yaml and b.yaml, and a log of both."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = Path(folder.name)
        self.a, self.b, self.log = self.path / "a.yaml", self.path / "b.yaml", self.path / "robots.mcap"
        Map(A, 0.05).save(self.a)
        Map(B, 0.05).save(self.b)

    def make_log(self):
        run("map_files_to_log", [self.a, self.b], output=self.log)

    def refuses(self, text, call, *arguments, **more):
        with self.assertRaises(RequestError) as caught:
            call(*arguments, **more)
        self.assertRegex(str(caught.exception), text)
        self.assertNotIn("\n", str(caught.exception))
        return caught.exception


class InputsTest(InFolder):
    def test_a_resolution_without_an_array_is_refused(self):
        for inputs in ([self.a, self.b], [Map(A, 0.05), message(B)], {"x": self.a}, [self.a, Map(B, 0.05)]):
            self.refuses("`resolution` is the side of a cell of arrays", merge, inputs, resolution=0.1)
        self.assertEqual(set(merge([self.a, B], resolution=0.05).frames), {"a", "robot2"})

    def test_a_map_beside_files_leaves_the_files_their_names(self):
        self.assertEqual(set(merge([self.a, Map(B, 0.05)]).frames), {"a", "robot2"})
        self.assertEqual(set(merge([f"attic={self.a}", message(B)]).frames), {"attic", "robot2"})
        Map(B, 0.05).save(self.path / "robot1.yaml")
        self.refuses("two maps are of `robot1`", merge, [Map(A, 0.05), self.path / "robot1.yaml"])

    def test_a_mapping_names_the_robots_of_map_files_and_of_logs(self):
        self.assertEqual(set(merge({"x": self.a, "y": str(self.b)}).frames), {"x", "y"})
        for robot, file, origin in (("one", self.a, A), ("two", self.b, B)):
            (self.path / robot).mkdir()
            Map(origin, 0.05).save(self.path / robot / "map.yaml")
        grids = {}
        for robot, cells in (("p", A), ("q", B)):
            # A log whose topics name no robot.
            grids[robot] = self.path / f"{robot}.mcap"
            self.write_unnamed(grids[robot], cells)
        self.assertEqual(set(merge(grids).frames), {"p", "q"})
        for name in ("", "a/b", "a=b", 3, "{robot}"):
            self.refuses("is no name of a robot", merge, {name: self.a, "y": self.b})

    def write_unnamed(self, file, cells):
        @gridweave.stage
        def unnamed(map: gridweave.msg.nav_msgs.OccupancyGrid) -> gridweave.msg.nav_msgs.OccupancyGrid:
            """Sends maps of no robot."""
            return map

        kind = type("Unnamed", (gridweave.Stage,), {
            "map": gridweave.Input(gridweave.msg.nav_msgs.OccupancyGrid),
            "out": gridweave.Output(gridweave.msg.nav_msgs.OccupancyGrid, topic="/map"),
            "on_map": lambda self, map, about: self.out.send(map),
        })
        Map(cells, 0.05).save(self.path / "some.yaml")
        (self.path / "unnamed.toml").write_text(
            '[pipeline]\nname = "unnamed"\n[stages.files]\nkind = "map_file_source"\n[stages.own]\nkind = "own"\ninputs = ["files"]\n'
            '[stages.output]\nkind = "mcap_sink"\ninputs = ["own"]\n'
        )
        run(self.path / "unnamed.toml", [self.path / "some.yaml"], output=file, stages={"own": kind})

    def test_logs_are_not_merged_with_maps_in_memory(self):
        self.make_log()
        for inputs in ([self.log, Map(A, 0.05)], {"x": self.log, "y": Map(A, 0.05)}, [A, f"x={self.log}"]):
            self.refuses("robots.mcap is a log, which is not merged with maps in memory", merge, inputs)
        self.refuses("topo.json is a topological map", merge, [self.path / "topo.json", Map(A, 0.05)])
        self.refuses("a.pgm is an image", merge, [self.path / "a.pgm", Map(A, 0.05)])

    def test_an_array_of_three_dimensions_is_a_list_of_maps(self):
        self.assertEqual(set(merge(np.stack([A, B]), resolution=0.05).frames), {"robot1", "robot2"})

    def test_frames_are_initial_poses(self):
        first = merge([A, B], resolution=0.05)
        given = {"resolution": 0.05, "accept": {"robot2": "initial"}, "reference": "robot1"}
        again = merge([A, B], initial=first.frames, **given)
        self.assertEqual((again.frames["robot2"].x, again.frames["robot2"].y), (first.frames["robot2"].x, first.frames["robot2"].y))
        moved = Frame(-0.55, -0.3, 0.0, np.zeros((3, 3)))
        self.assertAlmostEqual(merge([A, B], initial={"robot2": moved}, **given).frames["robot2"].x, -0.55)

    def test_what_merge_cannot_be_asked_for_is_one_sentence(self):
        two, deep = [A, B], {"resolution": 0.05}
        for text, inputs, more in [
            ("a list or a mapping", None, {}),
            ("a list or a mapping", 3, {}),
            ("a list or a mapping", b"a.yaml", {}),
            ("an input is a path, a Map, an array", [None, A], deep),
            ("an input is a path, a Map, an array", [b"a.yaml", A], deep),
            ("of several lengths", [[[0, 1], [2]], A], deep),
            ("length in metres, and not '0.05'", two, {"resolution": "0.05"}),
            ("`reference` is the name of a robot, and not 1", two, deep | {"reference": 1}),
            ("a seed is a whole number", two, deep | {"seed": "a"}),
            ("a seed is a whole number", two, deep | {"seed": True}),
            ("`initial` is a mapping", two, deep | {"initial": [(0, 0, 0)]}),
            ("initial pose of `robot2` is a Frame or", two, deep | {"initial": {"robot2": (1, 2)}}),
            ("initial pose of `robot2` is a Frame or", two, deep | {"initial": {"robot2": "123"}}),
            ("initial pose of `robot2` is a Frame or", two, deep | {"initial": {"robot2": (1, 2, float("nan"))}}),
            ("`accept` is a mapping", two, deep | {"accept": ["robot2"]}),
            ("`accept` of `robot2` is the number of a hypothesis", two, deep | {"accept": {"robot2": 0}}),
            ("`accept` of `robot2` is the number of a hypothesis", two, deep | {"accept": {"robot2": "first"}}),
            ("`parameters` is a mapping", two, deep | {"parameters": ["elastic.enabled"]}),
            ("a file is given by its path", two, deep | {"output": 3}),
            ("rows and columns", [np.zeros((4, 4, 3))], deep),
        ]:
            with self.subTest(text):
                self.refuses(text, merge, inputs, **more)

    def test_accept_and_seed_may_be_numbers_of_numpy(self):
        merge([A, B], resolution=np.float32(0.05), accept={"robot2": np.int64(1)}, seed=np.uint8(3))

    def test_messages_that_hold_no_map_are_refused(self):
        for data, text in (([300] * A.size, "from 300 to 300"), (A.tobytes(), "whole numbers"), (["a"] * A.size, "whole numbers"),
                           ([0.5] * A.size, "whole numbers"), ([0], "220 x 180 cells, and has 1")):
            wrong = message(A)
            wrong.data = data
            with self.subTest(text):
                self.refuses(text, merge, [wrong])
        self.refuses("no message with an occupancy grid", merge, [SimpleNamespace(info=3, data=[])])
        odd = message(A)
        odd.info.width = "wide"
        self.refuses("no message with an occupancy grid", merge, [odd])

    def test_the_image_of_a_map_file_is_refused_with_the_cure(self):
        self.refuses("is an image: give the YAML file of the map", Map.load, self.path / "a.pgm")

    def test_a_package_that_is_missing_is_named_with_what_installs_it(self):
        result = merge([A, B], resolution=0.05)
        with mock.patch.dict("sys.modules", {"tqdm.auto": None, "tqdm": None, "matplotlib.pyplot": None, "matplotlib": None}):
            self.refuses(r"needs tqdm.*gridweave\[progress\]", merge, [A, B], resolution=0.05, progress=True)
            self.refuses(r"needs matplotlib.*gridweave\[plot\]", result.plot)


class CellsTest(unittest.TestCase):
    def cells(self, *rows):
        return Map(*rows, 0.05).cells.tolist()

    def test_each_form_of_cells_is_read_as_it_is_meant(self):
        nan = np.nan
        for form, given, cells in [
            ("int8", np.array([[-1, 0, 100]], np.int8), [[-1, 0, 100]]),
            ("uint8, which is int8 read by others", np.array([[255, 0, 100]], np.uint8), [[-1, 0, 100]]),
            ("int64", np.array([[-1, 0, 65]]), [[-1, 0, 65]]),
            ("bool", np.array([[True, False]]), [[100, 0]]),
            ("fractions with NaN", np.array([[nan, 0.0, 0.25, 1.0]]), [[-1, 0, 25, 100]]),
            ("fractions with -1", np.array([[-1.0, 0.0, 0.25, 1.0]], np.float32), [[-1, 0, 25, 100]]),
            ("floats of whole numbers", np.array([[-1.0, 0.0, 25.0, 100.0]]), [[-1, 0, 25, 100]]),
            ("floats of whole numbers with NaN", np.array([[nan, 0.0, 100.0]]), [[-1, 0, 100]]),
            ("masked int8", np.ma.masked_array(np.array([[7, 0, 100]], np.int8), [[True, False, False]]), [[-1, 0, 100]]),
            ("masked fractions", np.ma.masked_array([[0.5, 0.0, 1.0]], [[True, False, False]]), [[-1, 0, 100]]),
            ("masked values that would be out of range", np.ma.masked_equal([[-9999, 0, 100]], -9999), [[-1, 0, 100]]),
            ("lists", [[-1, 0], [100, 0]], [[-1, 0], [100, 0]]),
            ("nothing", np.empty((0, 4)), []),
        ]:
            with self.subTest(form):
                self.assertEqual(self.cells(given), cells)
                self.assertEqual(Map(given, 0.05).cells.dtype, np.int8)

    def test_what_could_be_a_picture_is_refused_and_says_how_one_becomes_a_map(self):
        picture = np.array([[0, 255, 205], [255, 254, 0]], np.uint8)
        for given in (picture, np.where(picture > 100, np.uint8(255), np.uint8(0)), picture.astype(float), np.array([[0.5, 7.25]])):
            with self.assertRaisesRegex(RequestError, r"`Map.load`.*255 - picture"):
                Map(given, 0.05)
        self.assertEqual(self.cells((255 - np.array([[0, 255], [255, 255]], np.uint8)[::-1]) / 255), [[0, 0], [100, 0]])

    def test_more_cells_than_a_map_file_may_have_are_refused_before_they_are_copied(self):
        with self.assertRaisesRegex(RequestError, "1000000 x 2000000 cells has more than the maximum"):
            Map(np.broadcast_to(np.int8(0), (2_000_000, 1_000_000)), 0.05)

    def test_a_resolution_that_a_message_cannot_hold_is_refused(self):
        for resolution in (1e-300, 1e300, 0, -0.05, float("nan"), float("inf")):
            with self.assertRaisesRegex(RequestError, "length in metres"):
                Map([[0]], resolution)

    def test_what_holds_no_numbers_is_refused(self):
        for given, text in (([["a"]], "and not texts"), (np.array([[None]]), "and not objects"), ([[1j]], "complex"), (3, "0 dimensions")):
            with self.assertRaisesRegex(RequestError, text):
                Map(given, 0.05)
        for origin in ((1, 2), None, "abc", (1, 2, float("inf"))):
            with self.assertRaisesRegex(RequestError, "origin"):
                Map([[0]], 0.05, origin)


class TopicsTest(InFolder):
    def test_one_text_is_one_topic(self):
        self.make_log()
        for topics in ("/a/map", ["/a/map"], {"/a/map"}):
            self.assertEqual({logged.topic for logged in read_log(self.log, topics=topics)}, {"/a/map"})

    def test_topics_without_a_message_are_a_warning_at_the_end(self):
        self.make_log()
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            list(read_log(self.log, topics=["/a/map", "/c/map", "/d/map"]))
            list(read_log(self.log))
        self.assertEqual([str(warning.message) for warning in caught], ["no message was read on /c/map, /d/map"])

    def test_what_is_no_log_or_no_topic_is_refused(self):
        self.refuses("a list of paths, and not by None", read_log, None)
        self.refuses("by its path", read_log, [3])
        self.refuses("a list of paths, and not by None", run, "map_merge", None)
        self.refuses("by its path", run, None)
        self.refuses("`topics` are texts", read_log, self.log, topics=[3])
        self.refuses("`topics` are texts", read_log, self.log, topics=3)


class MissingTest(InFolder):
    def test_files_that_are_not_there_or_are_no_maps_are_refused(self):
        self.refuses("there is no file .*nope.yaml", merge, [self.a, self.path / "nope.yaml"])
        self.refuses("there is no file .*nope.mcap", run, "map_merge", [self.path / "nope.mcap"])
        self.refuses("nope.yaml", Map.load, self.path / "nope.yaml")
        (self.path / "no_map.yaml").write_text("image: 5")
        self.refuses("no_map.yaml", Map.load, self.path / "no_map.yaml")


class NamesTest(InFolder):
    def test_topics_of_logs_get_other_names(self):
        self.make_log()
        result = merge(self.log, rename={"/a/map": "/attic/map"})
        self.assertEqual(sorted(result.frames), ["attic", "b"])
        self.refuses("`rename` gives a topic its name", merge, self.log, rename={"/a/map": None})
        self.refuses("`rename` is a mapping", merge, self.log, rename=["/a/map=/attic/map"])

    def test_the_place_of_a_lidar_is_numbers_and_of_logs(self):
        self.refuses("the lidar of `a` is at \\(x, y, yaw\\)", merge, self.log, lidar={"a": (0.1, 0.0)})
        self.refuses("lidar is for logs", merge, [self.a, self.b], lidar={"a": (0.1, 0.0, 0.0)})

    def test_thresholds_of_files_are_taken_literally_if_asked(self):
        self.assertTrue(merge([self.a, self.b], literal_thresholds=True).is_complete)

    def test_a_pair_has_its_evidence_in_numbers(self):
        (pair,) = merge([self.a, self.b]).pairs
        self.assertGreater(pair.evidence.wall_on_wall_m, 20)
        self.assertLess(pair.evidence.wall_on_free_m, 1)

if __name__ == "__main__":
    unittest.main()
