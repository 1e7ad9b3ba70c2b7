"""Fits `max_contradicting` of `scan_mapper`: from which share of contradicting scans on a map is wrong.

    python logs/benches/scan_contradictions.py target/release/gridweave --drives 80 --first-seed 700

Robots with lidars of many kinds, good and bad, with and without odometry, drive through simulated buildings, and a map of each is built of
its scans. A map is wrong where the error of the poses, rms after rigid alignment, is above 0.5 m. Each drive is printed as it ends, and at last
the share that parts the wrong maps from the right ones with the fewest mistakes, in the middle between those on both sides, and how often it
is mistaken on each half of the drives where it is fitted to the other half. It needs numpy of PyPI.
"""

import argparse
import json
import random
import subprocess
import tempfile
from pathlib import Path

from trajectory_error import distances, poses, rms

WRONG = 0.5
COUNTS = ("scans that contradict walls", "scans that see walls again")


def drive(gridweave, seed, folder):
    """Error of the poses, and share of the scans that contradict others; none if the robot has no map."""
    draw = random.Random(seed)
    lidar = [f"beams={draw.choice([40, 60, 90, 120, 181, 360])}", f"lidar_range={draw.choice([3.5, 5.6, 8, 12])}"]
    lidar += draw.choice([[], ["field_of_view=3.1416"]])
    has_odometry = draw.random() < 0.7
    slips = [f"odometry_slips={draw.choice([0, 3, 8])}"]
    building = ["robots=1", "scans=true", "odometry=true", "drift=0", "width=20", "height=16"]
    options = [option for value in building + lidar + slips for option in ("--set", value)]
    world, raw, merged, summary = (str(folder / name) for name in ("world.mcap", "raw.mcap", "merged.mcap", "summary.json"))
    topics = "/{robot}/scan" + ",/{robot}/odom" * has_odometry
    for command in (
        ["simulate", "-o", world, "--seed", str(seed), *options],
        ["filter", world, "-o", raw, "--topics", topics],
        ["run", "scan_merge", "--input", raw, "--output", merged, "--summary", summary, "--set", "mapper.max_contradicting=1"],
    ):
        subprocess.run([gridweave, *command], capture_output=True)
    mapper = dict(json.loads(Path(summary).read_text())["stages"])["mapper"]
    contradicting, revisiting = (mapper.get("counts", {}).get(count, 0) for count in COUNTS)
    estimated = poses(gridweave, merged, "/robot1/matched_pose")
    if revisiting == 0 or len(estimated) < 3:
        return None
    off, share = rms(distances(estimated, poses(gridweave, world, "/robot1/pose"))), contradicting / revisiting
    print(seed, *lidar, *slips, "odometry" if has_odometry else "scans alone", f"{off:.3f} m {share:.3f}", flush=True)
    return off, share


def mistakes(drives, limit):
    return sum((off > WRONG) != (share > limit) for off, share in drives)


def fit(drives):
    """The share that errs least: of several the one that lets the fewest wrong maps pass, which is worse than a right one that is not sent,
    and of these the one in the middle, by its logarithm, of the widest gap."""
    shares = sorted({max(share, 1e-3) for _, share in drives})
    middles = [((low * high) ** 0.5, high / low) for low, high in zip(shares, shares[1:])]
    passing = lambda limit: sum(off > WRONG and share <= limit for off, share in drives)
    return min(middles, key=lambda middle: (mistakes(drives, middle[0]), passing(middle[0]), -middle[1]))[0]


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("gridweave")
    arguments.add_argument("--drives", type=int, default=80)
    arguments.add_argument("--first-seed", type=int, default=700)
    arguments = arguments.parse_args()
    drives = []
    for seed in range(arguments.first_seed, arguments.first_seed + arguments.drives):
        with tempfile.TemporaryDirectory() as folder:
            result = drive(arguments.gridweave, seed, Path(folder))
        drives += [] if result is None else [result]
    halves = drives[::2], drives[1::2]
    crossed = [mistakes(other, fit(half)) for half, other in (halves, halves[::-1])]
    wrong = sum(off > WRONG for off, _ in drives)
    print(f"{len(drives)} maps, {wrong} wrong: a share of {fit(drives):.3f} is mistaken {mistakes(drives, fit(drives))} times, ", end="")
    print(f"and {crossed} times where it is fitted to the other half")


if __name__ == "__main__":
    main()
