#!/usr/bin/python3
"""RViz of ROS 1 on a virtual display shows a merged bag with the configuration that ships: the map, and the path of each robot.

    /usr/bin/python3 tests/ros1/rviz.py GRIDWEAVE [PICTURE.ppm]

Needs the packages of Debian in packages.txt.
"""

import os
import struct
import subprocess
import sys
from collections import Counter
from pathlib import Path

from ros1 import Player, check, folder, gridweave, programs, run, start, until, whole

CONFIGURATION = Path(__file__).resolve().parents[2] / "pipelines/viewers/gridweave_ros1.rviz"
# The colours of the paths in the configuration, and white, by which the scheme `map` draws free cells.
PATHS = {"robot1": (0, 114, 178), "robot2": (213, 94, 0), "robot3": (0, 158, 115)}


def screen():
    """Width, height and pixels (BGRX) of the display, from the file that Xvfb keeps (XWD)."""
    data = (folder / "screen" / "Xvfb_screen0").read_bytes()
    header, = struct.unpack_from(">I", data)
    width, height = struct.unpack_from(">2I", data, 16)
    line, = struct.unpack_from(">I", data, 48)
    colours, = struct.unpack_from(">I", data, 76)
    assert line == 4 * width, line
    return width, height, data[header + 12 * colours:][:line * height]


def near(colour, other):
    return all(abs(a - b) <= 24 for a, b in zip(colour, other))


def seen():
    """How many pixels each of the things takes."""
    _, _, pixels = screen()
    colours = Counter(struct.iter_unpack("<4B", pixels))
    total = Counter()
    for (blue, green, red, _), number in colours.items():
        for robot, colour in PATHS.items():
            if near((red, green, blue), colour):
                total[robot] += number
        # Unknown cells have a colour that nothing else of the window has.
        if near((red, green, blue), (112, 137, 134)):
            total["unknown"] += number
    return total


def shown():
    run(gridweave, "simulate", "-o", "robots.mcap")
    run(gridweave, "merge", "robots.mcap", "-o", "merged.bag")
    (folder / "screen").mkdir()
    read, write = os.pipe()
    os.set_inheritable(write, True)
    xvfb = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "1400x900x24", "-nolisten", "tcp", "-fbdir",
                             str(folder / "screen")], pass_fds=[write], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                            stderr=subprocess.DEVNULL, start_new_session=True)
    programs.append(xvfb)
    os.close(write)
    with os.fdopen(read) as number:
        os.environ.update(DISPLAY=f":{number.readline().strip()}", LIBGL_ALWAYS_SOFTWARE="1", HOME=str(folder),
                          XDG_RUNTIME_DIR=str(folder))
    rviz = start("rviz", "-d", CONFIGURATION, log="rviz.log")
    player = Player("merged.bag", "--rate", 300, "--keep-alive", name="play_merged")
    # /map, the paths, /tf_static and /markers/graph at least.
    player.connected(8)
    player.go()
    try:
        until("map and paths", lambda: min(seen()[one] for one in ["unknown", *PATHS]) > 100, seconds=60)
    except RuntimeError:
        pass
    found = seen()
    check("RViz shows the merged map", found["unknown"] > 2000, found)
    for robot in PATHS:
        check(f"RViz shows the path of {robot}", found[robot] > 100, found)
    check("RViz runs on", rviz.poll() is None, (folder / "rviz.log").read_text())
    if len(sys.argv) > 2:
        width, height, pixels = screen()
        rgb = bytearray(3 * width * height)
        rgb[0::3], rgb[1::3], rgb[2::3] = pixels[2::4], pixels[1::4], pixels[0::4]
        Path(sys.argv[2]).write_bytes(b"P6 %d %d 255\n" % (width, height) + rgb)


whole(shown, watchdog=110)
