"""Messages: from the texts to dataclasses, and their encoding."""

import unittest

import numpy as np
from rosbags.serde import SerdeError

from gridweave import msg
from gridweave.msg.geometry_msgs import PoseStamped
from gridweave.msg.gridweave_msgs import Segment, Segments
from gridweave.msg.nav_msgs import OccupancyGrid


def grid(cells):
    made = OccupancyGrid(data=cells)
    made.header.frame_id = "robot1/map"
    made.info.width, made.info.height = len(cells), 1
    return made


class MessageTest(unittest.TestCase):
    def test_every_type_comes_back_as_it_went_in(self):
        for name, message_class in msg._STORE.types.items():
            with self.subTest(name):
                made = message_class()
                encoded = msg.encode(made)
                self.assertEqual(msg.encode(msg.decode(message_class, memoryview(encoded))), encoded)

    def test_a_message_is_the_same_bytes_whatever_was_in_the_memory_that_it_is_written_to(self):
        for name, message_class in msg._STORE.types.items():
            with self.subTest(name):
                dirty = bytearray(b"\xff" * msg.size(message_class()))
                msg.encode_into(message_class(), memoryview(dirty))
                self.assertEqual(bytes(dirty), msg.encode(message_class()))

    def test_cells_are_a_view_of_the_bytes_and_cannot_be_written(self):
        encoded = msg.encode(grid(np.arange(5)))
        data = msg.decode(OccupancyGrid, memoryview(encoded)).data
        self.assertTrue(np.shares_memory(data, np.frombuffer(encoded, np.int8)))
        self.assertFalse(data.flags.writeable)

    def test_messages_in_messages_are_dataclasses_with_defaults_of_their_own(self):
        first, second = PoseStamped(), PoseStamped()
        first.pose.position.x = 4.5
        self.assertEqual(second.pose.position.x, 0.0)
        walls = Segments(robot="robot1", segments=[Segment(x1=1.0), Segment(x1=2.0)])
        back = msg.decode(Segments, memoryview(msg.encode(walls)))
        self.assertEqual([segment.x1 for segment in back.segments], [1.0, 2.0])

    def test_an_array_becomes_one_of_its_type_or_is_refused_where_its_values_would_change(self):
        self.assertEqual(grid(np.zeros((2, 3), np.int64)).data.dtype, np.int8)
        self.assertEqual(grid(np.zeros((2, 3))[:0].astype(np.int8)).data.shape, (0,))
        for wrong in ([300], [1.5], np.array([200], np.uint8), ["a"]):
            with self.subTest(wrong), self.assertRaises(TypeError):
                grid(wrong)

    def test_bytes_that_are_no_such_message_are_an_error(self):
        encoded = msg.encode(grid(np.arange(100)))
        for wrong in (b"", encoded[:3], encoded[:50], encoded[:-10], b"\xff" * 200, encoded + bytes(8)):
            with self.subTest(wrong), self.assertRaises(SerdeError):
                msg.decode(OccupancyGrid, memoryview(wrong))

    def test_what_is_no_message_is_refused(self):
        with self.assertRaises(TypeError):
            msg.ros_type(int)


class OwnTypeTest(unittest.TestCase):
    ROOM = "# A room.\nstd_msgs/Header header\nstring name\nfloat32[] heights\ngeometry_msgs/Point[] corners\nuint8 LARGE=2\nuint8 size"

    def test_a_type_of_ones_own_is_as_any_other(self):
        room_type = msg.define("own_msgs/msg/Room", self.ROOM)
        from gridweave.msg.own_msgs import Room
        self.assertIs(Room, room_type)
        self.assertEqual(msg.ros_type(Room), "own_msgs/msg/Room")
        room = Room(name="kitchen", heights=[2.5, 2.0], size=Room.LARGE)
        back = msg.decode(Room, memoryview(msg.encode(room)))
        self.assertEqual((back.name, back.heights.tolist(), back.size, back.corners), ("kitchen", [2.5, 2.0], 2, []))
        floor_type = msg.define("own_msgs/msg/Floor", "Room[] rooms\nown_msgs/Room[2] two")
        floor = floor_type(rooms=[room] * 3)
        back = msg.decode(floor_type, memoryview(msg.encode(floor)))
        self.assertEqual(([room.name for room in back.rooms], len(back.two)), (["kitchen"] * 3, 2))

    def test_its_definition_has_all_types_that_it_uses_each_once(self):
        msg.define("own_msgs/msg/Room", self.ROOM)
        msg.define("own_msgs/msg/Floor", "Room[] rooms\nown_msgs/Room[2] two")
        parts = msg.definition("own_msgs/msg/Floor").split("=" * 80 + "\n")
        names = [part.splitlines()[0] for part in parts[1:]]
        self.assertEqual(parts[0], "Room[] rooms\nown_msgs/Room[2] two\n")
        self.assertEqual(names, ["MSG: own_msgs/Room", "MSG: geometry_msgs/Point", "MSG: std_msgs/Header", "MSG: builtin_interfaces/Time"])
        self.assertIsNone(msg.definition("nav_msgs/msg/OccupancyGrid"))

    def test_to_define_it_again_changes_nothing_and_otherwise_it_is_refused(self):
        first = msg.define("own_msgs/msg/Twice", "string name\n")
        self.assertIs(msg.define("own_msgs/msg/Twice", "string  name"), first)
        for name, text, text_of_error in (
            ("own_msgs/msg/Twice", "string name\nint8 more", "is known already"),
            ("nav_msgs/msg/OccupancyGrid", "string name", "is known already"),
            ("own_msgs/Room", "string name", "no name of a message type"),
            ("own_msgs/msg/room type", "string name", "no name of a message type"),
            ("own_msgs/msg/Lost", "other_msgs/Unknown x", "uses other_msgs/msg/Unknown, which is not known"),
            ("own_msgs/msg/Bad", "string", "cannot be read"),
            ("own_msgs/msg/Two", "int8 a\n" + "=" * 80 + "\nMSG: a/B\nint8 b", "several types"),
        ):
            with self.subTest(text), self.assertRaisesRegex(ValueError, text_of_error):
                msg.define(name, text)
        self.assertNotIn("own_msgs/msg/Lost", msg._STORE.types)


if __name__ == "__main__":
    unittest.main()
