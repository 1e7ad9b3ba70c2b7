"""Looks at what is published, as viewer.py does, with subscribers of zenoh-ros2-sdk, and prints the same.

Arguments: the Zenoh router, how many robots, how many seconds to wait at most, a folder of definitions.
"""

import json
import math
import sys
import threading
import time

from sdk import LATCHED, RELIABLE, know, start
from zenoh_ros2_sdk import ROS2Subscriber, get_topic_names_and_types

router, robots, longest, folder = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), sys.argv[4]
session, seen, changed = start(router, folder), {}, threading.Event()


def fail(words):
    # Without that its threads go on.
    session.close()
    sys.exit(words)


def take_map(grid):
    info = grid.info
    assert len(grid.data) == info.width * info.height
    known = int((grid.data >= 0).sum())
    seen["map"] = {"frame": grid.header.frame_id, "width": info.width, "height": info.height, "known": known}
    changed.set()


def take_update(update):
    assert len(update.data) == update.width * update.height and update.header.frame_id == "world"


def take_frames(message):
    frames = {}
    for one in message.transforms:
        at, turn = one.transform.translation, one.transform.rotation
        yaw = math.atan2(2 * turn.w * turn.z, 1 - 2 * turn.z * turn.z)
        frames[one.child_frame_id] = {"parent": one.header.frame_id, "x": at.x, "y": at.y, "yaw": yaw}
    seen["frames"] = frames
    changed.set()


def is_done():
    return "map" in seen and len(seen.get("frames", {})) >= robots


TOPICS = [
    ("/map", "nav_msgs/msg/OccupancyGrid", take_map, LATCHED),
    ("/map_updates", "map_msgs/msg/OccupancyGridUpdate", take_update, RELIABLE),
    ("/tf_static", "tf2_msgs/msg/TFMessage", take_frames, LATCHED),
]
for _, ros_type, _, _ in TOPICS:
    know(ros_type)
end = time.monotonic() + longest
while not is_done():
    # What was sent before is asked for once only, of the publishers that are known when a subscriber begins, and one that comes later is not
    # asked: so they begin anew.
    subscribers = [
        ROS2Subscriber(topic, ros_type, call, node_name="viewer", domain_id=0, qos=qos)
        for topic, ros_type, call, qos in TOPICS
    ]
    until = time.monotonic() + 5.0
    while not is_done() and changed.wait(max(0.0, until - time.monotonic())):
        changed.clear()
    for subscriber in subscribers:
        subscriber.close()
    if time.monotonic() > end and not is_done():
        fail(f"there is only {seen}")
seen["publishers"] = {}
# What is there when it asks may not all be told at once.
while not {"/map", "/tf_static"} <= seen["publishers"].keys():
    if time.monotonic() > end:
        fail(f"these topics alone are listed: {seen['publishers']}")
    for topic, ros_types in get_topic_names_and_types(domain_id=0, timeout=10.0):
        package, _, name = ros_types[0].split("/")
        seen["publishers"][topic] = f"{package}::msg::dds_::{name}_"
json.dump(seen, sys.stdout)
session.close()
