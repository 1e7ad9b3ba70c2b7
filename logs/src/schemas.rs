//! The definitions of the ROS 2 types that Gridweave writes, and of common types that older bags contain without a
//! definition, from the `.msg` files in `logs/msg`.
//!
//! They are embedded, not taken from a library or a ROS installation: logs must be self-contained on machines without
//! ROS, and bags up to Humble contain no definitions.

use std::borrow::Cow;

/// The separator between the definitions of a schema.
const SEPARATOR: &str = "================================================================================";

macro_rules! definitions {
    ($($before:literal,)* gridweave_msgs: [$($ours:literal,)*], $($after:literal,)*) => {
        /// Name (`package/Type`) and text of each definition, sorted by name.
        const DEFINITIONS: &[(&str, &str)] = &[
            $(($before, include_str!(concat!("../msg/", $before, ".msg"))),)*
            // A ROS package, with a subfolder for messages.
            $((concat!("gridweave_msgs/", $ours), include_str!(concat!("../msg/gridweave_msgs/msg/", $ours, ".msg"))),)*
            $(($after, include_str!(concat!("../msg/", $after, ".msg"))),)*
        ];
    };
}

definitions![
    "builtin_interfaces/Duration",
    "builtin_interfaces/Time",
    "geometry_msgs/Accel",
    "geometry_msgs/AccelStamped",
    "geometry_msgs/Point",
    "geometry_msgs/Point32",
    "geometry_msgs/PointStamped",
    "geometry_msgs/Polygon",
    "geometry_msgs/PolygonStamped",
    "geometry_msgs/Pose",
    "geometry_msgs/PoseArray",
    "geometry_msgs/PoseStamped",
    "geometry_msgs/PoseWithCovariance",
    "geometry_msgs/PoseWithCovarianceStamped",
    "geometry_msgs/Quaternion",
    "geometry_msgs/QuaternionStamped",
    "geometry_msgs/Transform",
    "geometry_msgs/TransformStamped",
    "geometry_msgs/Twist",
    "geometry_msgs/TwistStamped",
    "geometry_msgs/TwistWithCovariance",
    "geometry_msgs/TwistWithCovarianceStamped",
    "geometry_msgs/Vector3",
    "geometry_msgs/Vector3Stamped",
    "geometry_msgs/Wrench",
    "geometry_msgs/WrenchStamped",
    gridweave_msgs: [
        "Alignment",
        "CommonPlace",
        "CommonTag",
        "CommonTags",
        "DeformationNode",
        "Evidence",
        "IcpErrors",
        "MachineStages",
        "MapAgreement",
        "MapDeformation",
        "MapDirection",
        "RangeScan",
        "RobotFrame",
        "RobotFrames",
        "RobotGroup",
        "Segment",
        "Segments",
        "Sharpness",
        "SimulationTruth",
        "StageProgress",
        "TagBearing",
        "TagEstimate",
        "TagEstimates",
        "TagPosition",
        "TagRange",
        "TopologicalMap",
        "TopologicalNode",
        "TopologicalPath",
        "TrueFrame",
        "TrueTag",
        "UnmergedRobot",
        "Verdict",
        "Verdicts",
    ],
    "map_msgs/OccupancyGridUpdate",
    "nav_msgs/GridCells",
    "nav_msgs/MapMetaData",
    "nav_msgs/OccupancyGrid",
    "nav_msgs/Odometry",
    "nav_msgs/Path",
    "rosgraph_msgs/Clock",
    "sensor_msgs/CameraInfo",
    "sensor_msgs/CompressedImage",
    "sensor_msgs/Image",
    "sensor_msgs/Imu",
    "sensor_msgs/JointState",
    "sensor_msgs/LaserEcho",
    "sensor_msgs/LaserScan",
    "sensor_msgs/MagneticField",
    "sensor_msgs/MultiEchoLaserScan",
    "sensor_msgs/NavSatFix",
    "sensor_msgs/NavSatStatus",
    "sensor_msgs/PointCloud2",
    "sensor_msgs/PointField",
    "sensor_msgs/Range",
    "sensor_msgs/RegionOfInterest",
    "std_msgs/Bool",
    "std_msgs/ColorRGBA",
    "std_msgs/Empty",
    "std_msgs/Float32",
    "std_msgs/Float64",
    "std_msgs/Header",
    "std_msgs/Int32",
    "std_msgs/String",
    "tf2_msgs/TFMessage",
    "visualization_msgs/Marker",
    "visualization_msgs/MarkerArray",
    "visualization_msgs/MeshFile",
    "visualization_msgs/UVCoordinate",
];

/// The definitions alone, without those of the types that they use, by the name of the type: `package/msg/Type`.
pub fn message_texts() -> impl Iterator<Item = (String, &'static str)> {
    DEFINITIONS.iter().map(|(name, text)| (name.replacen('/', "/msg/", 1), *text))
}

/// The schema of a ROS 2 type as stored in a log (encoding `ros2msg`): the definition of the type, followed by that of
/// each type that it uses, each once, after a line of 80 `=` and a line `MSG: package/Type`.
///
/// `name` is `package/msg/Type` or `package/Type`. `None` for other types.
pub fn schema_text(name: &str) -> Option<String> {
    let name = name.replacen("/msg/", "/", 1);
    let mut text = definition(&name)?.to_owned();
    let mut used = vec![name.as_str()];
    append_used_types(definition(&name)?, &mut used, &mut text);
    Some(text)
}

/// The type name with `/msg/`, which some old logs omit.
pub fn full_type_name(name: &str) -> Cow<'_, str> {
    match name.split_once('/') {
        Some((package, message)) if !message.contains('/') => Cow::Owned(format!("{package}/msg/{message}")),
        _ => Cow::Borrowed(name),
    }
}

/// The full names (`package/msg/Type`) of all types of [`schema_text`], sorted by name.
pub fn schema_names() -> impl Iterator<Item = String> {
    message_texts().map(|(name, _)| name)
}

fn definition(name: &str) -> Option<&'static str> {
    DEFINITIONS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Appends the definitions of all types that `text` uses and that are not in `used`, depth first.
fn append_used_types<'a>(text: &'a str, used: &mut Vec<&'a str>, schema: &mut String) {
    let types = text.lines().filter_map(|line| line.split('#').next()?.split_whitespace().next());
    for field_type in types {
        let name = field_type.split('[').next().unwrap_or(field_type);
        if used.contains(&name) {
            continue;
        }
        if let Some(used_text) = definition(name) {
            used.push(name);
            schema.push_str(&format!("{SEPARATOR}\nMSG: {name}\n{used_text}"));
            append_used_types(used_text, used, schema);
        }
    }
}

#[cfg(test)]
mod tests;

#[cfg(test)]
mod ros_package;
