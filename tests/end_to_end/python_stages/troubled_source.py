"""A source that gets into trouble when it is told to."""

import os
import signal

from gridweave import Output, Parameter, Stage
from gridweave.msg.geometry_msgs import PoseStamped


class TroubledSource(Stage):
    """Sends poses."""

    pose = Output(PoseStamped, "no pose in particular")
    what = Parameter("nothing", "what it does", choices=("nothing", "raise", "fall", "exit", "kill", "hang"))
    at = Parameter(40, "with which pose", minimum=1)
    count = Parameter(80, "how many it sends", minimum=1)
    start = Parameter(0, "when it begins, seconds")

    def messages(self):
        for number in range(self.count):
            if number == self.at:
                getattr(self, f"do_{self.what}")()
            self.send(number)
            yield

    def send(self, number):
        self.pose.send(PoseStamped(), "robot1", log_time=self.start * 1_000_000_000 + number * 100_000_000)

    def abort(self, reason):
        print(f"the source was told: {reason}")

    def do_nothing(self):
        pass

    def do_raise(self):
        raise ValueError("it was told so")

    def do_fall(self):
        self.send(3)

    def do_exit(self):
        os._exit(7)

    def do_kill(self):
        os.kill(os.getpid(), signal.SIGKILL)

    def do_hang(self):
        while True:
            pass
