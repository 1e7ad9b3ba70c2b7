"""Reads every message of a ROS 1 bag with `rosbags` and, where it is installed, with `rosbag` of ROS itself, and prints how
many there are of each topic.

Argument: the bag. The MD5 sums of all types that Noetic has must be its own. `rosbag` is looked for under the interpreter of the
system, as Debian installs it (`python3-rosbag`).
"""

import json
import subprocess
import sys
from collections import Counter
from pathlib import Path

from rosbags.rosbag1 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

BY_ROSBAG = """
import sys, json
try:
    import rosbag
except ImportError:
    sys.exit(9)
counts = {}
with rosbag.Bag(sys.argv[1]) as bag:
    for topic, message, time in bag.read_messages():
        counts[topic] = counts.get(topic, 0) + 1
        assert message._type
    told = {topic: info.message_count for topic, info in bag.get_type_and_topic_info().topics.items()}
    assert told == counts, (told, counts)
    first, last = bag.get_start_time(), bag.get_end_time()
    middle = sum(1 for _ in bag.read_messages(start_time=rosbag.bag.genpy.Time.from_sec((first + last) / 2)))
    assert 0 < middle <= sum(counts.values())
json.dump(counts, sys.stdout)
"""


def by_rosbags(path):
    known, store = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.EMPTY)
    counts = Counter()
    with Reader(path) as reader:
        for connection in reader.connections:
            store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
        for connection in reader.connections:
            assert store.generate_msgdef(connection.msgtype)[1] == connection.digest, connection.msgtype
            if connection.msgtype in known.types:
                assert known.generate_msgdef(connection.msgtype)[1] == connection.digest, connection.msgtype
        for connection, _, data in reader.messages():
            store.deserialize_ros1(data, connection.msgtype)
            counts[connection.topic] += 1
        assert reader.message_count == counts.total()
    return counts


path = Path(sys.argv[1])
read = by_rosbags(path)
ended = subprocess.run(["/usr/bin/python3", "-c", BY_ROSBAG, str(path)], capture_output=True, text=True)
if ended.returncode != 9:
    assert ended.returncode == 0 and "WARN" not in ended.stderr, ended.stderr
    again = json.loads(ended.stdout)
    assert read == again, f"{read} by rosbags, {again} by rosbag"
json.dump(read, sys.stdout)
