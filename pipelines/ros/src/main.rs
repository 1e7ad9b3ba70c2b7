//! The command `gridweave` with the stages that speak to ROS 2.

fn main() -> std::process::ExitCode {
    gridweave::command(gridweave_ros::kinds())
}
