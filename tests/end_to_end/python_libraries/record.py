"""Makes of a simulated log what `ros2 bag record /map /tf /tf_static /amcl_pose` leaves on each robot: a rosbag2 folder for each, in which
neither topics nor frames bear the robot's name.

Arguments: the log of `gridweave simulate`, the folder to put the bags into, and robots. Written with the library `rosbags`.
"""

import sys
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
TYPES = STORE.types
TYPE_OF = {
    "/map": "nav_msgs/msg/OccupancyGrid",
    "/tf": "tf2_msgs/msg/TFMessage",
    "/tf_static": "tf2_msgs/msg/TFMessage",
    "/amcl_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
}


def make(name, **fields):
    return TYPES[name](**fields)


def header(stamp, frame):
    time = make("builtin_interfaces/msg/Time", sec=stamp.sec, nanosec=stamp.nanosec)
    return make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def vector(kind, one):
    return make(f"geometry_msgs/msg/{kind}", **{axis: getattr(one, axis) for axis in ("xyzw" if kind == "Quaternion" else "xyz")})


def pose(one):
    return make("geometry_msgs/msg/Pose", position=vector("Point", one.position), orientation=vector("Quaternion", one.orientation))


def tie(stamp, parent, child, translation, rotation):
    transform = make("geometry_msgs/msg/Transform", translation=translation, rotation=rotation)
    return make("geometry_msgs/msg/TransformStamped", header=header(stamp, parent), child_frame_id=child, transform=transform)


def standing():
    origin = make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    return origin, make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)


def grid(message):
    import numpy

    info = message.info
    load = make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
    meta = make("nav_msgs/msg/MapMetaData", map_load_time=load, resolution=info.resolution, width=info.width, height=info.height, origin=pose(info.origin))
    return make(TYPE_OF["/map"], header=header(message.header.stamp, "map"), info=meta, data=numpy.array(message.data, dtype=numpy.int8))


def record(log, robot, folder):
    import numpy

    with Writer(folder, version=8) as bag, open(log, "rb") as stream:
        connections = {topic: bag.add_connection(topic, name, typestore=STORE) for topic, name in TYPE_OF.items()}

        def write(topic, time, message):
            bag.write(connections[topic], time, STORE.serialize_cdr(message, TYPE_OF[topic]))

        reader, is_first = make_reader(stream, decoder_factories=[DecoderFactory()]), True
        for _, channel, record, message in reader.iter_decoded_messages(topics=[f"/{robot}/map", f"/{robot}/pose"]):
            stamp, time = message.header.stamp, record.log_time
            if channel.topic.endswith("/map"):
                write("/map", time, grid(message))
                continue
            if is_first:
                laser = tie(stamp, "base_link", "laser", *standing())
                write("/tf_static", time, make(TYPE_OF["/tf_static"], transforms=[laser]))
                is_first = False
            # As SLAM and odometry say it together.
            place = pose(message.pose)
            odometry = tie(stamp, "odom", "base_link", vector("Vector3", place.position), place.orientation)
            write("/tf", time, make(TYPE_OF["/tf"], transforms=[tie(stamp, "map", "odom", *standing()), odometry]))
            with_covariance = make("geometry_msgs/msg/PoseWithCovariance", pose=place, covariance=numpy.diag([0.01, 0.01, 0, 0, 0, 0.001]).ravel())
            write("/amcl_pose", time, make(TYPE_OF["/amcl_pose"], header=header(stamp, "map"), pose=with_covariance))


if __name__ == "__main__":
    for name in sys.argv[3:]:
        record(sys.argv[1], name, Path(sys.argv[2]) / f"{name}_bag")
