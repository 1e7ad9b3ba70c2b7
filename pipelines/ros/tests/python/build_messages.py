"""Builds the package gridweave_msgs as a user of ROS does, by colcon, with the packages that are in the environment of this Python;
and of map_msgs and tf2_msgs, which no wheel has, the types that are published.

    python build_messages.py FOLDER

FOLDER/install/local_setup.sh then sets up a shell with it. The Python is one with what is in ros_jazzy_build.txt.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy

MESSAGES = Path(__file__).resolve().parents[4] / "logs/msg"
# Packages of which the definitions alone are here, with the one that each needs.
OTHERS = {"map_msgs": "std_msgs", "tf2_msgs": "geometry_msgs"}
PACKAGE = """<package format="3"><name>{name}</name><version>0.0.0</version><description>{name}</description>
<maintainer email="maintainers@example.org">Nobody</maintainer><license>BSD</license>
<buildtool_depend>ament_cmake</buildtool_depend><depend>{needed}</depend>
<member_of_group>rosidl_interface_packages</member_of_group><export><build_type>ament_cmake</build_type></export></package>
"""
CMAKE = """cmake_minimum_required(VERSION 3.10)
project({name})
find_package(ament_cmake REQUIRED)
find_package({needed} REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(${{PROJECT_NAME}} {files} DEPENDENCIES {needed})
ament_package()
"""
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


def write_others(folder):
    """Makes packages of the definitions, and gives their folders."""
    for name, needed in OTHERS.items():
        package = Path(folder) / "others" / name
        shutil.copytree(MESSAGES / name, package / "msg")
        files = " ".join(f"msg/{file.name}" for file in sorted((package / "msg").iterdir()))
        (package / "package.xml").write_text(PACKAGE.format(name=name, needed=needed))
        (package / "CMakeLists.txt").write_text(CMAKE.format(name=name, needed=needed, files=files))
        yield str(package)


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
    command = [f"{prefix}/bin/colcon", "--log-base", f"{folder}/log", "build"]
    command += ["--base-paths", str(MESSAGES / "gridweave_msgs"), *write_others(folder)]
    command += ["--build-base", f"{folder}/build", "--install-base", f"{folder}/install", "--merge-install"]
    command += ["--event-handlers", "console_direct+"]
    # Without a build type nothing is optimised, which takes less time.
    options = [f"-DPython3_EXECUTABLE={sys.executable}", "-DBUILD_TESTING=OFF"]
    return subprocess.run([*command, "--cmake-args", *options], env=environment).returncode


sys.exit(main(*sys.argv[1:]))
