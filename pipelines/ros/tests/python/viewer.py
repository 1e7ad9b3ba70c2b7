"""Looks at what is published as RViz does, until the merged map and the frames of so many robots are there, and prints them as JSON.

Arguments: the Zenoh router, how many robots, how many seconds to wait at most.
"""

import json
import math
import sys
import threading
import time

from ros import Node

router, robots, longest = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
node, seen, changed = Node(router, "rviz"), {"publishers": {}}, threading.Event()


def take_map(grid):
    info = grid.info
    known = int((grid.data >= 0).sum())
    assert len(grid.data) == info.width * info.height
    seen["map"] = {"frame": grid.header.frame_id, "width": info.width, "height": info.height, "known": known}
    changed.set()


def take_frames(message):
    frames = {}
    for one in message.transforms:
        at, turn = one.transform.translation, one.transform.rotation
        yaw = math.atan2(2 * turn.w * turn.z, 1 - 2 * turn.z * turn.z)
        frames[one.child_frame_id] = {"parent": one.header.frame_id, "x": at.x, "y": at.y, "yaw": yaw}
    seen["frames"] = frames
    changed.set()


def take_publisher(topic, ros_type):
    seen["publishers"][topic] = ros_type
    changed.set()


def is_done():
    return "map" in seen and len(seen.get("frames", {})) >= robots and {"/map", "/tf_static"} <= seen["publishers"].keys()


node.watch_publishers(take_publisher)
node.subscribe("/map", "nav_msgs/msg/OccupancyGrid", take_map)
node.subscribe("/tf_static", "tf2_msgs/msg/TFMessage", take_frames)
end = time.monotonic() + longest
while not is_done():
    if not changed.wait(max(0.0, end - time.monotonic())) or time.monotonic() > end:
        sys.exit(f"there is only {seen}")
    changed.clear()
json.dump(seen, sys.stdout)
node.session.close()
