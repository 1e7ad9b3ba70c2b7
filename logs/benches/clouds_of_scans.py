"""Makes a log with the point clouds of a 3D lidar of one with the scans of a 2D lidar:

    python logs/benches/clouds_of_scans.py IN.mcap OUT.mcap --rings 16 --tilt 0.7

The lidar is 0.5 m above the floor, in a building whose walls are upright and whose ceilings are 2.5 m high. Each beam of the scan becomes
one of each ring, with 1 cm of noise. The robot tilts by a random angle at each scan. Clouds are on `velodyne_points` beside the topic of
the scan, in the frame `velodyne`; what is no scan is copied. It needs numpy, mcap and mcap-ros2-support of PyPI.
"""

import argparse

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer
from robot_log import HEADER, SEPARATOR

LIDAR_HEIGHT = 0.5
CEILING_HEIGHT = 2.5
NOISE = 0.01
CLOUD = f"""std_msgs/Header header
uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
{HEADER}{SEPARATOR}
MSG: sensor_msgs/PointField
string name
uint32 offset
uint8 datatype
uint32 count
"""


def points(scan, elevations, tilt, random):
    """The points of all rings, in the frame of the tilted lidar."""
    azimuths = scan.angle_min + np.arange(len(scan.ranges)) * scan.angle_increment
    ranges = np.array(scan.ranges, dtype=float)
    valid = np.isfinite(ranges) & (ranges > scan.range_min) & (ranges < scan.range_max)
    elevation, azimuth = np.meshgrid(elevations, azimuths[valid], indexing="ij")
    beam = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    roll, pitch = random.normal(0, np.deg2rad(tilt), 2)
    about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
    about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
    level = np.einsum("ij,jkl->ikl", about_y @ about_x, beam)
    length = ranges[valid] / np.hypot(level[0], level[1])
    down, up = np.minimum(level[2], -1e-9), np.maximum(level[2], 1e-9)
    length = np.minimum(length, np.where(level[2] < 0, -LIDAR_HEIGHT / down, (CEILING_HEIGHT - LIDAR_HEIGHT) / up))
    length += random.normal(0, NOISE, length.shape)
    return np.moveaxis(beam * length, 0, -1).reshape(-1, 3).astype("<f4")


def cloud(scan, found):
    """The message of a cloud at the time of a scan."""
    fields = [{"name": name, "offset": 4 * place, "datatype": 7, "count": 1} for place, name in enumerate("xyz")]
    stamp = {"sec": scan.header.stamp.sec, "nanosec": scan.header.stamp.nanosec}
    return {
        "header": {"stamp": stamp, "frame_id": "velodyne"},
        "height": 1,
        "width": len(found),
        "fields": fields,
        "is_bigendian": False,
        "point_step": 12,
        "row_step": 12 * len(found),
        "data": found.tobytes(),
        "is_dense": True,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("input")
    parser.add_argument("output")
    parser.add_argument("--rings", type=int, default=16, help="rings, spread evenly over 30 degrees")
    parser.add_argument("--tilt", type=float, default=0.0, help="standard deviation of roll and pitch, degrees")
    arguments = parser.parse_args()
    elevations = np.deg2rad(np.linspace(-15, 15, arguments.rings))
    random = np.random.default_rng(1)
    with open(arguments.input, "rb") as source, open(arguments.output, "wb") as target:
        writer = Writer(target)
        clouds = writer.register_msgdef("sensor_msgs/msg/PointCloud2", CLOUD)
        copied = {}
        reader = make_reader(source, decoder_factories=[DecoderFactory()])
        for schema, channel, logged, message in reader.iter_decoded_messages():
            topic, kind = channel.topic, copied.get(schema.id)
            if schema.name == "sensor_msgs/msg/LaserScan":
                topic, kind = topic.rsplit("/", 1)[0] + "/velodyne_points", clouds
                message = cloud(message, points(message, elevations, arguments.tilt, random))
            elif kind is None:
                kind = copied[schema.id] = writer.register_msgdef(schema.name, schema.data.decode())
            writer.write_message(topic, kind, message, logged.log_time, logged.publish_time)
        writer.finish()


if __name__ == "__main__":
    main()
