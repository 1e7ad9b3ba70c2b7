"""Makes a log with the scans of a robot that drives 75 m along a closed corridor of 90 by 2.2 m, and its true poses:

    python logs/benches/corridor_scans.py OUT.mcap --range 8 --doors --odometry

Scans come 10 times a second at 0.6 m/s, with 1 cm of noise, on `/robot1/scan`, and the truth on `/robot1/truth`. Odometry, on `/robot1/odom`,
is off by 5 % of the way (standard deviation of each step) and 3 % of the turn. It needs numpy and mcap-ros2-support of PyPI.
"""

import argparse

import numpy as np
from robot_log import DriftingOdometry, RobotLog

HALF_WIDTH, START, END = 1.1, -5.0, 85.0
DOOR_DEPTH, DOOR_WIDTH = 0.12, 0.9
WAY, SPEED, RATE = 75.0, 0.6, 10.0
NOISE = 0.01


def walls(has_doors, random):
    """The walls as segments: x and y of both ends."""
    lines = [[(x, -HALF_WIDTH), (x, HALF_WIDTH)] for x in (START, END)]
    for side in (-1, 1):
        wall = side * HALF_WIDTH
        line, x = [(START, wall)], START
        while has_doors and (x := x + random.uniform(2.5, 8)) + 1 < END:
            back = wall + side * DOOR_DEPTH
            line += [(x, wall), (x, back), (x + DOOR_WIDTH, back), (x + DOOR_WIDTH, wall)]
            x += DOOR_WIDTH
        lines.append(line + [(END, wall)])
    return np.array([(*a, *b) for line in lines for a, b in zip(line, line[1:])])


def cast(segments, place, angles):
    """The distance to the nearest wall in each direction."""
    x, y = np.cos(angles)[:, None], np.sin(angles)[:, None]
    from_x, from_y, to_x, to_y = segments.T
    along_x, along_y, off_x, off_y = to_x - from_x, to_y - from_y, from_x - place[0], from_y - place[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = x * along_y - y * along_x
        distance, share = (off_x * along_y - off_y * along_x) / scale, (off_x * y - off_y * x) / scale
    return np.where((distance > 0) & (share >= 0) & (share <= 1), distance, np.inf).min(1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output")
    parser.add_argument("--beams", type=int, default=360)
    parser.add_argument("--range", type=float, default=30.0, help="longest range of the lidar, metres")
    parser.add_argument("--doors", action="store_true", help="door frames every few metres on both sides")
    parser.add_argument("--odometry", action="store_true")
    arguments = parser.parse_args()
    random = np.random.default_rng(1)
    segments = walls(arguments.doors, random)
    step = 2 * np.pi / arguments.beams
    angles = -np.pi + step * np.arange(arguments.beams)
    odometry = DriftingOdometry(random)
    with open(arguments.output, "wb") as target:
        log = RobotLog(target, RATE, angles, arguments.range)
        for number in range(int(WAY / SPEED * RATE)):
            pose = np.array([number / RATE * SPEED, 0.15 * np.sin(0.05 * number), 0.08 * np.sin(0.05 * number + 1)])
            by_odometry = odometry.follow(pose)
            ranges = cast(segments, pose, angles + pose[2]) + NOISE * random.standard_normal(arguments.beams)
            log.write(pose, by_odometry if arguments.odometry else None, ranges)
        log.finish()


if __name__ == "__main__":
    main()
