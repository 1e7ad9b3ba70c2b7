"""Nodes of the real rclpy, over Fast DDS, on this machine alone. What they do is the first argument; those after it are its own.

A message that is published may be bytes: rclpy sends them as they are.
"""

import array
import importlib
import json
import sys
import time

import rclpy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RELIABLE = QoSProfile(depth=10)
SENSOR = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)


def until(node, is_done, longest, what):
    end = time.monotonic() + longest
    while not is_done():
        if time.monotonic() > end:
            sys.exit(f"{what} did not come")
        rclpy.spin_once(node, timeout_sec=0.1)


def robots(log, rate):
    """Plays the robots of a log, a node for each in its namespace, and stays until standard input ends."""
    from mcap.reader import make_reader

    kinds = {"nav_msgs/msg/OccupancyGrid": (OccupancyGrid, LATCHED), "geometry_msgs/msg/PoseStamped": (PoseStamped, SENSOR)}
    nodes, publishers = {}, {}
    with open(log, "rb") as stream:
        start, first = time.monotonic(), None
        for schema, channel, message in make_reader(stream).iter_messages():
            robot = channel.topic.strip("/").split("/")[0]
            if schema.name not in kinds or not robot.startswith("robot"):
                continue
            if channel.topic not in publishers:
                if robot not in nodes:
                    nodes[robot] = rclpy.create_node("slam", namespace=robot)
                kind, qos = kinds[schema.name]
                publishers[channel.topic] = nodes[robot].create_publisher(kind, channel.topic, qos)
            first = first or message.log_time
            time.sleep(max(0.0, (message.log_time - first) / 1e9 / float(rate) - (time.monotonic() - start)))
            publishers[channel.topic].publish(message.data)
    print("all is sent", flush=True)
    sys.stdin.read()


def map_of(width, value):
    grid = OccupancyGrid()
    grid.header.frame_id = "map"
    grid.info.width = grid.info.height = width
    grid.info.resolution = 0.05
    # A list would take seconds.
    grid.data = array.array("b", bytes([value]) * (width * width))
    return grid


def publish_map(topic, width, value):
    """Publishes one map, and stays until standard input ends."""
    node = rclpy.create_node("slam")
    publisher = node.create_publisher(OccupancyGrid, topic, LATCHED)
    publisher.publish(map_of(int(width), int(value)))
    print("all is sent", flush=True)
    sys.stdin.read()


def publish_strings(topic):
    """Publishes something that is no map where a map is expected, and stays until standard input ends."""
    node = rclpy.create_node("talker")
    node.create_publisher(String, topic, LATCHED).publish(String(data="no map"))
    print("all is sent", flush=True)
    sys.stdin.read()


def view(least_known, longest):
    """Looks at the merged map until it knows so many cells, and prints what it has seen as JSON."""
    node, seen = rclpy.create_node("viewer"), {}

    def take(grid):
        assert len(grid.data) == grid.info.width * grid.info.height
        known = len(grid.data) - grid.data.count(-1)
        seen["map"] = {"frame": grid.header.frame_id, "width": grid.info.width, "known": known}

    node.create_subscription(OccupancyGrid, "/map", take, LATCHED)
    until(node, lambda: seen.get("map", {}).get("known", 0) >= int(least_known), float(longest), f"a map beyond {seen}")
    until(node, lambda: ("gridweave_ros", "/") in node.get_node_names_and_namespaces(), float(longest), "the node's name")
    [about] = node.get_publishers_info_by_topic("/map")
    seen["publisher"] = [about.node_name, about.topic_type, str(about.topic_type_hash), about.qos_profile.durability.name]
    json.dump(seen, sys.stdout)


def follow(count, walls, longest):
    """Keeps a map by its updates, as RViz does, and static transforms: says when so many updates have come, and ends when so many
    cells are walls, with all as JSON. It needs the packages map_msgs and tf2_msgs."""
    from map_msgs.msg import OccupancyGridUpdate
    from tf2_msgs.msg import TFMessage

    node, seen, frames = rclpy.create_node("viewer"), {"cells": [], "updates": 0}, {}

    def take(grid):
        seen.update(cells=list(grid.data), width=grid.info.width)

    def update(part):
        seen["updates"] += 1
        if seen["updates"] == int(count):
            print("hears updates", flush=True)
        for row in range(part.height if seen["cells"] else 0):
            start = (part.y + row) * seen["width"] + part.x
            seen["cells"][start : start + part.width] = part.data[row * part.width : (row + 1) * part.width]

    def place(message):
        for one in message.transforms:
            at = one.transform.translation
            frames[one.child_frame_id] = [one.header.frame_id, at.x, at.y]

    node.create_subscription(OccupancyGrid, "/map", take, LATCHED)
    node.create_subscription(OccupancyGridUpdate, "/map_updates", update, QoSProfile(depth=100))
    node.create_subscription(TFMessage, "/tf_static", place, LATCHED)
    until(node, lambda: seen["cells"].count(100) == int(walls) and frames, float(longest), f"{walls} walls, and frames")
    print(json.dumps([seen["cells"], frames]))


def ask_for_more():
    """Asks for a durability that is not offered, says when it knows that, and stays until standard input ends."""
    from rclpy.event_handler import SubscriptionEventCallbacks

    node, told = rclpy.create_node("picky"), []
    events = SubscriptionEventCallbacks(incompatible_qos=told.append)
    node.create_subscription(PoseStamped, "/odd", print, LATCHED, event_callbacks=events)
    until(node, lambda: told, 60.0, "the event of an incompatible QoS")
    print("incompatible", flush=True)
    sys.stdin.read()


def fields_of(value):
    """A message as JSON has it."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: fields_of(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (str, bytes, bool, int, float)):
        return value
    return [fields_of(one) for one in value]


def read_log(log):
    """Prints the messages of a log as JSON, a line each, where a package has their type."""
    from mcap.reader import make_reader
    from rclpy.serialization import deserialize_message

    with open(log, "rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            package, _, name = schema.name.split("/")
            try:
                kind = getattr(importlib.import_module(f"{package}.msg"), name)
            except ModuleNotFoundError:
                continue
            value = deserialize_message(message.data, kind)
            print(json.dumps({"topic": channel.topic, "type": schema.name, "message": fields_of(value)}))


rclpy.init()
{f.__name__: f for f in (robots, publish_map, publish_strings, view, follow, ask_for_more, read_log)}[sys.argv[1]](*sys.argv[2:])
