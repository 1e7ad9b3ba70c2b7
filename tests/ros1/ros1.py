"""A master of ROS 1 on a free port of the loopback device, a folder, and programs that all end with the test.

Nothing of ROS that runs already is used or changed. The interpreter must be that of the system, which has the modules of ROS.
"""

import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import xmlrpc.client
from pathlib import Path

gridweave = str(Path(sys.argv[1]).resolve())
folder = Path(tempfile.mkdtemp(prefix="gridweave-ros1-"))
programs = []
failed = 0

with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
os.environ.update(ROS_MASTER_URI=f"http://127.0.0.1:{port}", ROS_IP="127.0.0.1", ROS_HOME=str(folder / "home"),
                  ROS_LOG_DIR=str(folder / "log"), PYTHONUNBUFFERED="1")
os.environ.pop("ROS_HOSTNAME", None)
master = xmlrpc.client.ServerProxy(os.environ["ROS_MASTER_URI"])

import rospy  # it reads the environment
from std_srvs.srv import SetBool


def check(what, holds, found=""):
    global failed
    failed += not holds
    print(f"{'ok     ' if holds else 'FAILED '}{what}{'' if holds else f': {found}'}", flush=True)


def run(*command, status=0, seconds=60):
    ended = subprocess.run([str(word) for word in command], cwd=folder, capture_output=True, text=True, timeout=seconds)
    if ended.returncode != status:
        raise RuntimeError(f"{' '.join(map(str, command))} ended with {ended.returncode}: {ended.stdout}{ended.stderr}")
    return ended.stdout


def start(*command, log):
    """Starts a program in a session of its own, so that it can be ended with its children."""
    with open(folder / log, "w") as output:
        program = subprocess.Popen([str(word) for word in command], cwd=folder, stdin=subprocess.DEVNULL, stdout=output,
                                   stderr=subprocess.STDOUT, start_new_session=True)
    programs.append(program)
    return program


def end(program, how=signal.SIGINT):
    try:
        os.killpg(program.pid, how)
    except ProcessLookupError:
        pass
    return program.wait(timeout=30)


def until(what, holds, seconds=30):
    """ROS has no means to wait for its connections: they are asked for."""
    last = time.monotonic() + seconds
    while True:
        try:
            if holds():
                return
        except (OSError, xmlrpc.client.Error):
            pass
        if time.monotonic() > last:
            raise RuntimeError(f"{what}: not within {seconds} s")
        time.sleep(0.05)


class Player:
    """`rosbag play`, held until all who listen are connected (not with --immediate, which does not wait)."""

    def __init__(self, bag, *options, name):
        self.name = name
        self.program = start("rosbag", "play", bag, "--pause", "--queue", 100000, *options, f"__name:={name}", log=f"{name}.log")

    def connected(self, number):
        """Waits until the player has so many connections."""
        def has():
            _, _, address = master.lookupNode("/test", f"/{self.name}")
            _, _, connections = xmlrpc.client.ServerProxy(address).getBusInfo("/test")
            return sum(1 for one in connections if one[2] == "o" and one[4] not in ("/rosout", "/clock") and one[5]) >= number
        until(f"{number} connections of {self.name}", has)

    def go(self):
        """Starts it."""
        rospy.wait_for_service(f"/{self.name}/pause_playback", timeout=20)
        rospy.ServiceProxy(f"/{self.name}/pause_playback", SetBool)(False)
        return self.program


def whole(test, watchdog):
    """Does a test with a master, ends all programs, and exits."""
    def stop(number, _):
        raise TimeoutError(f"not done within {watchdog} s" if number == signal.SIGALRM else "stopped")

    for number in (signal.SIGALRM, signal.SIGTERM, signal.SIGINT):
        signal.signal(number, stop)
    signal.alarm(watchdog)
    try:
        start("roscore", "-p", port, log="roscore.log")
        until("a master", lambda: master.lookupNode("/test", "/rosout")[0] == 1)
        rospy.init_node("test", disable_signals=True)
        test()
    except Exception as error:  # whatever it is, all programs are ended
        check("the test comes to its end", False, error)
    finally:
        signal.alarm(0)
        for program in reversed(programs):
            if program.poll() is None:
                end(program, signal.SIGTERM if program.args[0] == "roscore" else signal.SIGKILL)
        shutil.rmtree(folder, ignore_errors=True)
    print("all is well" if not failed else f"{failed} failed", flush=True)
    # The threads of rospy do not end by themselves without a master.
    os._exit(1 if failed else 0)
