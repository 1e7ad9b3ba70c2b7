//! The command `gridweave` with the stages for ROS 2.

use gridweave_runtime::terminal_text::escape;
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    // What is not text is no argument of ROS.
    let arguments: Vec<String> =
        std::env::args_os().skip(1).filter_map(|argument| argument.into_string().ok()).collect();
    if let Some(advice) = gridweave_ros::ros_arguments::advice(&arguments) {
        // There is no other place to report to.
        let _ = writeln!(std::io::stderr(), "error: {}", escape(&advice));
        return ExitCode::from(2);
    }
    gridweave::shipped::ship(gridweave_ros::PIPELINES);
    gridweave::command_with(gridweave_ros::kinds(), &[gridweave_ros::doctor()], gridweave_bridge::on_log_warning)
}
