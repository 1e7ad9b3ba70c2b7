"""Two robots with slam_toolbox, each in a namespace of its own, and Gridweave, which merges their maps onto /map.

    ros2 launch two_robots.launch.py pipeline:=live_ros.toml

The robots' drivers publish /robot1/scan and /robot2/scan, and on /robot1/tf and /robot2/tf where base_footprint is in odom. Nothing is
said of where the robots start: Gridweave finds that out, and publishes world -> robot1/map and world -> robot2/map on /tf_static.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare


def slam(robot):
    file = PathJoinSubstitution([FindPackageShare("slam_toolbox"), "launch", "online_async_launch.py"])
    return IncludeLaunchDescription(PythonLaunchDescriptionSource(file), launch_arguments={"namespace": robot}.items())


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument("pipeline", default_value="live_ros.toml"),
            slam("robot1"),
            slam("robot2"),
            # An interrupt of the launch ends it, and it prints what was found.
            ExecuteProcess(cmd=["gridweave-ros", "run", LaunchConfiguration("pipeline")], output="screen"),
        ]
    )
