//! Definitions of ROS 1 types, from those of ROS 2.
//!
//! A ROS 1 program takes a message only if its type has the same MD5 sum as its own, so types that both versions have
//! get their ROS 1 definition: most differ in nothing but the names of times and headers, the others are in
//! `logs/ros1_msg`.

use crate::dynamic::sections;
use crate::schemas::full_type_name;
use md5::{Digest, Md5};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

const SEPARATOR: &str = "================================================================================";
const HEADER: &str = "std_msgs/Header";
/// The maximum nesting of types.
const DEEPEST: usize = 64;

/// The types whose fields or constants differ in ROS 1.
const DIFFERENT: [(&str, &str); 6] = [
    ("diagnostic_msgs/DiagnosticStatus", include_str!("../../../ros1_msg/diagnostic_msgs/DiagnosticStatus.msg")),
    ("sensor_msgs/CameraInfo", include_str!("../../../ros1_msg/sensor_msgs/CameraInfo.msg")),
    ("sensor_msgs/NavSatStatus", include_str!("../../../ros1_msg/sensor_msgs/NavSatStatus.msg")),
    ("sensor_msgs/Range", include_str!("../../../ros1_msg/sensor_msgs/Range.msg")),
    ("std_msgs/Header", include_str!("../../../ros1_msg/std_msgs/Header.msg")),
    ("visualization_msgs/Marker", include_str!("../../../ros1_msg/visualization_msgs/Marker.msg")),
];

/// A message type of ROS 1.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Ros1Type {
    /// `package/Type`.
    pub(super) name: String,
    /// The definition, with those of all types that it uses.
    pub(super) definition: String,
    /// The MD5 sum by which ROS 1 programs compare types.
    pub(super) md5: String,
    /// The fields of ROS 2 that ROS 1 lacks: the type and the field.
    pub(super) left_out: BTreeSet<(String, String)>,
}

impl Ros1Type {
    /// The ROS 1 type for the schema (`ros2msg`) of a ROS 2 type. `None` if a type is not defined.
    pub(super) fn new(name: &str, schema: &str) -> Option<Self> {
        let mut left_out = BTreeSet::new();
        let mut types: BTreeMap<String, Vec<Line>> = BTreeMap::new();
        for (of, text) in sections(name, schema) {
            let own = lines(&of, &text);
            let lines = match DIFFERENT.iter().find(|(name, _)| *name == of) {
                Some((_, text)) => {
                    let ros1 = lines(&of, text);
                    match missing(&own, &ros1) {
                        _ if of == HEADER => ros1,
                        Some(missing) => {
                            left_out.extend(missing.into_iter().map(|field| (of.clone(), field)));
                            ros1
                        }
                        // Another type of that name.
                        None => own,
                    }
                }
                None => own,
            };
            types.insert(of, lines);
        }
        let name = short_name(name);
        let mut sums = BTreeMap::new();
        let md5 = md5_of(&name, &types, &mut sums, 0)?;
        let mut definition = String::new();
        append(&name, &types, &mut BTreeSet::new(), &mut definition);
        Some(Self { name, definition, md5, left_out })
    }
}

/// A line of a definition.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Line {
    Constant {
        of: String,
        name: String,
        value: String,
    },
    Field {
        /// A built-in type, or `package/Type`.
        of: String,
        /// `[]` or `[N]`, or nothing.
        array: String,
        name: String,
    },
}

/// The lines of the definition of the type `user`, without comments and default values, and with the names of ROS 1.
fn lines(user: &str, text: &str) -> Vec<Line> {
    text.lines().filter_map(|line| line_of(user, line.split('#').next()?.trim())).collect()
}

fn line_of(user: &str, line: &str) -> Option<Line> {
    let (type_text, rest) = line.split_once(char::is_whitespace)?;
    let rest = rest.trim_start();
    let end = rest.find(|c: char| c.is_whitespace() || c == '=').unwrap_or(rest.len());
    let (name, rest) = rest.split_at(end);
    let name = name.to_owned();
    let (element, array) = match type_text.split_once('[') {
        None => (type_text, String::new()),
        Some((element, bounds)) if bounds.starts_with("<=") => (element, "[]".to_owned()),
        Some((element, bounds)) => (element, format!("[{bounds}")),
    };
    let element = element.split("<=").next().unwrap_or(element);
    let of = ros1_name(user, element);
    Some(match rest.trim_start().strip_prefix('=') {
        Some(value) => {
            let value = value.trim().trim_matches(|quote| quote == '"' || quote == '\'').to_owned();
            Line::Constant { of, name, value }
        }
        None => Line::Field { of, array, name },
    })
}

/// The ROS 1 name of a type that the definition of `user` names.
fn ros1_name(user: &str, element: &str) -> String {
    let package = user.split_once('/').map_or("", |(package, _)| package);
    match short_name(element).as_str() {
        "builtin_interfaces/Time" => "time".to_owned(),
        "builtin_interfaces/Duration" => "duration".to_owned(),
        "Header" => HEADER.to_owned(),
        name if is_built_in(name) || name.contains('/') => name.to_owned(),
        name => format!("{package}/{name}"),
    }
}

fn is_built_in(name: &str) -> bool {
    matches!(
        name,
        "bool"
            | "int8"
            | "uint8"
            | "int16"
            | "uint16"
            | "int32"
            | "uint32"
            | "int64"
            | "uint64"
            | "float32"
            | "float64"
            | "string"
            | "time"
            | "duration"
            | "byte"
            | "char"
            // ROS 1 has no such type: the encoder refuses it.
            | "wstring"
    )
}

/// `package/Type`.
fn short_name(name: &str) -> String {
    full_type_name(name).replacen("/msg/", "/", 1)
}

/// The fields of a ROS 2 type that its ROS 1 type lacks. `None` if the others are not the fields of the ROS 1 type, in
/// their order.
fn missing(ros2: &[Line], ros1: &[Line]) -> Option<Vec<String>> {
    let fields = |lines: &'_ [Line]| -> Vec<(String, String, String)> {
        let field = |line: &Line| match line {
            Line::Field { of, array, name } => {
                let of = if ["int8", "uint8", "byte", "char"].contains(&of.as_str()) { "int8" } else { of };
                Some((of.to_owned(), array.clone(), name.clone()))
            }
            Line::Constant { .. } => None,
        };
        lines.iter().filter_map(field).collect()
    };
    let wanted = fields(ros1);
    let mut wanted = wanted.iter().peekable();
    let mut missing = Vec::new();
    for (of, array, name) in fields(ros2) {
        let is_next = |next: &&(String, String, String)| next.2.eq_ignore_ascii_case(&name);
        match wanted.next_if(is_next) {
            Some(next) if (&next.0, &next.1) == (&of, &array) => {}
            Some(_) => return None,
            None => missing.push(name),
        }
    }
    wanted.next().is_none().then_some(missing)
}

/// The MD5 sum of a type: of its constants and then its fields, in which types of messages are replaced by their sums
/// (`compute_md5_text` in `gentools.py` of `genmsg`). `None` if a type is not defined, or contains itself.
fn md5_of(
    name: &str,
    types: &BTreeMap<String, Vec<Line>>,
    sums: &mut BTreeMap<String, String>,
    depth: usize,
) -> Option<String> {
    if let Some(sum) = sums.get(name) {
        return Some(sum.clone());
    }
    let lines = types.get(name).filter(|_| depth < DEEPEST)?;
    let mut text = Vec::new();
    for line in lines {
        if let Line::Constant { of, name, value } = line {
            text.push(format!("{of} {name}={value}"));
        }
    }
    for line in lines {
        if let Line::Field { of, array, name } = line {
            text.push(match is_built_in(of) {
                true => format!("{of}{array} {name}"),
                false => format!("{} {name}", md5_of(of, types, sums, depth + 1)?),
            });
        }
    }
    let digest = Md5::digest(text.join("\n"));
    let sum = digest.iter().fold(String::new(), |mut hex, byte| {
        // Writing to a string cannot fail.
        let _ = write!(hex, "{byte:02x}");
        hex
    });
    sums.insert(name.to_owned(), sum.clone());
    Some(sum)
}

/// Appends the definition of a type and those that it uses, each once, depth first.
fn append(name: &str, types: &BTreeMap<String, Vec<Line>>, done: &mut BTreeSet<String>, text: &mut String) {
    let Some(lines) = types.get(name) else { return };
    if !done.insert(name.to_owned()) {
        return;
    }
    if !text.is_empty() {
        text.push_str(&format!("{SEPARATOR}\nMSG: {name}\n"));
    }
    for line in lines {
        text.push_str(&match line {
            Line::Constant { of, name, value } => format!("{of} {name}={value}\n"),
            // The name under which every ROS 1 parser knows it.
            Line::Field { of, array, name } if of == HEADER => format!("Header{array} {name}\n"),
            Line::Field { of, array, name } => format!("{of}{array} {name}\n"),
        });
    }
    // A definition without lines is not empty either, once another follows.
    if text.is_empty() {
        text.push('\n');
    }
    for line in lines {
        if let Line::Field { of, .. } = line {
            append(of, types, done, text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schemas::{schema_names, schema_text};

    fn of(name: &str) -> Ros1Type {
        Ros1Type::new(name, &schema_text(name).unwrap()).unwrap()
    }

    #[test]
    fn types_that_ros_1_has_get_its_md5_sums() {
        for (name, md5) in [
            ("std_msgs/msg/Header", "2176decaecbce78abc3b96ef049fabed"),
            ("std_msgs/msg/String", "992ce8a1687cec8c8bd883ec73ca41d1"),
            ("std_msgs/msg/Empty", "d41d8cd98f00b204e9800998ecf8427e"),
            ("geometry_msgs/msg/PoseStamped", "d3812c3cbc69362b77dc0b19b345f8f5"),
            ("geometry_msgs/msg/PoseWithCovarianceStamped", "953b798c0f514ff060a53a3498ce6246"),
            ("nav_msgs/msg/OccupancyGrid", "3381f2d731d4076ec5c71b0759edbe4e"),
            ("nav_msgs/msg/Path", "6227e2b7e9cce15051f669a5e197bbf7"),
            ("nav_msgs/msg/Odometry", "cd5e73d190d741a2f92e81eda573aca7"),
            ("map_msgs/msg/OccupancyGridUpdate", "b295be292b335c34718bd939deebe1c9"),
            ("tf2_msgs/msg/TFMessage", "94810edda583a504dfda3829e70d7eec"),
            ("sensor_msgs/msg/LaserScan", "90c7ef2dc6895d81024acba2ac42f369"),
            ("sensor_msgs/msg/Range", "c005c34273dc426c67a020a87bc24148"),
            ("sensor_msgs/msg/CameraInfo", "c9a58c1b0b154e0e6da7578cb991d214"),
            ("sensor_msgs/msg/Image", "060021388200f6f0f447d0fcd9c64743"),
            ("sensor_msgs/msg/Imu", "6a62c6daae103f4ff57a132d6f95cec2"),
            ("sensor_msgs/msg/JointState", "3066dcd76a6cfaef579bd0f34173e9fd"),
            ("sensor_msgs/msg/NavSatFix", "2d3a8cd499b9b4a0249fb98fd05cfa48"),
            ("sensor_msgs/msg/PointCloud2", "1158d486dd51d683ce2f1be655c3c181"),
            ("visualization_msgs/msg/Marker", "4048c9de2a16f4ae8e0538085ebf1b97"),
            ("visualization_msgs/msg/MarkerArray", "d155b9ce5188fbaf89745847fd5882d7"),
        ] {
            assert_eq!(of(name).md5, md5, "{name}");
        }
    }

    #[test]
    fn every_definition_that_is_built_in_can_be_written() {
        for name in schema_names() {
            let made = of(&name);
            let again = Ros1Type::new(&made.name, &made.definition).unwrap();
            assert_eq!(again.md5, made.md5, "{name}: the text has the sum");
            assert!(!made.definition.contains("builtin_interfaces") && !made.definition.contains("/msg/"), "{name}");
        }
    }

    #[test]
    fn fields_that_ros_1_lacks_are_left_out() {
        let marker = of("visualization_msgs/msg/Marker");
        let left_out: Vec<&str> = marker.left_out.iter().map(|(_, field)| field.as_str()).collect();
        assert_eq!(left_out, ["mesh_file", "texture", "texture_resource", "uv_coordinates"]);
        assert!(!marker.definition.contains("texture") && marker.definition.contains("\nHeader header\n"));
        assert!(of("sensor_msgs/msg/CameraInfo").left_out.is_empty(), "its fields are written in another case");
        let other = Ros1Type::new("sensor_msgs/msg/Range", "string range").unwrap();
        assert_eq!(other.definition, "string range\n", "a type of that name which is another");
    }

    #[test]
    fn bounds_defaults_and_quotes_are_left_out() {
        let text = "string<=5 a \"x\"\nint32[<=3] b [1, 2]\nstring C=\"d e\"\nuint8 F = 2 # f\nfloat64 g 1.5\nPart[2] parts\n\
                    ================================================================================\nMSG: p/Part\n\
                    builtin_interfaces/msg/Duration[] d\n";
        let made = Ros1Type::new("p/msg/All", text).unwrap();
        let expected = format!(
            "string a\nint32[] b\nstring C=d e\nuint8 F=2\nfloat64 g\np/Part[2] parts\n{SEPARATOR}\nMSG: p/Part\nduration[] d\n"
        );
        assert_eq!((made.name.as_str(), made.definition), ("p/All", expected));
        assert_eq!(Ros1Type::new("p/msg/All", "Part part"), None, "it is not defined");
        assert_eq!(Ros1Type::new("p/msg/All", "All[] all"), None, "it contains itself");
    }
}
