"""Plays the robots of a log (MCAP): a node for each, which publishes what it has logged, so many times as fast.

Arguments: the Zenoh router, the log, how many times. It stays until its standard input ends, as robots do that stand still.
"""

import sys
import time

from mcap.reader import make_reader
from ros import STORE, Node, learn

router, log, rate = sys.argv[1], sys.argv[2], float(sys.argv[3])
nodes, senders = {}, {}
with open(log, "rb") as stream:
    start, first = time.monotonic(), None
    for schema, channel, message in make_reader(stream).iter_messages():
        robot = channel.topic.strip("/").split("/")[0]
        if not robot.startswith("robot"):
            continue
        if schema.name not in STORE.fielddefs:
            learn(schema.name, schema.data.decode())
        if channel.topic not in senders:
            if robot not in nodes:
                nodes[robot] = Node(router, f"slam_of_{robot}")
            is_latched = schema.name == "nav_msgs/msg/OccupancyGrid"
            senders[channel.topic] = nodes[robot].publish(channel.topic, schema.name, is_latched)
        first = first or message.log_time
        time.sleep(max(0.0, (message.log_time - first) / 1e9 / rate - (time.monotonic() - start)))
        senders[channel.topic](message.data)
print("all is sent", flush=True)
sys.stdin.read()
