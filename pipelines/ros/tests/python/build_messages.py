"""Builds the package gridweave_msgs as a user of ROS does, by colcon, with the packages that are in the environment of this Python.

    python build_messages.py FOLDER

FOLDER/install/local_setup.sh then sets up a shell with it. The Python is one with what is in ros_jazzy_build.txt.
"""

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy

MESSAGES = Path(__file__).resolve().parents[4] / "logs/msg/gridweave_msgs"
# Where the wheels were built, which the files for CMake in them still name.
ELSEWHERE = "/opt/python/cp312-cp312"


def correct_paths(prefix):
    """Puts the folders of this environment in the place of those that are only where the wheels were built."""
    here = {
        f"{ELSEWHERE}/lib/python3.12/site-packages/numpy/_core/include": numpy.get_include(),
        f"{ELSEWHERE}/include/python3.12": sysconfig.get_paths()["include"],
    }
    for file in (prefix / "share").glob("*/cmake/*.cmake"):
        text = file.read_text()
        if ELSEWHERE in text:
            for there, folder in here.items():
                text = text.replace(there, folder)
            file.write_text(text)


def main(folder):
    prefix = Path(sys.prefix)
    correct_paths(prefix)
    environment = {
        **os.environ,
        "PATH": f"{prefix}/bin:{os.environ['PATH']}",
        "AMENT_PREFIX_PATH": str(prefix),
        "CMAKE_PREFIX_PATH": str(prefix),
        "ROS_DISTRO": "jazzy",
        "ROS_VERSION": "2",
        "ROS_PYTHON_VERSION": "3",
    }
    command = [f"{prefix}/bin/colcon", "--log-base", f"{folder}/log", "build", "--base-paths", str(MESSAGES)]
    command += ["--build-base", f"{folder}/build", "--install-base", f"{folder}/install", "--event-handlers", "console_direct+"]
    # Without a build type nothing is optimised, which takes less time.
    options = [f"-DPython3_EXECUTABLE={sys.executable}", "-DBUILD_TESTING=OFF"]
    return subprocess.run([*command, "--cmake-args", *options], env=environment).returncode


sys.exit(main(*sys.argv[1:]))
