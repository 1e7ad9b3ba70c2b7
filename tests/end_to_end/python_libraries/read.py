"""Reads every message of bags with the Python libraries that people use, and prints how many there are of each topic.

Argument: the folder of a bag (rosbag2, MCAP). Transforms are put into a tree as they come: a frame that changes its parent is an
error.
"""

import json
import sys
from collections import Counter
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader


def take_up(parents, transforms):
    for one in transforms:
        child, parent = one.child_frame_id, one.header.frame_id
        before = parents.setdefault(child, parent)
        assert before == parent, f"{child} has the parent {before}, and then {parent}"


def by_mcap(file):
    counts, parents = Counter(), {}
    with open(file, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, _, message in reader.iter_decoded_messages():
            counts[channel.topic] += 1
            if channel.topic in ("/tf", "/tf_static"):
                take_up(parents, message.transforms)
        records = {record.name for record in reader.iter_metadata()}
    assert "gridweave_run" in records, records
    return counts


def by_rosbags(folder):
    counts, parents = Counter(), {}
    with AnyReader([folder]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            counts[connection.topic] += 1
            if connection.topic in ("/tf", "/tf_static"):
                take_up(parents, message.transforms)
        assert reader.message_count == counts.total(), "metadata.yaml counts others"
        for topic, told in reader.topics.items():
            assert told.msgcount == counts[topic], topic
    return counts


folder = Path(sys.argv[1])
[file] = folder.glob("*.mcap")
read = by_mcap(file)
again = by_rosbags(folder)
assert read == again, f"{read} by mcap and mcap-ros2-support, {again} by rosbags"
json.dump(read, sys.stdout)
