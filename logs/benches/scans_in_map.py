"""Makes a log with the scans of a robot that drives through a map file, and its true poses:

    python logs/benches/scans_in_map.py MAP.yaml OUT.mcap --beams 360 --range 12 --metres 200 --seed 1

The occupied cells of the map are its walls. The robot goes from place to place, each time to one of which it has seen least, at 0.5 m/s, and half
of the robots come back to where they started. Scans come 5 times a second on `/robot1/scan`, and the truth on `/robot1/truth`. Odometry, on
`/robot1/odom` unless `--alone` is given, has a scale and a drift in yaw of its own beside the noise of its steps. It needs numpy, scipy, pillow,
pyyaml and mcap-ros2-support of PyPI.
"""

import argparse
import heapq
import math
from pathlib import Path

import numpy as np
import yaml
from PIL import Image
from robot_log import RobotLog
from scipy import ndimage

# Side of the cells in which ways are planned, and the distance that a robot keeps from what is not free, metres.
CELL, MARGIN = 0.1, 0.3
SPEED, RATE, STEP = 0.5, 5.0, 0.05
LOOK_AHEAD, LARGEST_TURN = 0.35, 1.0
# Standard deviations of the ranges, of the scales of way and turn, of the drift (radians per metre), and of a metre and a radian.
RANGE_NOISE, SCALES, DRIFT, WAY_NOISE, TURN_NOISE = 0.015, (0.02, 0.03), 0.008, 0.03, 0.015
MISSING = 0.01


def load(path):
    """Which cells are occupied and which are free, the lowest row first, and their side in metres."""
    meta = yaml.safe_load(path.read_text())
    shade = np.array(Image.open(path.parent / meta["image"]).convert("L")) / 255
    occupancy = (shade if meta.get("negate") else 1 - shade)[::-1]
    return occupancy > meta["occupied_thresh"], occupancy < meta["free_thresh"], float(meta["resolution"])


def route(cost, start, goal):
    """The cheapest way from one cell to another (A*)."""
    costs, before, todo, done = {start: 0.0}, {}, [(0.0, start)], set()
    while todo:
        _, cell = heapq.heappop(todo)
        if cell == goal:
            way = [goal]
            while way[-1] != start:
                way.append(before[way[-1]])
            return way[::-1]
        if cell in done:
            continue
        done.add(cell)
        for row, column in ((r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if r or c):
            to = (cell[0] + row, cell[1] + column)
            if not all(0 <= at < size for at, size in zip(to, cost.shape)) or np.isinf(cost[to]):
                continue
            spent = costs[cell] + math.hypot(row, column) * cost[to]
            if spent < costs.get(to, math.inf):
                costs[to], before[to] = spent, cell
                heapq.heappush(todo, (spent + math.hypot(to[0] - goal[0], to[1] - goal[1]), to))
    return [start]


def plan(free, resolution, metres, random):
    """Points of a way through the largest free space, metres."""
    share = max(1, round(CELL / resolution))
    rows, columns = (size // share for size in free.shape)
    cells = free[: rows * share, : columns * share].reshape(rows, share, columns, share).all((1, 3))
    side = resolution * share
    distance = ndimage.distance_transform_edt(np.pad(cells, 1))[1:-1, 1:-1] * side
    spaces, count = ndimage.label(distance > MARGIN)
    if count == 0:
        raise SystemExit("there is no free space in the map in which a robot could move")
    space = spaces == 1 + np.bincount(spaces.ravel())[1:].argmax()
    cost = np.where(space, 1 + np.maximum(0, 2 * MARGIN - distance) / (2 * MARGIN), np.inf)
    places = np.argwhere(space)
    at = start = tuple(places[random.integers(len(places))])
    way = [start]
    while side * len(way) < metres:
        goals = places[random.integers(len(places), size=30)]
        seen = np.array(way[::10])
        distances = [np.abs(seen - goal).max(1).min() for goal in goals] + 3 * random.random(len(goals))
        at = tuple(goals[int(np.argmax(distances))])
        way += route(cost, way[-1], at)[1:]
    if random.random() < 0.5:
        way += route(cost, at, start)[1:]
    points = (np.array(way, dtype=float)[:, ::-1] + 0.5) * side
    return ndimage.gaussian_filter1d(points, 2.5, axis=0, mode="nearest")


def follow(path):
    """The poses at the scans of a robot with two wheels that follows a path (pure pursuit)."""
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    (x, y), yaw = path[0], math.atan2(*(path[min(8, len(path) - 1)] - path[0])[::-1])
    target, poses, step = 0.0, [np.array([x, y, yaw])], 0
    ahead = lambda: [np.interp(target + LOOK_AHEAD, along, path[:, axis]) for axis in (0, 1)]
    while target < along[-1] - 0.1 and step < 100 * len(path):
        step += 1
        to_x, to_y = ahead()
        if math.hypot(to_x - x, to_y - y) < 0.4:
            target += 2 * SPEED * STEP
            to_x, to_y = ahead()
        off = (math.atan2(to_y - y, to_x - x) - yaw + math.pi) % (2 * math.pi) - math.pi
        speed = SPEED * max(0.0, 1 - abs(off) / 0.8)
        x, y = x + speed * STEP * math.cos(yaw), y + speed * STEP * math.sin(yaw)
        yaw += np.clip(2.5 * off, -LARGEST_TURN, LARGEST_TURN) * STEP
        if step % round(1 / RATE / STEP) == 0:
            poses.append(np.array([x, y, yaw]))
    return poses


def odometry(poses, random):
    """The poses as the wheels show them."""
    scale, turn_scale = 1 + np.array(SCALES) * random.standard_normal(2)
    drift = DRIFT * random.standard_normal()
    found = [np.zeros(3)]
    for before, after in zip(poses, poses[1:]):
        cosine, sine = math.cos(before[2]), math.sin(before[2])
        ahead, left = np.array([[cosine, sine], [-sine, cosine]]) @ (after - before)[:2]
        way, turn = math.hypot(ahead, left), after[2] - before[2]
        noise = random.standard_normal(4)
        ahead = ahead * scale + WAY_NOISE * math.sqrt(way) * noise[0]
        left += 0.3 * WAY_NOISE * math.sqrt(way) * noise[1]
        turn = turn * turn_scale + drift * way + TURN_NOISE * math.sqrt(abs(turn)) * noise[2] + 0.005 * math.sqrt(way) * noise[3]
        x, y, yaw = found[-1]
        cosine, sine = math.cos(yaw), math.sin(yaw)
        found.append(np.array([x + cosine * ahead - sine * left, y + sine * ahead + cosine * left, yaw + turn]))
    return found


def cast(distances, resolution, pose, angles, farthest):
    """The ranges to occupied cells, by steps as long as the distance to the nearest of them, in cells, allows."""
    cosine, sine = np.cos(pose[2] + angles), np.sin(pose[2] + angles)
    ranges, at, beams = np.full(len(angles), 2 * farthest), np.full(len(angles), 0.05), np.arange(len(angles))
    while len(beams):
        column = ((pose[0] + cosine[beams] * at[beams]) / resolution).astype(int)
        row = ((pose[1] + sine[beams] * at[beams]) / resolution).astype(int)
        inside = (column >= 0) & (row >= 0) & (column < distances.shape[1]) & (row < distances.shape[0]) & (at[beams] < farthest)
        distance = distances[np.where(inside, row, 0), np.where(inside, column, 0)]
        hit = inside & (distance == 0)
        ranges[beams[hit]] = at[beams[hit]]
        going = inside & ~hit
        at[beams[going]] += np.maximum(0.45, distance[going] - 1.5) * resolution
        beams = beams[going]
    return ranges


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("map", type=Path)
    parser.add_argument("output")
    parser.add_argument("--beams", type=int, default=360)
    parser.add_argument("--field-of-view", type=float, default=360.0, help="degrees")
    parser.add_argument("--range", type=float, default=12.0, help="longest range of the lidar, metres")
    parser.add_argument("--metres", type=float, default=150.0, help="about how far the robot goes")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--alone", action="store_true", help="scans alone, without odometry")
    arguments = parser.parse_args()
    random = np.random.default_rng(arguments.seed)
    occupied, free, resolution = load(arguments.map)
    poses = follow(plan(free, resolution, arguments.metres, random))
    distances = ndimage.distance_transform_edt(~occupied)
    view = math.radians(arguments.field_of_view)
    step = view / (arguments.beams if arguments.field_of_view >= 360 else arguments.beams - 1)
    angles = -view / 2 + step * np.arange(arguments.beams)
    with open(arguments.output, "wb") as target:
        log = RobotLog(target, RATE, angles, arguments.range)
        for pose, by_wheels in zip(poses, odometry(poses, random)):
            ranges = cast(distances, resolution, pose, angles, arguments.range) + RANGE_NOISE * random.standard_normal(len(angles))
            ranges[random.random(len(angles)) < MISSING] = np.inf
            log.write(pose, None if arguments.alone else by_wheels, ranges)
        log.finish()


if __name__ == "__main__":
    main()
