"""Writes the log of a simulated robot: its scans, its odometry, and its true poses. It needs numpy and mcap-ros2-support of PyPI."""

import numpy as np
from mcap_ros2.writer import Writer

START = 1_700_000_000 * 10**9
SEPARATOR = "=" * 80
HEADER = f"""{SEPARATOR}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{SEPARATOR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
SCAN = f"""std_msgs/Header header
float32 angle_min
float32 angle_max
float32 angle_increment
float32 time_increment
float32 scan_time
float32 range_min
float32 range_max
float32[] ranges
float32[] intensities
{HEADER}"""
POSE = f"""{SEPARATOR}
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
{SEPARATOR}
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
{SEPARATOR}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""
POSE_STAMPED = f"""std_msgs/Header header
geometry_msgs/Pose pose
{HEADER}{POSE}"""
ODOMETRY = f"""std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
{HEADER}{POSE}{SEPARATOR}
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
{SEPARATOR}
MSG: geometry_msgs/TwistWithCovariance
geometry_msgs/Twist twist
float64[36] covariance
{SEPARATOR}
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular
{SEPARATOR}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""


def pose_message(x, y, yaw):
    """The message of a pose in the plane."""
    orientation = {"x": 0.0, "y": 0.0, "z": np.sin(yaw / 2), "w": np.cos(yaw / 2)}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": orientation}


WAY_NOISE, TURN_NOISE = 0.05, 0.03


class DriftingOdometry:
    """Odometry that is off by 5 % of the way (standard deviation of each step) and 3 % of the turn."""

    def __init__(self, random):
        self.random, self.pose, self.before = random, np.zeros(3), None

    def follow(self, pose):
        """The pose by odometry of a robot that has moved on to `pose`, both as x, y and yaw."""
        if self.before is not None:
            moved = pose - self.before
            way = np.hypot(*moved[:2]) * (1 + WAY_NOISE * self.random.standard_normal())
            heading = np.arctan2(moved[1], moved[0]) - self.before[2] + self.pose[2]
            turn = moved[2] * (1 + TURN_NOISE * self.random.standard_normal())
            self.pose += [way * np.cos(heading), way * np.sin(heading), turn]
        self.before = pose
        return self.pose


class RobotLog:
    """A log of `robot1` in which scans come at regular times, with beams at these angles up to a range in metres."""

    def __init__(self, target, rate, angles, longest):
        self.writer, self.rate, self.angles, self.longest, self.number = Writer(target), rate, angles, longest, 0
        self.scans = self.writer.register_msgdef("sensor_msgs/msg/LaserScan", SCAN)
        self.truths = self.writer.register_msgdef("geometry_msgs/msg/PoseStamped", POSE_STAMPED)
        self.odometries = self.writer.register_msgdef("nav_msgs/msg/Odometry", ODOMETRY)

    def time(self):
        """The time of the next scan, nanoseconds."""
        return START + int(self.number / self.rate * 1e9)

    def write(self, pose, odometry, ranges):
        """Writes a scan, the true pose at it (x, y, yaw), and that by odometry, if there is one. What is beyond the range is no hit."""
        time = self.time()
        self.number += 1
        stamp = {"sec": time // 10**9, "nanosec": time % 10**9}
        truth = {"header": {"stamp": stamp, "frame_id": "building"}, "pose": pose_message(*pose)}
        self.writer.write_message("/robot1/truth", self.truths, truth, time, time)
        if odometry is not None:
            still = {"linear": {"x": 0.0, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
            message = {
                "header": {"stamp": stamp, "frame_id": "robot1/odom"},
                "child_frame_id": "robot1/base_link",
                "pose": {"pose": pose_message(*odometry), "covariance": [0.0] * 36},
                "twist": {"twist": still, "covariance": [0.0] * 36},
            }
            self.writer.write_message("/robot1/odom", self.odometries, message, time, time)
        message = {
            "header": {"stamp": stamp, "frame_id": "robot1/base_link"},
            "angle_min": self.angles[0],
            "angle_max": self.angles[-1],
            "angle_increment": self.angles[1] - self.angles[0],
            "time_increment": 0.0,
            "scan_time": 1 / self.rate,
            "range_min": 0.05,
            "range_max": self.longest,
            "ranges": np.where(ranges > self.longest, np.inf, ranges).tolist(),
            "intensities": [],
        }
        self.writer.write_message("/robot1/scan", self.scans, message, time, time)

    def finish(self):
        self.writer.finish()
