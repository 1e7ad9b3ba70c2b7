//! Conversion of ROS 1 message definitions to ROS 2.

use crate::schemas::schema_text;

const SEPARATOR: &str = "================================================================================";

/// The ROS 2 name of a ROS 1 type.
pub(super) fn type_name(name: &str) -> String {
    match name.split_once('/') {
        Some(("tf", "tfMessage")) => "tf2_msgs/msg/TFMessage".to_owned(),
        Some((package, message)) if !message.contains('/') => format!("{package}/msg/{message}"),
        _ => name.to_owned(),
    }
}

/// The definition text with ROS 2 type names. The field `seq` of headers is removed.
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
            // The definition of the header is appended, with those of times.
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

/// A line of a definition with the ROS 2 name of its field's type.
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
