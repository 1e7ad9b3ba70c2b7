"""Measures the errors of SLAM that BENCHMARKS quotes: on simulated drives, and on public logs where a folder has them.

    python logs/benches/slam_errors.py target/release/gridweave --public FOLDER

The folder has `NAME.mcap` (`/robot1/scan` and `/robot1/odom`; `/robot2/...` in the second halves) and `NAME.csv` (time in seconds, the corrected
pose, the pose by odometry: x, y, yaw each) for the names below. Errors are distances after rigid alignment, metres. `--only` measures
some of the parts: alone, together, whole, dealt, gaps, simulated, pairs, corridors. It needs `mcap-ros2-support` and numpy of PyPI.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path

import numpy as np
from public_drives import Drive, spread
from trajectory_error import distances, poses, rms

ALONE = ["intel-robot1", "intel-robot2", "csail-robot1", "csail-robot2", "exp1", "exp2"]
HALVES = ["intel", "csail"]
HALF_CIRCLE = ["beams=181", "lidar_range=8", "field_of_view=3.1416"]
SINGLE = [
    ("half a circle, 181 beams, 8 m", range(640, 644), HALF_CIRCLE),
    ("full circle, 120 beams, 5.6 m", range(644, 648), ["beams=120", "lidar_range=5.6"]),
    ("full circle, 360 beams, 12 m, two slips", range(648, 652), ["beams=360", "lidar_range=12", "odometry_slips=2"]),
    ("360 beams, 12 m, odometry_scale=0.1", range(652, 654), ["beams=360", "lidar_range=12", "odometry_scale=0.1"]),
    ("360 beams, 12 m, odometry_scale=0", range(654, 656), ["beams=360", "lidar_range=12", "odometry_scale=0"]),
]
PAIRS = range(660, 668)
LIDARS = ["--beams 360 --range 30", "--beams 360 --range 8", "--beams 36 --range 30"]
CORRIDORS = [("bare, by scans alone", ""), ("with door frames, by scans alone", "--doors"), ("bare, with odometry", "--odometry")]
ROBOTS = [2, 3, 4]
PARTS = ["alone", "together", "whole", "dealt", "gaps", "simulated", "pairs", "corridors"]
# Gaps in a drive: where they begin, as a share of its scans, and how many are missing.
GAP_STARTS = [0.3, 0.5, 0.7]
GAP_LENGTHS = [5, 10, 20, 40, 80]
# The error of a map that is wrong, metres.
WRONG = 0.5
# Two robots have met where they are nearer to each other than this, metres.
MEETING = 1.0
# The exit status of a run in which a robot could not be merged.
UNMERGED = 3


class Bench:
    """The program that is measured, and a folder for its logs."""

    def __init__(self, gridweave, folder):
        self.gridweave, self.folder = gridweave, folder

    def file(self, name):
        return str(self.folder / name)

    def run(self, *arguments):
        """Runs a command. A robot may have no map, or not be merged; whatever else fails ends the measurement."""
        done = subprocess.run([self.gridweave, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode not in (0, UNMERGED) and "no usable map" not in done.stderr:
            sys.exit(f"`gridweave {' '.join(map(str, arguments))}` failed:\n{done.stderr}")

    def errors(self, log, truths, robot="robot1"):
        """Distances of a robot's poses from the truth, and the share of the truth's times that have one."""
        estimated = poses(self.gridweave, log, f"/{robot}/matched_pose")
        if len(estimated) < 3:
            return None, 0.0
        found = distances(estimated, truths)
        return found, len(found) / len(truths)

    def simulated(self, seed, lidar, robots, topics):
        """A simulated log of scans and odometry, and the true poses of its robots."""
        name = f"{seed}-{robots}-{len(topics)}"
        world, raw = self.file(f"{name}-world.mcap"), self.file(f"{name}.mcap")
        options = ["scans=true", "odometry=true", "drift=0", "width=20", "height=16", f"robots={robots}", *lidar]
        self.run("simulate", "-o", world, "--seed", seed, *chain.from_iterable(("--set", option) for option in options))
        self.run("filter", world, "-o", raw, "--topics", topics)
        return raw, {f"robot{n}": poses(self.gridweave, world, f"/robot{n}/pose") for n in range(1, robots + 1)}

    def merged(self, raw, *options):
        output = f"{raw}{''.join(options)}.merged.mcap".replace("=", "-")
        self.run("run", "scan_merge", "--input", raw, "--output", output, *chain.from_iterable(("--set", option) for option in options))
        return output


def corrected(path):
    """The corrected poses of a public log by time in milliseconds."""
    rows = (list(map(float, line.split())) for line in path.read_text().splitlines())
    return {round(1000 * row[0]): tuple(row[1:4]) for row in rows}


def shown(name, errors, whole=1.0):
    if errors is None:
        return f"| {name} | no map |"
    share = "" if whole > 0.995 else f" | {whole:.0%} of the scans"
    return f"| {name} | {rms(errors):.3f} | {np.median(errors):.3f} | {errors.max():.2f}{share} |"


def alone(bench, public, name):
    output = bench.file(f"{name}.merged.mcap")
    robot = "robot2" if name.endswith("robot2") else "robot1"
    bench.run("run", "scan_merge", "--input", f"{robot}={public / name}.mcap", "--output", output)
    return [shown(name, *bench.errors(output, corrected(public / f"{name}.csv"), robot))]


def together(bench, public, name):
    """Both halves of a log merged, and how far the poses of one are from where they should be to the other's where they meet."""
    output = bench.file(f"{name}.merged.mcap")
    inputs = [f"robot{n}={public / name}-robot{n}.mcap" for n in (1, 2)]
    bench.run("merge", *inputs, "-o", output, "--summary", output + ".json")
    truths = {f"robot{n}": corrected(public / f"{name}-robot{n}.csv") for n in (1, 2)}
    rows = [shown(f"{robot} of {name}, together", *bench.errors(output, truth, robot)) for robot, truth in truths.items()]
    off = relative(bench, output, truths)
    return [*rows, f"| {name}, one to the other | {'not merged' if off is None else f'{off:.3f} in the median'} |"]


def relative(bench, output, truths):
    """The median error of the position of one robot in the frame of the other, metres, where they meet; none if they are not merged."""
    frames = merged_frames(output + ".json")
    if len(frames) < 2:
        return None
    tracks = {}
    for robot, truth in truths.items():
        estimated = poses(bench.gridweave, output, f"/{robot}/matched_pose")
        tracks[robot] = [(estimated[time], truth[time]) for time in sorted(set(estimated) & set(truth))]
    off = []
    for one, true_one in tracks["robot1"]:
        for other, true_other in tracks["robot2"]:
            if np.hypot(true_one[0] - true_other[0], true_one[1] - true_other[1]) < MEETING:
                estimated = between(compose(frames["robot1"], one), compose(frames["robot2"], other))
                off.append(np.hypot(*np.subtract(estimated[:2], between(true_one, true_other)[:2])))
    return float(np.median(off)) if off else None


def merged_frames(summary):
    """The poses (x, y, yaw) of the robots' frames in the merged one."""
    frames = json.loads(Path(summary).read_text())["frames"]
    return {robot: (frame["x"], frame["y"], frame["yaw"]) for robot, frame in frames.items()}


def compose(a, b):
    cosine, sine = np.cos(a[2]), np.sin(a[2])
    return a[0] + cosine * b[0] - sine * b[1], a[1] + sine * b[0] + cosine * b[1], a[2] + b[2]


def between(a, b):
    cosine, sine = np.cos(a[2]), np.sin(a[2])
    x, y = b[0] - a[0], b[1] - a[1]
    return cosine * x + sine * y, cosine * y - sine * x, b[2] - a[2]


def whole(bench, public, name):
    """Both halves of a log as one drive, and over how many cells its hits are spread, against those at the true poses."""
    log = bench.file(f"{name}-whole.mcap")
    angles, scans = Drive(public, name).write(log)
    output = bench.merged(log)
    truth, estimated = {time: pose for time, (pose, _) in scans.items()}, poses(bench.gridweave, output, "/robot1/matched_pose")
    wider = spread(angles, scans, estimated) / spread(angles, scans, truth) - 1
    return [f"{shown(f'{name}, whole', *bench.errors(output, truth))} {wider:+.0%} cells |"]


def dealt(bench, public, name):
    """A drive dealt out to robots that drive one after the other: how many are merged, and the error of all in one frame."""
    drive = Drive(public, name)
    return [dealt_to(bench, drive, name, robots) for robots in ROBOTS]


def dealt_to(bench, drive, name, robots):
    names = [f"robot{number + 1}" for number in range(robots)]
    logs = [bench.file(f"{name}-{robots}-{robot}.mcap") for robot in names]
    truths = [drive.write(log, number, robots)[1] for number, log in enumerate(logs)]
    output = bench.file(f"{name}-{robots}.merged.mcap")
    bench.run("merge", *(f"{robot}={log}" for robot, log in zip(names, logs)), "-o", output, "--summary", output + ".json")
    frames, estimated, true = merged_frames(output + ".json"), {}, {}
    for robot, truth in zip(names, truths):
        if robot in frames:
            matched = poses(bench.gridweave, output, f"/{robot}/matched_pose")
            estimated |= {(robot, time): compose(frames[robot], pose) for time, pose in matched.items()}
            true |= {(robot, time): pose for time, (pose, _) in truth.items()}
    return f"{shown(f'{name}, {robots} robots', distances(estimated, true))} {len(frames)} of {robots} merged |"


def gaps(bench, public, name):
    """A drive a stretch of which was not recorded: how often its map is whole, ends there, is refused, or is wrong, by the gap's length."""
    drive = Drive(public, name)
    return [gap_of(bench, drive, name, length) for length in GAP_LENGTHS]


def gap_of(bench, drive, name, length):
    outcomes = []
    for share in GAP_STARTS:
        start, log = int(share * len(drive.steps)), bench.file(f"{name}-gap-{share}-{length}.mcap")
        truth = {time: pose for time, (pose, _) in drive.write(log, gap=range(start, start + length))[1].items()}
        errors, whole = bench.errors(bench.merged(log), truth)
        if errors is None:
            outcomes.append("refused")
        elif errors.max() > WRONG:
            outcomes.append(f"wrong by {errors.max():.2f}")
        else:
            outcomes.append("whole" if whole > 0.995 else f"ends at {whole:.0%}")
    return f"| {name} | {length} s | {', '.join(outcomes)} |"


def simulated(bench, kind):
    name, seeds, lidar = kind
    found = []
    for seed in seeds:
        raw, truths = bench.simulated(seed, lidar, 1, "/{robot}/scan,/{robot}/odom")
        found.append(bench.errors(bench.merged(raw), truths["robot1"])[0])
    each = ["none" if errors is None else f"{rms(errors):.3f}" for errors in found]
    mean = np.mean([rms(errors) for errors in found if errors is not None])
    return [f"| {name} | {seeds[0]}-{seeds[-1]} | {mean:.3f} | {' '.join(each)} |"]


def pairs(bench, seed):
    """Errors of two robots each alone, together, and of the second alone and with the recorded map of the first."""
    raw, truths = bench.simulated(seed, HALF_CIRCLE, 2, "/{robot}/scan,/{robot}/odom")
    found = []
    for options in (["mapper.joint_refinement=false"], []):
        output = bench.merged(raw, *options)
        found += [bench.errors(output, truth, robot)[0] for robot, truth in truths.items()]
    recorded, _ = bench.simulated(seed, HALF_CIRCLE, 2, "/robot1/map,/robot1/pose,/robot2/scan,/robot2/odom")
    for options in (["mapper.joint_refinement=false"], []):
        found.append(bench.errors(bench.merged(recorded, *options), truths["robot2"], "robot2")[0])
    return [[np.nan if errors is None else rms(errors) for errors in found]]


def corridor(bench, kind):
    name, walls = kind
    cells = []
    for lidar in LIDARS:
        raw = bench.file(f"{name}-{lidar}.mcap".replace(" ", ""))
        program = Path(__file__).with_name("corridor_scans.py")
        subprocess.run([sys.executable, program, raw, *lidar.split(), *walls.split()], check=True)
        truth = poses(bench.gridweave, raw, "/robot1/truth")
        topics = "/robot1/scan" + ",/robot1/odom" * ("odometry" in walls)
        bench.run("filter", raw, "-o", raw + ".scans.mcap", "--topics", topics)
        errors, whole = bench.errors(bench.merged(raw + ".scans.mcap"), truth)
        cells.append("no map" if errors is None else f"{rms(errors):.3f}, {'all' if whole > 0.99 else f'{whole:.0%}'}")
    return [f"| {name} | {' | '.join(cells)} |"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("gridweave")
    parser.add_argument("--public", type=Path)
    parser.add_argument("--only", default=",".join(PARTS))
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    parts = arguments.only.split(",")
    unknown = set(parts) - set(PARTS)
    if unknown:
        parser.error(f"there is no part {', '.join(sorted(unknown))}: the parts are {', '.join(PARTS)}")
    if arguments.only != ",".join(PARTS) and not arguments.public and set(PARTS[:5]) & set(parts):
        parser.error("public logs need --public FOLDER")
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(arguments.workers) as pool:
        bench = Bench(arguments.gridweave, Path(folder))
        public = {"alone": (alone, ALONE), **{part.__name__: (part, HALVES) for part in (together, whole, dealt, gaps)}} if arguments.public else {}
        for part, (measure, names) in public.items():
            if part in parts:
                print_rows(pool.map(lambda name: measure(bench, arguments.public, name), names))
        drives = {"simulated": (simulated, SINGLE), "corridors": (corridor, CORRIDORS)}
        for part, (measure, kinds) in drives.items():
            if part in parts:
                print_rows(pool.map(lambda kind: measure(bench, kind), kinds))
        if "pairs" in parts:
            found = np.array([row for rows in pool.map(lambda seed: pairs(bench, seed), PAIRS) for row in rows])
            for name, columns in (("alone", [0, 1]), ("together", [2, 3]), ("robot2 alone", [4]), ("with the map of robot1", [5])):
                values = found[:, columns].ravel()
                print(f"| pairs, {name} | {np.nanmean(values):.3f} in the mean | {np.nanmedian(values):.3f} in the median |")


def print_rows(results):
    for rows in results:
        print("\n".join(rows), flush=True)


if __name__ == "__main__":
    main()
