"""Two robots with slam_toolbox, each in a namespace of its own, and Gridweave, which merges their maps onto /map.

    ros2 launch two_robots.launch.py

The robots' drivers publish /robot1/scan and /robot2/scan, and on /robot1/tf and /robot2/tf where base_footprint is in odom. Nothing is
said of where the robots start: Gridweave finds that out, and publishes world -> robot1/map and world -> robot2/map on /tf_static.

slam_toolbox names its topics from the root on, /map and /scan, whatever its namespace is: so they are remapped to names within it.
A file of parameters, slam_params_file:=FILE, begins with `/**:`, as one with `slam_toolbox:` is for a node in no namespace.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import PushRosNamespace, SetRemap
from launch_ros.substitutions import FindPackageShare

OF_A_ROBOT = ["map", "map_metadata", "scan", "tf", "tf_static"]


def slam(robot):
    file = PathJoinSubstitution([FindPackageShare("slam_toolbox"), "launch", "online_async_launch.py"])
    arguments = {"use_sim_time": LaunchConfiguration("use_sim_time")}
    node = IncludeLaunchDescription(PythonLaunchDescriptionSource(file), launch_arguments=arguments.items())
    remaps = [SetRemap("/" + topic, topic) for topic in OF_A_ROBOT]
    return GroupAction([PushRosNamespace(robot), *remaps, node])


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument("pipeline", default_value="live_ros"),
            DeclareLaunchArgument("use_sim_time", default_value="false"),
            slam("robot1"),
            slam("robot2"),
            # An interrupt of the launch ends it, and it prints what was found.
            ExecuteProcess(cmd=["gridweave-ros", "run", LaunchConfiguration("pipeline")], output="screen"),
        ]
    )
