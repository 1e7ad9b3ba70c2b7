"""Makes a log of MIT's Killian Court, 1.9 km of corridors: the published scans, odometry that errs, and the corrected poses:

    python logs/benches/killian_court.py killian.g2o OUT.mcap --seed 5

`killian.g2o` is in the package rtb-data of PyPI (`killian.g2o.zip`). It has the scans of 180 beams, and measurements between poses by scan
matching, of scans that follow each other and of places that were seen again. The truth, on `/robot1/truth`, is their least-squares solution, in
which measurements of places that contradict the rest count less. The raw odometry was not published: on `/robot1/odom` are the measured steps,
3 % too long, with a deviation of 5 % of the way and 4 % of the turn (standard deviations of each step), and a drift of 0.004 rad/m. Scans are a
second apart. It needs numpy, scipy and mcap-ros2-support of PyPI.
"""

import argparse

import numpy as np
from robot_log import RobotLog
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve

BEAMS = 180
SCALE, WAY_NOISE, TURN_NOISE, LEAST_TURN_NOISE, DRIFT = 1.03, 0.05, 0.04, 0.002, 0.004
# Squared residual from which a measurement between places counts less, in variances, and most steps of the solution.
ROBUST, STEPS = 45.0, 15


def wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def read(path):
    """Poses, measurements (from, to, x, y and yaw, information) and the ranges of the scans."""
    poses, measurements, ranges = [], [], []
    for line in open(path):
        kind, *fields = line.split() or [""]
        if kind == "VERTEX_SE2":
            poses.append([float(field) for field in fields[1:4]])
        elif kind == "EDGE_SE2":
            values = np.array([float(field) for field in fields[2:]])
            upper = np.zeros((3, 3))
            upper[np.triu_indices(3)] = values[3:]
            measurements.append((int(fields[0]), int(fields[1]), values[:3], upper + np.triu(upper, 1).T))
        elif kind == "ROBOTLASER1":
            ranges.append([float(field) for field in fields[8 : 8 + BEAMS]])
    return np.array(poses), measurements, np.array(ranges)


def solved(poses, measurements):
    """The poses that fit the measurements best, by Gauss-Newton."""
    poses = poses.copy()
    for _ in range(STEPS):
        rows, columns, values, right = [], [], [], np.zeros(poses.size)
        for a, b, measured, information in measurements:
            (x, y), (cos, sin) = poses[b, :2] - poses[a, :2], (np.cos(poses[a, 2]), np.sin(poses[a, 2]))
            seen = np.array([cos * x + sin * y, cos * y - sin * x, poses[b, 2] - poses[a, 2]])
            off = seen - measured
            off[2] = wrapped(off[2])
            squared = off @ information @ off
            weight = 1.0 if abs(a - b) == 1 else (ROBUST / (ROBUST + squared)) ** 2
            by_a = np.array([[-cos, -sin, seen[1]], [sin, -cos, -seen[0]], [0, 0, -1]])
            by_b = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
            for row, by_row in ((a, by_a), (b, by_b)):
                right[3 * row : 3 * row + 3] -= weight * by_row.T @ information @ off
                for column, by_column in ((a, by_a), (b, by_b)):
                    block = weight * by_row.T @ information @ by_column
                    rows.append(np.repeat(3 * row + np.arange(3), 3))
                    columns.append(np.tile(3 * column + np.arange(3), 3))
                    values.append(block.ravel())
        matrix = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))))
        held = np.full(poses.size, 1e-9)
        held[:3] = 1e6
        moves = spsolve(matrix.tocsc() + diags(held).tocsc(), right).reshape(poses.shape)
        poses += moves
        if abs(moves).max() < 1e-4:
            break
    poses[:, 2] = wrapped(poses[:, 2])
    return poses


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("graph")
    parser.add_argument("log")
    parser.add_argument("--seed", type=int, default=5)
    arguments = parser.parse_args()
    start, measurements, ranges = read(arguments.graph)
    if not 0 < len(start) == len(ranges):
        parser.error(f"{arguments.graph} has {len(start)} poses and {len(ranges)} scans: each pose of killian.g2o has a scan")
    truth = solved(start, measurements)
    steps = {}
    for a, b, (x, y, yaw), _ in measurements:
        if b == a + 1:
            steps[a] = (x, y, yaw)
        elif b == a - 1:
            cos, sin = np.cos(yaw), np.sin(yaw)
            steps[b] = (-cos * x - sin * y, sin * x - cos * y, -yaw)
    random = np.random.default_rng(arguments.seed)
    log = RobotLog(arguments.log, 1.0, np.radians(np.arange(BEAMS) - 90.0), 49.0)
    odometry = np.zeros(3)
    for scan in range(len(truth)):
        if scan > 0:
            x, y, yaw = steps[scan - 1]
            way = np.hypot(x, y)
            x, y = (SCALE * along + random.normal(0, WAY_NOISE * way) for along in (x, y))
            yaw += DRIFT * way + random.normal(0, TURN_NOISE * abs(yaw) + LEAST_TURN_NOISE)
            cos, sin = np.cos(odometry[2]), np.sin(odometry[2])
            odometry += (cos * x - sin * y, sin * x + cos * y, yaw)
        log.write(truth[scan], odometry, ranges[scan])
    log.finish()


if __name__ == "__main__":
    main()
