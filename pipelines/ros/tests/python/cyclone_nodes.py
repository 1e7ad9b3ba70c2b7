"""Programs on the real Cyclone DDS, on this machine alone. What they do is the first argument; those after it are its own."""

import json
import math
import os
import sys
import threading
import time
from dataclasses import dataclass, field

os.environ["CYCLONEDDS_URI"] = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces><AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float32, float64, int8, int32, sequence, uint8, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    translation: Vector3 = field(default_factory=Vector3)
    rotation: Quaternion = field(default_factory=Quaternion)


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    transform: Transform = field(default_factory=Transform)


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped] = field(default_factory=list)


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class MapMetaData(IdlStruct, typename="nav_msgs::msg::dds_::MapMetaData_"):
    map_load_time: Time = field(default_factory=Time)
    resolution: float32 = 0.0
    width: uint32 = 0
    height: uint32 = 0
    origin: Pose = field(default_factory=Pose)


@dataclass
class OccupancyGrid(IdlStruct, typename="nav_msgs::msg::dds_::OccupancyGrid_"):
    header: Header = field(default_factory=Header)
    info: MapMetaData = field(default_factory=MapMetaData)
    data: sequence[int8] = field(default_factory=list)


@dataclass
class OccupancyGridUpdate(IdlStruct, typename="map_msgs::msg::dds_::OccupancyGridUpdate_"):
    header: Header = field(default_factory=Header)
    x: int32 = 0
    y: int32 = 0
    width: uint32 = 0
    height: uint32 = 0
    data: sequence[int8] = field(default_factory=list)


def names_of_nodes(size):
    """The types of the names of nodes, whose identifiers have so many bytes."""

    @dataclass
    class Gid(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
        data: array[uint8, size] = field(default_factory=lambda: [0] * size)

    @dataclass
    class NodeEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
        node_namespace: str = "/"
        node_name: str = ""
        reader_gid_seq: sequence[Gid] = field(default_factory=list)
        writer_gid_seq: sequence[Gid] = field(default_factory=list)

    @dataclass
    class ParticipantEntitiesInfo(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
        gid: Gid = field(default_factory=Gid)
        node_entities_info_seq: sequence[NodeEntitiesInfo] = field(default_factory=list)

    # Zeros follow an identifier.
    gid = lambda entity: Gid([*entity.guid.bytes, *[0] * (size - 16)])
    return gid, NodeEntitiesInfo, ParticipantEntitiesInfo


# With the encoding of ROS.
RELIABLE = [Policy.Reliability.Reliable(duration(seconds=1)), Policy.DataRepresentation(use_cdrv0_representation=True)]
LATCHED = Qos(*RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepLast(1))
ALL_LATCHED = Qos(*RELIABLE, Policy.Durability.TransientLocal, Policy.History.KeepAll)
VOLATILE = Qos(*RELIABLE, Policy.Durability.Volatile, Policy.History.KeepLast(100))


def transform(parent, child, x):
    return TransformStamped(Header(Time(1, 0), parent), child, Transform(Vector3(x, 0.0, 0.0)))


def tf(robot):
    """Publishes where a robot is, on /tf and /tf_static, until standard input ends."""
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    static, moving = [
        DataWriter(participant, Topic(participant, name, TFMessage), qos=qos)
        for name, qos in (("rt/tf_static", LATCHED), ("rt/tf", VOLATILE))
    ]
    static.write(TFMessage([transform(f"{robot}/odom", f"{robot}/base_link", 2.0)]))
    over = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
    while not over.wait(0.05):
        moving.write(TFMessage([transform(f"{robot}/map", f"{robot}/odom", 1.0)]))


def frames(count, longest):
    """Looks at /tf_static until the frames of so many robots are there, and prints them as JSON."""
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    reader = DataReader(participant, Topic(participant, "rt/tf_static", TFMessage), qos=LATCHED)
    seen, end = {}, time.monotonic() + float(longest)
    while len(seen) < int(count):
        if time.monotonic() > end:
            sys.exit(f"there is only {seen}")
        for message in reader.take(10):
            for one in message.transforms:
                at, turn = one.transform.translation, one.transform.rotation
                yaw = math.atan2(2 * turn.w * turn.z, 1 - 2 * turn.z * turn.z)
                seen[one.child_frame_id] = {"parent": one.header.frame_id, "x": at.x, "y": at.y, "yaw": yaw}
        time.sleep(0.02)
    json.dump(seen, sys.stdout)


def updates(count, walls, longest):
    """Keeps a map by its updates, as RViz does: says when so many have come, and ends when so many cells are walls."""
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
    whole = DataReader(participant, Topic(participant, "rt/map", OccupancyGrid), qos=LATCHED)
    parts = DataReader(participant, Topic(participant, "rt/map_updates", OccupancyGridUpdate), qos=VOLATILE)
    cells, width, heard, end = [], 0, 0, time.monotonic() + float(longest)
    while cells.count(100) != int(walls):
        if time.monotonic() > end:
            sys.exit(f"{heard} updates have come, and {cells.count(100)} cells are walls")
        for grid in whole.take(10):
            cells, width = list(grid.data), grid.info.width
        for part in parts.take(100) if cells else []:
            heard += 1
            if heard == int(count):
                print("hears updates", flush=True)
            for row in range(part.height):
                start = (part.y + row) * width + part.x
                cells[start : start + part.width] = part.data[row * part.width : (row + 1) * part.width]
        time.sleep(0.01)
    json.dump(cells, sys.stdout)


def without_hashes(size, robot, longest):
    """Plays a robot whose endpoints state no hash of their types: one of Humble, where the identifiers in the names of nodes have 24
    bytes, or a bridge of a later release, where they have 16. Prints as JSON the names of the nodes that hear its map and that
    publish the merged one, once it has both."""
    gid, NodeEntitiesInfo, ParticipantEntitiesInfo = names_of_nodes(int(size))
    participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]), qos=Qos(Policy.Userdata(b"enclave=/;\0")))
    topic = Topic(participant, "ros_discovery_info", ParticipantEntitiesInfo)
    own, others = DataWriter(participant, topic, qos=LATCHED), DataReader(participant, topic, qos=ALL_LATCHED)
    maps = DataWriter(participant, Topic(participant, f"rt/{robot}/map", OccupancyGrid), qos=LATCHED)
    merged = DataReader(participant, Topic(participant, "rt/map", OccupancyGrid), qos=LATCHED)
    node = NodeEntitiesInfo(f"/{robot}", "slam_toolbox", [gid(merged)], [gid(maps)])
    own.write(ParticipantEntitiesInfo(gid(participant), [node]))
    maps.write(OccupancyGrid(Header(Time(1, 0), "map"), MapMetaData(width=2, height=2), [0, 100, 0, -1]))
    names, end = {}, time.monotonic() + float(longest)
    while True:
        for message in others.take(10):
            for node in message.node_entities_info_seq:
                for one in [*node.reader_gid_seq, *node.writer_gid_seq]:
                    names[bytes(one.data[:16])] = node.node_name
        hearing = [maps.get_matched_subscription_data(one).key for one in maps.get_matched_subscriptions()]
        publishing = [merged.get_matched_publication_data(one).key for one in merged.get_matched_publications()]
        found = [names.get(one.bytes) for one in [*hearing, *publishing]]
        if len(found) == 2 and all(found) and merged.read():
            return json.dump(found, sys.stdout)
        if time.monotonic() > end:
            sys.exit(f"{found} are named, and {len(merged.read())} merged maps are there")
        time.sleep(0.02)


{f.__name__: f for f in (tf, frames, updates, without_hashes)}[sys.argv[1]](*sys.argv[2:])
