"""Plays the robots of a log (MCAP), as robots.py does, with publishers of zenoh-ros2-sdk.

Arguments: the Zenoh router, the log, how many times as fast, a folder of definitions. These publishers keep nothing for those who come
late, and so it begins once all topics are heard. It stays until its standard input ends.
"""

import sys
import time

from mcap.reader import make_reader
from sdk import LATCHED, RELIABLE, know, start
from zenoh_ros2_sdk import ROS2Publisher

router, log, rate, folder = sys.argv[1], sys.argv[2], float(sys.argv[3]), sys.argv[4]
store, publishers = start(router, folder).store, {}
with open(log, "rb") as stream:
    summary = make_reader(stream).get_summary()
for channel in summary.channels.values():
    robot = channel.topic.strip("/").split("/")[0]
    if robot.startswith("robot"):
        ros_type = summary.schemas[channel.schema_id].name
        know(ros_type)
        qos = LATCHED if ros_type == "nav_msgs/msg/OccupancyGrid" else RELIABLE
        publishers[channel.topic] = ROS2Publisher(channel.topic, ros_type, node_name=f"slam_of_{robot}", domain_id=0, qos=qos)
while not all(publisher.pub.matching_status.matching for publisher in publishers.values()):
    time.sleep(0.02)
with open(log, "rb") as stream:
    start, first = time.monotonic(), None
    for schema, channel, message in make_reader(stream).iter_messages():
        if channel.topic not in publishers:
            continue
        first = first or message.log_time
        time.sleep(max(0.0, (message.log_time - first) / 1e9 / rate - (time.monotonic() - start)))
        said = store.deserialize_cdr(message.data, schema.name)
        fields = {name: getattr(said, name) for name in said.__dataclass_fields__ if name != "__msgtype__"}
        publishers[channel.topic].publish(**fields)
print("all is sent", flush=True)
sys.stdin.read()
