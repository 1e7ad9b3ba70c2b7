"""Measures a live merge of two robots that are rclpy nodes on Fast DDS: the time from a map that a robot publishes to the merged map with
it in a third node, and the load of gridweave-ros without anything to do.

    python over_fast_dds.py target/release/gridweave-ros

The Python is one with what is in tests/python/ros_jazzy.txt or ros_kilted.txt. All of it is on this machine alone.

Each map is of 800 x 800 cells and has its number in it: of two areas far from all walls, one is free for each bit, and the other unknown.
So it is the cells of the merged map that say which map is in it. Measured is from when both robots are in the merged map on.
"""

import argparse
import array
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
SIDE = 800
BITS = 10
# Cells: an area, and how far the areas are from the walls.
AREA, MARGIN = 24, 40
UNKNOWN = b"\xff"
# What takes longer hangs.
LONGEST = 600.0


def snapshots(log):
    """The maps of each robot of a log, and its poses, all with their times."""
    from geometry_msgs.msg import PoseStamped
    from mcap.reader import make_reader
    from nav_msgs.msg import OccupancyGrid
    from rclpy.serialization import deserialize_message

    robots = {}
    with open(log, "rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            parts = channel.topic.strip("/").split("/")
            kinds = {"map": OccupancyGrid, "pose": PoseStamped}
            if len(parts) == 2 and parts[0].startswith("robot") and parts[1] in kinds:
                of_robot = robots.setdefault(parts[0], {"map": [], "pose": []})
                of_robot[parts[1]].append((message.log_time / 1e9, deserialize_message(message.data, kinds[parts[1]])))
    return robots


class Canvas:
    """A grid of 800 x 800 cells that holds all maps of a robot, with room above them for the number."""

    def __init__(self, maps):
        self.resolution = maps[-1].info.resolution
        cells = lambda metres: round(metres / self.resolution)
        left = min(cells(grid.info.origin.position.x) for grid in maps)
        bottom = min(cells(grid.info.origin.position.y) for grid in maps)
        right = max(cells(grid.info.origin.position.x) + grid.info.width for grid in maps)
        top = max(cells(grid.info.origin.position.y) + grid.info.height for grid in maps)
        if right - left > SIDE or top - bottom + 2 * MARGIN + AREA > SIDE:
            sys.exit(f"the maps have {right - left} x {top - bottom} cells, too many for {SIDE} x {SIDE} with a number")
        self.left, self.bottom = left, bottom
        self.row = top - bottom + MARGIN

    def areas(self):
        """The first columns of the areas: two for each bit, of 0 and of 1."""
        return [(2 * bit * AREA, (2 * bit + 1) * AREA) for bit in range(BITS)]

    def draw(self, grid, number):
        cells = bytearray(UNKNOWN * (SIDE * SIDE))
        data, width = grid.data.tobytes(), grid.info.width
        column = round(grid.info.origin.position.x / self.resolution) - self.left
        row = round(grid.info.origin.position.y / self.resolution) - self.bottom
        for line in range(grid.info.height):
            at = (row + line) * SIDE + column
            cells[at : at + width] = data[line * width : (line + 1) * width]
        for bit, areas in enumerate(self.areas()):
            first = areas[number >> bit & 1]
            for line in range(self.row, self.row + AREA):
                cells[line * SIDE + first : line * SIDE + first + AREA] = bytes(AREA)
        grid.data = array.array("b", bytes(cells))
        grid.info.width = grid.info.height = SIDE
        grid.info.origin.position.x, grid.info.origin.position.y = self.left * self.resolution, self.bottom * self.resolution
        return grid

    def places(self):
        """The middles of the areas in the frame of the map, metres."""
        at = lambda column, row: ((self.left + column + AREA / 2) * self.resolution, (self.bottom + row + AREA / 2) * self.resolution)
        return [[at(first, self.row) for first in areas] for areas in self.areas()]


def robots(log, period):
    """Publishes the maps and poses of both robots, and prints when, a line of JSON each; then stays until standard input ends."""
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import OccupancyGrid
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    sensor = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
    rclpy.init()
    due, places, kept = [], {}, []
    for index, (robot, of_robot) in enumerate(sorted(snapshots(log).items())):
        node = rclpy.create_node("slam", namespace=robot)
        maps = node.create_publisher(OccupancyGrid, f"/{robot}/map", latched)
        poses = node.create_publisher(PoseStamped, f"/{robot}/pose", sensor)
        kept.append((node, maps, poses))
        canvas = Canvas([grid for _, grid in of_robot["map"]])
        places[robot] = canvas.places()
        # As many seconds for each map as was asked for, and not at the times of the other robot.
        start, end = of_robot["map"][0][0], of_robot["map"][-1][0]
        pace = period * (len(of_robot["map"]) - 1) / (end - start)
        shift = period * index / 2
        for number, (at, grid) in enumerate(of_robot["map"]):
            due.append(((at - start) * pace + shift, robot, number, canvas.draw(grid, number), maps))
        for at, pose in of_robot["pose"]:
            due.append(((at - start) * pace + shift, robot, None, pose, poses))
    print(json.dumps({"places": places}), flush=True)
    # Whoever is to be measured has started.
    sys.stdin.readline()
    start = time.monotonic()
    for at, robot, number, message, publisher in sorted(due, key=lambda one: one[0]):
        time.sleep(max(0.0, at - (time.monotonic() - start)))
        published = time.monotonic()
        publisher.publish(message)
        if number is not None:
            print(json.dumps({"robot": robot, "number": number, "at": published}), flush=True)
    print(json.dumps({"end": True}), flush=True)
    sys.stdin.read()


def number_in(grid, frame, places):
    """The number of the robot's map that is in a merged map; None if it has none."""
    x, y, yaw = frame
    cos, sin = math.cos(yaw), math.sin(yaw)
    info, number = grid.info, 0

    def is_free(place):
        column = (x + cos * place[0] - sin * place[1] - info.origin.position.x) / info.resolution
        row = (y + sin * place[0] + cos * place[1] - info.origin.position.y) / info.resolution
        is_inside = 0 <= column < info.width and 0 <= row < info.height
        return is_inside and 0 <= grid.data[int(row) * info.width + int(column)] < 50

    for bit, (of_zero, of_one) in enumerate(places):
        has_zero, has_one = is_free(of_zero), is_free(of_one)
        if has_zero == has_one:
            return None
        number |= has_one << bit
    return number


def viewer(known):
    """Receives merged maps, and prints which maps of the robots are in each, a line of JSON each, until standard input ends."""
    import rclpy
    from nav_msgs.msg import OccupancyGrid
    from rclpy.qos import DurabilityPolicy, QoSProfile

    places, frames = json.loads(known)

    def take(grid):
        received = time.monotonic()
        numbers = {robot: number_in(grid, frames[robot], places[robot]) for robot in places}
        print(json.dumps({"at": received, "numbers": numbers}), flush=True)

    rclpy.init()
    node = rclpy.create_node("viewer")
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    subscription = node.create_subscription(OccupancyGrid, "/map", take, latched)
    print(json.dumps({"ready": True}), flush=True)
    threading.Thread(target=lambda: (sys.stdin.read(), rclpy.shutdown()), daemon=True).start()
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=1.0)


class Lines:
    """A program that prints lines of JSON."""

    def __init__(self, command, environment, log):
        self.log = log
        with open(log, "wb") as errors:
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": errors}
            self.process = subprocess.Popen(command, env=environment, text=True, **pipes)
        # One that hangs is killed, and its output ends.
        self.watchdog = threading.Timer(LONGEST, self.process.kill)
        self.watchdog.daemon = True
        self.watchdog.start()

    def next(self):
        line = self.process.stdout.readline()
        if not line:
            sys.exit(f"{self.process.args[1:4]} has ended: {Path(self.log).read_text()[-2000:]}")
        return json.loads(line)

    def end(self):
        """Ends it, and gives what it has printed that was not read."""
        rest, _ = self.process.communicate("")
        self.watchdog.cancel()
        return [json.loads(line) for line in rest.splitlines()]


class Run:
    """A run of live_ros, on this machine alone."""

    def __init__(self, gridweave, domain, folder):
        pipeline, self.folder = HERE.parent / "live_ros.toml", folder
        settings = ['middleware="dds"', 'discovery_range="localhost"', f"domain={domain}"]
        settings = [f"{stage}.{setting}" for stage in ("robots", "ros") for setting in settings]
        command = [gridweave, "run", str(pipeline), "--summary", f"{folder}/summary.json"]
        command += [part for setting in settings for part in ("--set", setting)]
        with open(f"{folder}/run.log", "wb") as log:
            self.process = subprocess.Popen(command, stdout=log, stderr=log, cwd=folder)

    def times(self):
        """The processor time that each of its processes has taken, by stage, seconds."""
        children = subprocess.run(["ps", "-o", "pid=", "--ppid", str(self.process.pid)], capture_output=True, text=True)
        taken = {}
        for pid in [str(self.process.pid), *children.stdout.split()]:
            try:
                words = Path(f"/proc/{pid}/cmdline").read_bytes().decode().split("\0")
                threads = Path(f"/proc/{pid}/task").glob("*/schedstat")
                # Clock ticks would miss most of what wakes up for less than one.
                seconds = sum(int(thread.read_text().split()[0]) for thread in threads) / 1e9
            except FileNotFoundError:
                continue
            taken[words[3] if words[1] == "stage" else words[1]] = seconds
        return taken

    def load(self, seconds):
        """The share of a core that each of its processes takes, in percent, by stage."""
        before = self.times()
        time.sleep(seconds)
        return {name: 100 * (now - before.get(name, 0.0)) / seconds for name, now in self.times().items()}

    def end(self):
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(60)
        except subprocess.TimeoutExpired:
            self.process.kill()
            sys.exit(f"the run does not end: {Path(self.folder, 'run.log').read_text()[-2000:]}")


def told_load(title, load):
    most = sorted(load.items(), key=lambda one: -one[1])
    told = ", ".join(f"{name} {share:.2f} %" for name, share in most if share >= 0.005)
    print(f"{title}: {sum(load.values()):.2f} % of a core ({told})", flush=True)


def latencies(published, seen):
    """Of each map that was published: the time until a merged map had it or a later one; None if none had."""
    for one in published:
        robot, number, at = one["robot"], one["number"], one["at"]
        has_it = lambda view: view["numbers"][robot] is not None and view["numbers"][robot] >= number and view["at"] >= at
        first = next((view["at"] for view in seen if has_it(view)), None)
        yield None if first is None else first - at


def measure(gridweave, options, folder):
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(options.domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(HERE.parent / "tests/python/loopback.xml"),
        "ROS_LOG_DIR": folder,
    }
    log = f"{folder}/robots.mcap"
    building = ["width=30", "height=24", "drift=0", "overlap=0.7", f"snapshots={options.maps}"]
    simulate = [gridweave, "simulate", "-o", log, "--robots", "2", "--seed", str(options.seed)]
    subprocess.run(simulate + [part for one in building for part in ("--set", one)], check=True, capture_output=True)
    frames = json.loads(Path(folder, "robots.truth.json").read_text())["frames"]
    frames = {robot: (frame["x"], frame["y"], frame["yaw"]) for robot, frame in frames.items()}

    run = Run(gridweave, options.domain, folder)
    # What a start costs is over by then, and so is the warning that nobody is there.
    time.sleep(15)
    told_load("nobody in the domain", run.load(options.idle))

    python = [sys.executable, str(HERE / "over_fast_dds.py"), gridweave]
    publishing = Lines([*python, "--robots", log, str(options.period)], environment, f"{folder}/robots.log")
    known = json.dumps([publishing.next()["places"], frames])
    viewing = Lines([*python, "--viewer", known], environment, f"{folder}/viewer.log")
    viewing.next()
    told_load("two robots that say nothing", run.load(options.idle))

    publishing.process.stdin.write("start\n")
    publishing.process.stdin.flush()
    before, start = run.times(), time.monotonic()
    published = list(iter(publishing.next, {"end": True}))
    # The last maps need their time, too.
    time.sleep(3)
    elapsed = time.monotonic() - start
    taken = {name: 100 * (now - before.get(name, 0.0)) / elapsed for name, now in run.times().items()}
    told_load("while they publish", taken)
    told_load("two robots at rest", run.load(options.idle))
    seen = viewing.end()
    publishing.end()
    run.end()

    merged = next((view["at"] for view in seen if None not in view["numbers"].values()), None)
    if merged is None:
        sys.exit(f"the robots were not merged: {Path(folder, 'run.log').read_text()[-2000:]}")
    counted = [one for one in published if one["at"] > merged]
    of_maps = list(latencies(counted, seen))
    sorted_times = sorted(one for one in of_maps if one is not None)
    at = lambda share: sorted_times[min(len(sorted_times) - 1, int(share * len(sorted_times)))]
    print(f"{len(published)} maps of {SIDE} x {SIDE}, {len(seen)} merged maps; both robots in it after {merged - start:.1f} s")
    print(f"of {len(of_maps)} maps from then on {of_maps.count(None)} are in no merged map")
    print(
        f"from a map to the merged map with it: median {at(0.5):.3f} s, 95 % {at(0.95):.3f} s, longest {sorted_times[-1]:.3f} s",
        flush=True,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("gridweave", help="the command gridweave-ros")
    parser.add_argument("--maps", type=int, default=100, help="maps of each robot")
    parser.add_argument("--period", type=float, default=2.0, help="seconds between two maps of a robot")
    parser.add_argument("--idle", type=float, default=60.0, help="seconds for which the load is measured")
    parser.add_argument("--domain", type=int, default=77, help="the ROS domain")
    parser.add_argument("--seed", type=int, default=5, help="the building")
    parser.add_argument("--robots", nargs=2, help=argparse.SUPPRESS)
    parser.add_argument("--viewer", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.robots:
        robots(options.robots[0], float(options.robots[1]))
    elif options.viewer:
        viewer(options.viewer)
    else:
        with tempfile.TemporaryDirectory() as folder:
            measure(str(Path(options.gridweave).resolve()), options, folder)


main()
