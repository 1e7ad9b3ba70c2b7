"""Public drives as whole logs and as logs of any number of robots, from the halves that `slam_errors.py` describes.

Where the halves overlap, they have every second scan of the drive each. It needs numpy and mcap-ros2-support of PyPI.
"""

from itertools import chain

import numpy as np
from mcap_ros2.reader import read_ros2_messages
from robot_log import RobotLog

# Share of a robot's part that the next one sees, too: scans that two have in common would make their maps agree too well, so those
# of an overlap are dealt out in turn.
OVERLAP = 0.5
# Hits that are farther away, metres, are spread by the least error of the yaw.
LONGEST_HIT = 20.0
CELL = 0.05


class Drive:
    """The scans of a drive in their order, each with its true pose and its pose by odometry (x, y, yaw)."""

    def __init__(self, public, name):
        one, other = (half(public / f"{name}-robot{n}") for n in (1, 2))
        orders = ((*one[:start], *chain.from_iterable(zip(one[start:], other)), *other[len(one) - start :]) for start in range(len(one)))
        self.steps = min(orders, key=way)

    def part(self, number, of):
        """The steps of one of some robots that drive one after the other, and what of the others' they see as well, by their numbers."""
        overlap = OVERLAP * len(self.steps) / of / 2
        start, end = (len(self.steps) * share / of for share in (number, number + 1))
        first, last = (start - overlap if number > 0 else 0), (end + overlap if number + 1 < of else len(self.steps))
        for at, step in enumerate(self.steps):
            in_first, in_last = number > 0 and at < start + overlap, number + 1 < of and at >= end - overlap
            if first <= at < last and not (in_first and at % 2 == 0) and not (in_last and at % 2 == 1):
                yield at, step

    def write(self, path, number=0, of=1, gap=range(0)):
        """Writes the log of one of some robots, a scan a second, without those of a gap. Returns the angles of its beams, and its true poses
        and ranges by time in milliseconds."""
        scan = self.steps[0][1]
        angles = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
        found = {}
        with open(path, "wb") as target:
            log = RobotLog(target, 1.0, angles, scan.range_max)
            for log.number, (row, scan) in self.part(number, of):
                if log.number in gap:
                    continue
                found[round(log.time() / 1e6)] = tuple(row[1:4]), np.array(scan.ranges)
                log.write(row[1:4], row[4:7], np.array(scan.ranges))
            log.finish()
        return angles, found


def half(path):
    """The rows of a half and its scans."""
    messages = read_ros2_messages(f"{path}.mcap", topics=["/scan", "/robot1/scan", "/robot2/scan"])
    scans = {message.ros_msg.header.stamp.sec: message.ros_msg for message in messages}
    rows = (tuple(map(float, line.split())) for line in open(f"{path}.csv"))
    return [(row, scans[int(row[0])]) for row in rows]


def way(steps):
    """The way by odometry, metres."""
    places = np.array([row[4:6] for row, _ in steps])
    return np.hypot(*np.diff(places, axis=0).T).sum()


def spread(angles, scans, poses):
    """The number of cells over which the hits of scans are spread, as the exponential of their entropy: doubled walls increase it."""
    hits = []
    for time, (_, ranges) in scans.items():
        if time in poses:
            x, y, yaw = poses[time]
            near = np.isfinite(ranges) & (ranges < LONGEST_HIT)
            hits.append(np.c_[x + ranges[near] * np.cos(angles[near] + yaw), y + ranges[near] * np.sin(angles[near] + yaw)])
    _, counts = np.unique(np.floor(np.concatenate(hits) / CELL), axis=0, return_counts=True)
    shares = counts / counts.sum()
    return float(np.exp(-(shares * np.log(shares)).sum()))
