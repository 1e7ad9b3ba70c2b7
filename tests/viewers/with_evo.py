"""evo reads the paths of a merged log from each container, and they lie on the truth of the simulator.

    python tests/viewers/with_evo.py GRIDWEAVE

Needs what requirements.txt names.
"""

import json
import math
import re
import sys
import zipfile
from pathlib import Path

from harness import check, finish, gridweave, run

# Root mean square and largest distance of a path from the truth, metres.
RMSE, LARGEST = 0.05, 0.12

programs = Path(sys.executable).parent


def write_truth(folder, robot, frame):
    """The path of a robot in the frame of the first one, as TUM: its poses, which are exact without drift, by its true frame."""
    run(folder, programs / "evo_traj", "mcap", "robots.mcap", f"/{robot}/pose", "--save_as_tum")
    lines = []
    for line in (folder / f"{robot}_pose.tum").read_text().splitlines():
        time, x, y, _, _, _, qz, qw = line.split()
        x, y, yaw = float(x), float(y), 2 * math.atan2(float(qz), float(qw)) + frame["yaw"]
        cos, sin = math.cos(frame["yaw"]), math.sin(frame["yaw"])
        lines.append(f"{time} {frame['x'] + cos * x - sin * y} {frame['y'] + sin * x + cos * y} 0 0 0 {math.sin(yaw / 2)} "
                     f"{math.cos(yaw / 2)}\n")
    (folder / f"{robot}_truth.tum").write_text("".join(lines))


def error(folder, robot):
    """The statistics of evo_ape, and how many poses it has paired."""
    run(folder, programs / "evo_traj", "mcap", "merged.mcap", f"/{robot}/merged_pose", "--save_as_tum")
    run(folder, programs / "evo_ape", "tum", f"{robot}_truth.tum", f"{robot}_merged_pose.tum", "--save_results", f"{robot}.zip")
    with zipfile.ZipFile(folder / f"{robot}.zip") as results:
        return json.loads(results.read("stats.json"))


def read(folder):
    run(folder, gridweave, "simulate", "-o", "robots.mcap", "--set", "drift=0")
    truth = json.loads((folder / "robots.truth.json").read_text())["frames"]
    counts = {}
    for kind, output in [("mcap", "merged.mcap"), ("bag2", "merged/"), ("bag", "merged.bag")]:
        run(folder, gridweave, "merge", "robots.mcap", "-o", output)
        said = run(folder, programs / "evo_traj", kind, output.rstrip("/"), *[f"/{robot}/merged_pose" for robot in truth])
        counts[kind] = re.findall(r"name:\s+(\S+)\ninfos:\s+(\d+) poses, ([\d.]+)m path length", said)
        check(f"evo_traj {kind} reads the merged poses of each robot", sorted(name for name, _, _ in counts[kind]) == sorted(
            f"/{robot}/merged_pose" for robot in truth) and all(int(poses) > 100 for _, poses, _ in counts[kind]), said)
    check("the same from each container", counts["mcap"] == counts["bag2"] == counts["bag"], counts)
    for robot, frame in truth.items():
        write_truth(folder, robot, frame)
        found = error(folder, robot)
        check(f"the merged path of {robot} is within {RMSE} m of the truth (root mean square)", found["rmse"] < RMSE, found)
        check(f"and nowhere {LARGEST} m off", found["max"] < LARGEST, found)


# The folder is also where evo keeps its settings.
finish(read, "evo", MPLBACKEND="Agg")
