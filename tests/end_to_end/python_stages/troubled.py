"""A stage that gets into trouble when it is told to."""

import os
import signal

from gridweave import Input, Output, Parameter, Stage
from gridweave.msg.geometry_msgs import PoseStamped, PoseWithCovarianceStamped
from gridweave.msg.nav_msgs import OccupancyGrid


class Troubled(Stage):
    """Says with each map how many poses had come before it."""

    pose = Input(PoseWithCovarianceStamped, "the robots' poses")
    map = Input(OccupancyGrid, "the robots' maps")
    seen = Output(PoseStamped, "how many poses and maps have come, as a position")
    what = Parameter("nothing", "what it does", choices=("nothing", "raise", "exit", "kill", "segfault", "hang", "eat"))
    at = Parameter(3, "with which map", minimum=1)

    def __init__(self):
        self.poses = self.maps = 0

    def on_pose(self, pose, about):
        self.poses += 1

    def on_map(self, map, about):
        self.maps += 1
        if self.maps == self.at:
            getattr(self, f"do_{self.what}")()
        seen = PoseStamped(map.header)
        seen.pose.position.x, seen.pose.position.y = float(self.poses), float(self.maps)
        self.seen.send(seen, about.robot)

    def finish(self):
        self.seen.send(PoseStamped())

    def do_nothing(self):
        pass

    def do_raise(self):
        raise ValueError("it was told so")

    def do_exit(self):
        os._exit(7)

    def do_kill(self):
        os.kill(os.getpid(), signal.SIGKILL)

    def do_segfault(self):
        os.kill(os.getpid(), signal.SIGSEGV)

    def do_eat(self):
        eaten = [bytes([1]) * (64 << 20) for _ in range(16)]
        self.do_hang()
        del eaten

    def do_hang(self):
        while True:
            pass
