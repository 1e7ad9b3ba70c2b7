"""A robot that drives in a circle: `kind = "python"`, `module = "circle.py"`, and no inputs."""

from math import cos, pi, sin

from gridweave import Output, Parameter, Stage
from gridweave.msg.geometry_msgs import PoseStamped


class Circle(Stage):
    """Sends the poses of a robot that drives in a circle of 1 m."""

    pose = Output(PoseStamped, "where the robot is in its map", topic="/{robot}/pose")
    robot = Parameter("robot1", "its name")
    seconds = Parameter(60, "for how long it drives", minimum=1)

    def messages(self):
        for tick in range(10 * self.seconds):
            pose = PoseStamped()
            pose.header.frame_id = f"{self.robot}/map"
            pose.header.stamp.sec, pose.header.stamp.nanosec = tick // 10, tick % 10 * 100_000_000
            angle = 2 * pi * tick / 100
            pose.pose.position.x, pose.pose.position.y = cos(angle), sin(angle)
            self.pose.send(pose, self.robot, log_time=tick * 100_000_000)
            yield
