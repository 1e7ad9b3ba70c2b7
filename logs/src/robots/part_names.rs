//! Names of the parts of a robot, which are no names of robots.

/// Words that say where on a robot a sensor is.
pub(crate) const PLACES: [&str; 8] = ["front", "rear", "back", "left", "right", "top", "upper", "lower"];
/// Words for sensors.
const SENSORS: [&str; 16] = [
    "cam",
    "camera",
    "depth",
    "stereo",
    "rgbd",
    "realsense",
    "kinect",
    "zed",
    "oak",
    "sensor",
    "lidar",
    "laser",
    "velodyne",
    "ouster",
    "livox",
    "hesai",
];

/// Whether a name is that of a sensor, as in `/front_camera/points`, and not of a robot.
pub(crate) fn is_sensor(name: &str) -> bool {
    has_word_of(name, &SENSORS)
}

/// Whether a name is that of a sensor or of its place on a robot.
pub(crate) fn is_part(name: &str) -> bool {
    is_sensor(name) || has_word_of(name, &PLACES)
}

fn has_word_of(name: &str, words: &[&str]) -> bool {
    name.to_lowercase().split(|letter: char| !letter.is_alphabetic()).any(|word| words.contains(&word))
}
