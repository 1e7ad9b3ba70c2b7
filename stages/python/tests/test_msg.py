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


if __name__ == "__main__":
    unittest.main()
