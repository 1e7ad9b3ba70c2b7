"""The interface of a stage, and how it handles a message."""

import tempfile
import unittest
from pathlib import Path

import numpy as np

from gridweave import About, Context, Input, Output, Parameter, Stage, stage
from gridweave.load import load
from gridweave.msg import define
from gridweave.msg.geometry_msgs import PoseStamped
from gridweave.msg.nav_msgs import OccupancyGrid

ABOUT = About("robot1", 5, "/robot1/map", 0)


class Corners(Stage):
    """Sends the pose of each map's corner.

    And more, which nobody is shown.
    """

    map = Input(OccupancyGrid, "the robots' maps", many=True)
    corner = Output(PoseStamped, "the corner")
    height = Parameter(0.5, "metres", minimum=0.0, below=9.0)
    way = Parameter("outer", choices=("outer", "inner"))
    sizes = Parameter([1.0])

    def __init__(self):
        self.seen = self.height

    def on_map(self, map, about):
        self.seen += 1.0
        if about.robot == "":
            self.warn("maps of nobody")
        sent = PoseStamped(map.header, map.info.origin)
        sent.pose.position.z = self.height
        self.corner.send(sent, about.robot)


class WithoutWords(Corners):
    pass


class StageTest(unittest.TestCase):
    def begin(self, kind, parameters=None):
        self.sent, self.warned = [], []
        return kind.begin(parameters, Context(seed=3), lambda *what: self.sent.append(what), self.warned.append)

    def test_a_class_has_ports_and_parameters(self):
        interface = Corners.interface()
        self.assertEqual(interface["summary"], "Sends the pose of each map's corner.")
        self.assertEqual(WithoutWords.interface()["summary"], "WithoutWords")
        self.assertEqual(interface["inputs"][0]["type"], "nav_msgs/msg/OccupancyGrid")
        self.assertTrue(interface["inputs"][0]["many"])
        self.assertEqual([port["name"] for port in interface["outputs"]], ["corner"])
        properties = interface["parameters"]["properties"]
        self.assertEqual(properties["height"], {"type": "number", "default": 0.5, "description": "metres", "minimum": 0.0,
                                                "exclusiveMaximum": 9.0})
        self.assertEqual(properties["way"]["enum"], ["outer", "inner"])
        self.assertEqual(properties["sizes"]["items"], {"type": "number"})

    def test_a_stage_has_its_parameters_when_it_is_made_and_sends_through_its_outputs(self):
        made = self.begin(Corners, {"height": 2})
        self.assertIsInstance(made.height, float)
        made.on_map(OccupancyGrid(), ABOUT)
        (output, message, robot), = self.sent
        self.assertEqual((output, message.pose.position.z, robot, made.seen), ("corner", 2.0, "robot1", 3.0))
        made.on_map(OccupancyGrid(), About("", 5, "/map", 0))
        self.assertEqual(self.warned, ["maps of nobody"])
        self.assertEqual(made.context.seed, 3)

    def test_a_type_of_ones_own_comes_with_its_definition(self):
        class Names(Stage):
            map = Input(OccupancyGrid)
            name = Output(define("stage_msgs/msg/Name", "string name"))

            def on_map(self, map, about):
                pass

        self.assertEqual(Names.interface()["definitions"], {"stage_msgs/msg/Name": "string name\n"})
        self.assertNotIn("definitions", Corners.interface())

    def test_another_type_than_that_of_the_output_is_refused(self):
        made = self.begin(Corners)
        with self.assertRaisesRegex(TypeError, "takes geometry_msgs/msg/PoseStamped, not OccupancyGrid"):
            made.corner.send(OccupancyGrid())

    def test_an_input_without_a_method_and_a_method_without_an_input_are_refused(self):
        class Deaf(Stage):
            map = Input(OccupancyGrid)

        class Idle(Stage):
            def on_map(self, map, about):
                pass

        for kind, text in ((Deaf, "no method on_map"), (Idle, "no input `map`")):
            with self.assertRaisesRegex(TypeError, text):
                kind.interface()

    def test_a_parameter_of_a_type_that_no_file_can_hold_is_refused(self):
        for default in (None, {}, [], object()):
            with self.assertRaises(TypeError):
                Parameter(default).schema()

    def test_a_function_is_a_stage_and_stays_a_function(self):
        @stage(output="inverted")
        def invert(map: OccupancyGrid, about: About, *, times: int = 1) -> OccupancyGrid | None:
            """Turns signs."""
            return OccupancyGrid(data=-map.data * times) if about.robot else None

        self.assertEqual(invert(OccupancyGrid(data=[1]), ABOUT, times=2).data.tolist(), [-2])
        kind = invert.__gridweave_stage__
        interface = kind.interface()
        self.assertEqual((interface["summary"], interface["inputs"][0]["name"], interface["outputs"][0]["name"]), ("Turns signs.", "map", "inverted"))
        made = self.begin(kind, {"times": 3})
        made.on_map(OccupancyGrid(data=[1]), ABOUT)
        made.on_map(OccupancyGrid(data=[1]), About("", 6, "/map", 0))
        self.assertEqual([(name, message.data.tolist(), robot) for name, message, robot in self.sent], [("inverted", [-3], "robot1")])

    def test_a_function_may_send_several(self):
        @stage
        def split(map: OccupancyGrid) -> list[OccupancyGrid]:
            return [OccupancyGrid(data=[cell]) for cell in map.data]

        self.begin(split.__gridweave_stage__).on_map(OccupancyGrid(data=np.arange(3)), ABOUT)
        self.assertEqual([message.data.tolist() for _, message, _ in self.sent], [[0], [1], [2]])

    def test_a_function_without_types_is_refused(self):
        with self.assertRaisesRegex(TypeError, "must declare the types"):
            stage(lambda map: map)


class Ticks(Stage):
    """Counts."""

    out = Output(PoseStamped)
    other = Output(OccupancyGrid)
    times = Parameter([0, 5, 5, 7])

    def messages(self):
        for time in self.times:
            self.out.send(PoseStamped(), "robot1", log_time=time)
            self.other.send(OccupancyGrid(), log_time=np.uint64(time))
            yield


class SourceTest(unittest.TestCase):
    def begin(self, kind, parameters=None):
        self.sent = []
        return kind.begin(parameters, send=lambda *what: self.sent.append(what))

    def test_a_source_has_no_inputs_and_sets_log_times(self):
        interface = Ticks.interface()
        self.assertEqual((interface["inputs"], [port["name"] for port in interface["outputs"]]), ([], ["out", "other"]))
        steps = self.begin(Ticks).messages()
        next(steps)
        self.assertEqual([(name, robot, time) for name, _, robot, time in self.sent], [("out", "robot1", 0), ("other", "", 0)])
        self.assertEqual(len(list(steps)), 3)
        self.assertEqual([time for *_, time in self.sent], [0, 0, 5, 5, 5, 5, 7, 7])

    def test_log_times_that_fall_or_are_none_are_refused(self):
        for times, text in (([3, 2], "2 ns comes after 3 ns"), ([-1], "never fall"), ([1 << 64], "fit in 64 bits")):
            with self.assertRaisesRegex(ValueError, text):
                list(self.begin(Ticks, {"times": times}).messages())
        for time in (None, 1.5):
            with self.assertRaises(TypeError):
                self.begin(Ticks).out.send(PoseStamped(), "robot1", time)

    def test_only_a_source_sets_log_times(self):
        made = Corners.begin()
        with self.assertRaisesRegex(TypeError, "only a source"):
            made.corner.send(PoseStamped(), "robot1", log_time=1)

    def test_a_source_without_a_generator_is_refused(self):
        class Silent(Stage):
            out = Output(PoseStamped)

        class Hasty(Silent):
            def messages(self):
                self.out.send(PoseStamped(), log_time=0)

        for kind in (Silent, Hasty):
            with self.assertRaisesRegex(TypeError, "has a generator messages"):
                kind.interface()


class LoadTest(unittest.TestCase):
    def load(self, text, name=""):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "some_stage.py"
            path.write_text("from gridweave import *\nfrom gridweave.msg.nav_msgs import OccupancyGrid\n" + text)
            return load(f"{path}{name}")

    ONE = "class One(Stage):\n    pass\n"

    def test_the_only_stage_of_a_file_needs_no_name(self):
        self.assertEqual(self.load(self.ONE).__name__, "One")
        self.assertEqual(self.load("@stage\ndef f(map: OccupancyGrid) -> OccupancyGrid: pass").__name__, "f")

    def test_of_several_one_is_named(self):
        text = self.ONE + "class Two(One):\n    pass\n"
        self.assertEqual(self.load(text, ":Two").__name__, "Two")
        for name in ("", ":Three"):
            with self.assertRaisesRegex(LookupError, "One, Two"):
                self.load(text, name)

    def test_a_file_without_a_stage_and_no_file_are_errors(self):
        with self.assertRaises(LookupError):
            self.load("")
        with self.assertRaises(FileNotFoundError):
            load("/nonexistent/some_stage.py")


if __name__ == "__main__":
    unittest.main()
