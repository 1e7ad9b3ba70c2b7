"""What Rerun shows of a merged log: by itself, and with the script that ships. A viewer without a window draws it.

    python tests/viewers/with_rerun.py GRIDWEAVE [PICTURE.png]

Needs what requirements.txt names, and a driver for Vulkan (`mesa-vulkan-drivers` of Debian draws without a graphics card).
"""

import io
import os
import signal
import socket
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
from PIL import Image
from rerun.experimental import ViewerClient

from harness import check, finish, gridweave, run

SCRIPT = Path(__file__).resolve().parents[2] / "pipelines/viewers/rerun_view.py"
# Unknown cells, and the paths and walls of the robots.
COLOURS = {"unknown": (112, 137, 134), "robot1": (0, 114, 178), "robot2": (213, 94, 0), "robot3": (0, 158, 115)}
ROBOTS = "robot1", "robot2", "robot3"


def opened(viewer, file):
    """Opens a file, and waits until the viewer has read it."""
    viewer.open(str(file))
    last = time.monotonic() + 60
    while True:
        state = viewer.get_state()
        # While parts are missing, a view reports that frames are.
        ready = state.active_recording and not state.loading and state.views and not any(view.reports for view in state.views)
        if ready or time.monotonic() > last:
            return state
        time.sleep(0.2)


def seen(viewer, whole):
    """How many pixels have each colour, when all is there or after a while, and the picture."""
    last = time.monotonic() + 30
    while True:
        picture = viewer.take_screenshot()
        pixels = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)
        found = {name: int((np.abs(pixels - colour).max(axis=2) < 24).sum()) for name, colour in COLOURS.items()}
        if whole(found) or time.monotonic() > last:
            return found, picture
        time.sleep(0.2)


def end(program):
    """Ends the viewer, which the command has started as its child."""
    os.killpg(program.pid, signal.SIGKILL)
    program.wait()


def started(folder, command):
    """A viewer on a free port of the loopback device."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    run(folder, command, "analytics", "disable")
    with open(folder / "viewer.log", "w") as log:
        program = subprocess.Popen([command, "--headless", "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"], cwd=folder,
                                   stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
    last = time.monotonic() + 30
    while True:
        try:
            viewer = ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
            viewer.get_state()
            return viewer, program
        except Exception:  # it has no error of its own for this
            if program.poll() is not None or time.monotonic() > last:
                end(program)
                raise RuntimeError(f"the viewer does not start: {(folder / 'viewer.log').read_text()}") from None
            time.sleep(0.2)


def shown(folder):
    run(folder, gridweave, "simulate", "-o", "robots.mcap")
    run(folder, gridweave, "merge", "robots.mcap", "-o", "merged.mcap")
    command = Path(sys.executable).parent / "rerun"
    said = run(folder, command, "mcap", "check", "--full", "merged.mcap")
    rows = [line.split() for line in said.splitlines() if "/" in line and line.split()[0] in ("ok", "warn", "warning", "error")]
    wrong = [row for row in rows if row[0] != "ok"]
    check("rerun mcap check finds nothing wrong", len(rows) > 40 and not wrong, said)

    viewer, program = started(folder, command)
    try:
        opened(viewer, folder / "merged.mcap")
        kinds = defaultdict(set)
        for entity in viewer.get_recording_schema().entities:
            kinds[entity.entity_path] |= {(component.archetype or "").split(".")[-1] for component in entity.components}
        for topic, archetype in [("/map", "GridMap"), ("/map_conflicts", "GridMap"), ("/robot1/map", "GridMap"), ("/tf", "Transform3D"),
                                 ("/tf_static", "Transform3D"), ("/robot1/pose", "InstancePoses3D"),
                                 ("/robot1/merged_pose", "InstancePoses3D")]:
            check(f"Rerun reads {topic} as {archetype}", archetype in kinds[topic], kinds[topic])
        # When Rerun learns to draw one of these, the script need not do it.
        for topic, archetype in [("/robot1/merged_path", "Path"), ("/robot1/markers/walls", "MarkerArray"),
                                 ("/markers/graph", "MarkerArray"), ("/robot_frames", "RobotFrames")]:
            check(f"Rerun keeps {topic} as data", kinds[topic] == {archetype, "McapChannel", "McapSchema"}, kinds[topic])
        viewer.set_time("message_log_time", play_state="following")
        found, _ = seen(viewer, lambda found: found["unknown"] > 10000)
        check("at the end of the log the viewer shows the merged map", found["unknown"] > 10000, found)
        check("and no path", max(found[robot] for robot in ROBOTS) < 300, found)

        run(folder, sys.executable, SCRIPT, "merged.mcap", "-o", "merged.rrd")
        opened(viewer, folder / "merged.rrd")
        found, picture = seen(viewer, lambda found: found["unknown"] > 10000 and min(found[robot] for robot in ROBOTS) > 300)
        check("with the script it shows the merged map", found["unknown"] > 10000, found)
        for robot in ROBOTS:
            check(f"and the path and the walls of {robot}", found[robot] > 300, found)
        reports = [report for view in viewer.get_state().views for report in view.reports]
        check("the view has no warnings", not reports, reports)
        if len(sys.argv) > 2:
            Path(sys.argv[2]).write_bytes(picture)
    finally:
        end(program)


# The folder is also where Rerun keeps its settings.
finish(shown, "rerun", XDG_RUNTIME_DIR=None, XDG_CONFIG_HOME=None, XDG_DATA_HOME=None, XDG_CACHE_HOME=None)
