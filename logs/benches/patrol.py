"""Measures how the time of SLAM grows for a robot that patrols one room: it drives around in it again and again.

    python logs/benches/patrol.py target/release/gridweave

The room is 10 by 8 m, a round 19 m, and scans of 180 beams come each 0.16 m (5 a second) with 1 cm of noise. Odometry is off by 5 % of
the way (standard deviation of each step) and 3 % of the turn. It needs numpy and mcap-ros2-support of PyPI.
"""

import argparse
import resource
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from corridor_scans import NOISE, cast
from robot_log import DriftingOdometry, RobotLog
from trajectory_error import distances, poses, rms

ROOM = [(0, 0, 10, 8), (4, 3, 5.5, 4), (8, 1, 9, 1.5)]
BEAMS, RANGE, RATE, STEP = 180, 12.0, 5.0, 0.05


def walls():
    """The walls of the room and of what stands in it, as segments: x and y of both ends."""
    sides = [[(a, b, c, b), (c, b, c, d), (c, d, a, d), (a, d, a, b)] for a, b, c, d in ROOM]
    return np.array([side for box in sides for side in box], float)


def write(path, scans):
    random = np.random.default_rng(1)
    segments, angles = walls(), -np.pi + 2 * np.pi / BEAMS * np.arange(BEAMS)
    odometry = DriftingOdometry(random)
    with open(path, "wb") as target:
        log = RobotLog(target, RATE, angles, RANGE)
        for number in range(scans):
            turn = STEP * number
            pose = np.array([5 + 3.2 * np.cos(turn), 4 + 2.8 * np.sin(turn), turn + np.pi / 2])
            by_odometry = odometry.follow(pose)
            log.write(pose, by_odometry, cast(segments, pose, angles + pose[2]) + NOISE * random.standard_normal(BEAMS))
        log.finish()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("gridweave")
    parser.add_argument("--scans", type=int, nargs="+", default=[1500, 3000, 6000])
    arguments = parser.parse_args()
    print("| scans | minutes | cpu, s | rms, m |\n| --- | --- | --- | --- |")
    for scans in arguments.scans:
        with tempfile.TemporaryDirectory() as folder:
            log, output = Path(folder) / "patrol.mcap", Path(folder) / "merged.mcap"
            write(log, scans)
            start = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
            command = [arguments.gridweave, "merge", log, "-o", output]
            subprocess.run(command, check=True, capture_output=True)
            spent = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - start
            error = rms(distances(poses(arguments.gridweave, output, "/robot1/matched_pose"), poses(arguments.gridweave, log, "/robot1/truth")))
            print(f"| {scans} | {scans / RATE / 60:.0f} | {spent:.1f} | {error:.3f} |", flush=True)


if __name__ == "__main__":
    main()
