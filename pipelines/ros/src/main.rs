//! The command `gridweave` with the stages for ROS 2.

fn main() -> std::process::ExitCode {
    gridweave::command_with(gridweave_ros::kinds(), &[gridweave_ros::doctor()], gridweave_bridge::on_log_warning)
}
