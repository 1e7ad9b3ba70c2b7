"""What nodes of ROS 2 do over Zenoh, written by the documents of rmw_zenoh and with libraries that know nothing of Gridweave."""

import struct
import time

import zenoh
import zenoh.ext
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

STORE = get_typestore(Stores.ROS2_JAZZY)
LATCHED = ":1:,1:,:,:,,"
RELIABLE = "::,10:,:,:,,"


def session(router):
    config = zenoh.Config()
    for key, value in {
        "mode": '"peer"',
        "connect/endpoints": f'["{router}"]',
        "listen/endpoints": '["tcp/127.0.0.1:0"]',
        "scouting/multicast/enabled": "false",
        "timestamping/enabled": "true",
        # What is killed would leave its memory behind.
        "transport/shared_memory/enabled": "false",
    }.items():
        config.insert_json5(key, value)
    return zenoh.open(config)


def learn(name, text):
    """Takes up the definition of a type that ROS does not ship, with those that it uses."""
    new = {key: value for key, value in get_types_from_msg(text, name).items() if key not in STORE.fielddefs}
    STORE.register(new)


def key(topic, name):
    package, _, short = name.split("/")
    return f"0/{topic.strip('/')}/{package}::msg::dds_::{short}_/{STORE.hash_rihs01(name)}"


class Node:
    def __init__(self, router, name):
        self.session, self.name, self.number, self.kept = session(router), name, 0, []
        self.declare("NN", "")

    def declare(self, kind, of_topic):
        token = f"@ros2_lv/0/{self.session.zid()}/0/{self.number}/{kind}/%/%/{self.name}{of_topic}"
        self.number += 1
        self.kept.append(self.session.liveliness().declare_token(token))

    def declare_topic(self, kind, topic, name, qos):
        of, type_hash = key(topic, name).split("/")[-2:]
        self.declare(kind, f"/{topic.replace('/', '%')}/{of}/{type_hash}/{qos}")

    def publish(self, topic, name, is_latched):
        options = {}
        if is_latched:
            options = {
                "cache": zenoh.ext.CacheConfig(1),
                "sample_miss_detection": zenoh.ext.MissDetectionConfig(sporadic_heartbeat=0.5),
                "publisher_detection": True,
            }
        publisher = zenoh.ext.declare_advanced_publisher(self.session, key(topic, name), **options)
        self.declare_topic("MP", topic, name, LATCHED if is_latched else RELIABLE)
        self.kept.append(publisher)
        sequence = 0

        def send(message):
            nonlocal sequence
            sequence += 1
            attachment = struct.pack("<qqB16s", sequence, time.time_ns(), 16, bytes(range(16)))
            publisher.put(bytes(message), attachment=attachment)

        return send

    def subscribe(self, topic, name, call):
        def take(sample):
            sequence, sent, length, gid = struct.unpack("<qqB16s", sample.attachment.to_bytes())
            assert sequence > 0 and length == 16 and abs(sent - time.time_ns()) < 600e9
            call(STORE.deserialize_cdr(sample.payload.to_bytes(), name))

        subscriber = zenoh.ext.declare_advanced_subscriber(
            self.session,
            key(topic, name),
            take,
            history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
            recovery=zenoh.ext.RecoveryConfig(heartbeat=True),
            subscriber_detection=True,
        )
        self.declare_topic("MS", topic, name, LATCHED)
        self.kept.append(subscriber)

    def watch_publishers(self, call):
        """Calls with the topic and the type of each publisher that is there or comes, by its token."""

        def take(sample):
            parts = str(sample.key_expr).split("/")
            if sample.kind == zenoh.SampleKind.PUT and parts[5] == "MP":
                call(parts[9].replace("%", "/"), parts[10])

        tokens = self.session.liveliness()
        self.kept.append(tokens.declare_subscriber("@ros2_lv/0/**", take, history=True))
