//! The command `gridweave` with the stages that speak to ROS 2.

fn main() -> std::process::ExitCode {
    gridweave::command_with(gridweave_ros::kinds(), gridweave_ros::bridge::hear)
}
