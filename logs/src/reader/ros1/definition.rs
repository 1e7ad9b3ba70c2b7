//! Definitions of ROS 1 as those of ROS 2.

use crate::schemas::schema_text;

const SEPARATOR: &str = "================================================================================";

/// The name that a type of ROS 1 has in ROS 2.
pub(super) fn type_name(name: &str) -> String {
    match name.split_once('/') {
        Some(("tf", "tfMessage")) => "tf2_msgs/msg/TFMessage".to_owned(),
        Some((package, message)) => format!("{package}/msg/{message}"),
        None => name.to_owned(),
    }
}

/// The text of a definition with the names that types have in ROS 2. Headers lose their `seq`.
pub(super) fn translate(text: &str) -> String {
    let mut translated = String::new();
    let mut is_header = false;
    let mut starts = false;
    for line in text.lines() {
        if line.len() >= 3 && line.trim().bytes().all(|byte| byte == b'=') && !line.trim().is_empty() {
            starts = true;
            is_header = false;
        } else if let Some(name) = line.trim().strip_prefix("MSG:").filter(|_| starts) {
            starts = false;
            // Its definition is appended, with those of times.
            is_header = name.trim() == "std_msgs/Header";
            if !is_header {
                translated.push_str(&format!("{SEPARATOR}\nMSG: {}\n", name.trim()));
            }
        } else if !is_header {
            translated.push_str(&line_of(line));
            translated.push('\n');
        }
    }
    for name in ["std_msgs/Header", "builtin_interfaces/Time", "builtin_interfaces/Duration"] {
        let own = schema_text(name).unwrap_or_default();
        let own = own.split(SEPARATOR).next().unwrap_or_default();
        translated.push_str(&format!("{SEPARATOR}\nMSG: {name}\n{own}"));
    }
    translated
}

/// A line with the type of its field as it is called in ROS 2.
fn line_of(line: &str) -> String {
    let text = line.trim_start();
    let end = text.find(|char: char| char.is_whitespace() || char == '[').unwrap_or(text.len());
    let (name, rest) = text.split_at(end);
    let called = match name {
        "time" => "builtin_interfaces/Time",
        "duration" => "builtin_interfaces/Duration",
        "Header" => "std_msgs/Header",
        "byte" => "int8",
        "char" => "uint8",
        other => other,
    };
    format!("{called}{rest}")
}
