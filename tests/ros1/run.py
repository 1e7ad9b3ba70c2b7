#!/usr/bin/python3
"""Bags that Gridweave writes, read and played by ROS 1 itself, and bags that `rosbag record` writes, read and merged by Gridweave.

    /usr/bin/python3 tests/ros1/run.py GRIDWEAVE

Needs the packages of Debian in packages.txt.
"""

import json
import math
import re
import signal
from collections import Counter

from ros1 import Player, check, end, folder, gridweave, rospy, run, start, until, whole

from nav_msgs.msg import OccupancyGrid

RATE = 30
# What is recorded has the times at which it arrived, so that ranges and poses are paired a little differently.
METRES, RADIANS = 0.02, math.radians(0.2)


def frames(*logs, name):
    run(gridweave, "merge", *logs, "-o", f"{name}.merged.mcap", "--summary", f"{name}.json")
    return json.loads((folder / f"{name}.json").read_text())["frames"]


def apart(these, those):
    """The largest differences of two sets of frames, in metres and radians."""
    if set(these) != set(those):
        return math.inf, math.inf
    metres = max(math.dist([these[robot][axis] for axis in "xy"], [those[robot][axis] for axis in "xy"]) for robot in these)
    turns = (these[robot]["yaw"] - those[robot]["yaw"] for robot in these)
    return metres, max(abs(math.remainder(turn, math.tau)) for turn in turns)


def told(*logs):
    return json.loads(run(gridweave, "info", "--json", *logs))


def counts(about):
    return {topic["topic"]: topic["messages"] for topic in about["topics"]}


def counts_by_rosbag(*bags):
    total = Counter()
    for bag in bags:
        said = run("rosbag", "info", "--yaml", "--key=topics", bag)
        total.update({topic: int(number) for topic, number in re.findall(r"- topic: (\S+)\n.*\n +messages: (\d+)", said)})
    return dict(total)


def written_by_gridweave():
    """`rosbag info`, `rosbag play`, and a subscriber."""
    run(gridweave, "merge", "robots.mcap", "-o", "merged.bag", "--map", "merged.yaml")
    about = told("merged.bag")
    check("rosbag info counts the messages of a merged bag as gridweave info does",
          counts_by_rosbag("merged.bag") == counts(about), (counts_by_rosbag("merged.bag"), counts(about)))
    unruled = set(re.findall(r"rules missing:\n +\* From: (\w+)/", run("rosbag", "check", "merged.bag")))
    check("rosbag check lacks rules for none but types of Gridweave", unruled <= {"gridweave_msgs"}, unruled)

    maps, others = [], {}
    wanted = ["/tf_static", "/robot_frames", "/robot1/merged_path", "/markers/graph"]
    listening = [rospy.Subscriber("/map", OccupancyGrid, maps.append, queue_size=None)]
    for topic in wanted:
        others[topic] = []
        listening.append(rospy.Subscriber(topic, rospy.AnyMsg, others[topic].append, queue_size=None))
    player = Player("merged.bag", "--rate", 300, "--keep-alive", name="play_merged")
    player.connected(len(listening))
    player.go()
    expected = counts(about)
    until("all that was played", lambda: len(maps) == expected["/map"] and all(len(others[one]) == expected[one] for one in wanted))
    check("a subscriber gets every message of a played bag", True)
    image = (folder / "merged.pgm").read_bytes()
    width, height = map(int, image.split(maxsplit=3)[1:3])
    occupied = image[-width * height:].count(0)
    last = maps[-1]
    cells = sum(1 for cell in last.data if cell >= 65)
    check("the last /map is the merged map", (last.info.width, last.info.height, cells) == (width, height, occupied),
          f"{last.info.width} x {last.info.height}, {cells} occupied, not {width} x {height}, {occupied}")
    check("/map is in the frame world, and latched", last.header.frame_id == "world"
          and last._connection_header.get("latching") == "1", last._connection_header)
    late = run("rostopic", "echo", "-n", 1, "--noarr", "/map")
    check("who comes late gets /map, too", 'frame_id: "world"' in late, late)
    for one in listening:
        one.unregister()
    end(player.program)


def written_by_rosbag():
    """One drive, recorded by five recorders at once, and what they have written."""
    run(gridweave, "convert", "robots.mcap", "-o", "robots.bag")
    original = counts(told("robots.bag"))
    truth = frames("robots.bag", name="original")
    check("a bag that was converted merges as its log does", apart(truth, frames("robots.mcap", name="mcap")) == (0.0, 0.0))

    rospy.set_param("/use_sim_time", True)
    # In small chunks, so that only little of the drive (2.6 MB) is in the last one.
    kinds = {"none": [], "lz4": ["--lz4"], "bz2": ["--bz2"], "split": ["--split", "--duration=40"], "killed": ["--chunksize=64"]}
    recorders = {
        kind: start("rosbag", "record", *options, "-O", f"{kind}.bag", *original, f"__name:=record_{kind}", log=f"record_{kind}.log")
        for kind, options in kinds.items()
    }
    player = Player("robots.bag", "--clock", "--hz=1000", "--rate", RATE, name="play_robots")
    player.connected(len(kinds) * len(original))
    check("rosbag play ends well", player.go().wait(timeout=60) == 0)
    end(recorders.pop("killed"), signal.SIGKILL)
    for recorder in recorders.values():
        end(recorder)

    for kind in recorders:
        parts = sorted(folder.glob(f"{kind}_*.bag" if kind == "split" else f"{kind}.bag"))
        if kind == "split":
            check("rosbag record has split its bag", len(parts) > 2, parts)
        about = told(*parts)
        damage = [file["damage"] for file in about["files"] if file["damage"]]
        recorded = counts_by_rosbag(*parts)
        check(f"info reads every message of a bag of rosbag record ({kind})", counts(about) == recorded and not damage,
              (counts(about), recorded, damage))
        # The queues of a recorder have room for 100 messages, and what is above may be missing in the bag.
        check(f"which has what was played ({kind})", set(recorded) == set(original)
              and sum(recorded.values()) > 0.95 * sum(original.values()), (recorded, original))
        if kind in ("lz4", "bz2"):
            check(f"info names its compression ({kind})", kind in about["files"][0]["compression"], about["files"][0])
        difference = apart(truth, frames(*parts, name=kind))
        check(f"and it is merged as its original is ({kind})", difference[0] < METRES and difference[1] < RADIANS, difference)

    active = folder / "killed.bag.active"
    for state in ("killed", "reindexed"):
        if state == "reindexed":
            run("rosbag", "reindex", active)
        about = told(active)
        read = counts(about)
        lost = {topic: count - read.get(topic, 0) for topic, count in original.items()}
        check(f"info reads all but the last chunk of a bag whose recorder was killed ({state})",
              all(lost[topic] >= 0 for topic in lost) and sum(lost.values()) < 0.2 * sum(original.values()), lost)
        damaged = bool(about["files"][0]["damage"])
        check(f"and reports the missing end until there is an index ({state})", damaged == (state == "killed"), about["files"])
        # The last maps may have been in the last chunk.
        difference = apart(truth, frames(active, name=state))
        check(f"and it is merged ({state})", difference[0] < 3 * METRES and difference[1] < 3 * RADIANS, difference)


def both():
    run(gridweave, "simulate", "-o", "robots.mcap")
    written_by_gridweave()
    written_by_rosbag()


whole(both, watchdog=110)
