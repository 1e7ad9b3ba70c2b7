//! Tag readings from messages of any type, decoded by the definition in the log.

use crate::dynamic::{FieldPath, Scalar, Schema, Value};
use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::Time;
use gridweave_runtime::stage::{PathLoss, TagFields};
use nalgebra::Point3;

#[cfg(test)]
mod tests;

/// Reads the tags in the messages of one channel.
#[derive(Debug)]
pub(crate) struct TagReader {
    schema: Schema,
    each: Option<FieldPath>,
    /// Parts of the tag id, which are joined by colons.
    id: Vec<FieldPath>,
    distance: Option<Distance>,
    stddev: Option<FieldPath>,
    /// Standard deviation if no field contains it, metres.
    usual_stddev: f64,
    /// Variance of the range, which some versions of a type have; 0 if unknown.
    variance: Option<FieldPath>,
    /// Metres per unit of the range.
    unit: f64,
    bearing: Option<Bearing>,
    pose: Option<FieldPath>,
}

/// The field with the bearing of a tag.
#[derive(Debug)]
struct Bearing {
    path: FieldPath,
    /// Radians per unit, counterclockwise.
    unit: f64,
    stddev: Option<FieldPath>,
    /// Standard deviation if no field contains it, radians.
    usual_stddev: f64,
}

/// The field with the distance to a tag.
#[derive(Debug)]
enum Distance {
    Range(FieldPath),
    Strength(FieldPath, PathLoss),
}

/// The readings in one message.
#[derive(Debug, PartialEq)]
pub(crate) struct TagMessage {
    pub(crate) stamp: Time,
    /// The frame of positions and bearings.
    pub(crate) frame_id: String,
    pub(crate) readings: Vec<LoggedReading>,
}

/// One tag reading.
#[derive(Debug, PartialEq)]
pub(crate) struct LoggedReading {
    pub(crate) tag_id: String,
    pub(crate) measurement: Measurement,
}

/// A measurement of a tag.
#[derive(Debug, PartialEq)]
pub(crate) enum Measurement {
    /// Distance, metres, with its standard deviation (0 if unknown) and the signal strength, dBm.
    Range { range: f64, stddev: f64, rssi: f32 },
    /// Bearing, radians about the z axis of the message's frame, counterclockwise from its x axis, with its standard
    /// deviation (0 if unknown).
    Bearing { bearing: f64, stddev: f64 },
    /// Position in the message's frame, metres.
    Position(Point3<f64>),
}

/// The fields of well-known message types: a sonar or radio range, identified by its frame, and the detections of
/// visual tag detectors that estimate poses.
pub(crate) fn known_fields(type_name: &str) -> Option<TagFields> {
    let some = |text: &str| Some(text.to_owned());
    Some(match type_name {
        "sensor_msgs/msg/Range" => {
            TagFields { id_field: "header.frame_id".into(), range_field: some("range"), ..Default::default() }
        }
        "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray" => TagFields {
            each: some("detections"),
            id_field: "family:id".into(),
            pose_field: some("pose.pose.pose"),
            ..Default::default()
        },
        "aruco_opencv_msgs/msg/ArucoDetection" => TagFields {
            each: some("markers"),
            id_field: "marker_id".into(),
            pose_field: some("pose"),
            ..Default::default()
        },
        _ => return None,
    })
}

/// Whether a type holds detections whose poses are published in tf.
pub(crate) fn has_poses_in_tf(type_name: &str) -> bool {
    type_name == "apriltag_msgs/msg/AprilTagDetectionArray"
}

/// The id of a visual tag from the name of its tf frame: `tag36h11:5` for `robot1/tag36h11:5`.
pub(crate) fn tag_of_frame(frame: &str) -> Option<&str> {
    let id = frame.rsplit('/').next()?;
    let (family, number) = id.split_once(':')?;
    let is_tag = !family.is_empty() && !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
    is_tag.then_some(id)
}

impl TagReader {
    /// Creates a reader for the messages of `channel` with the given fields.
    ///
    /// # Errors
    /// The type has no known definition, a path is invalid, or no field contains a distance, bearing or position.
    pub(crate) fn new(channel: &Channel, fields: &TagFields) -> Result<Self, String> {
        let type_name = full_type_name(&channel.schema_name);
        let schema = Schema::of_channel(channel).map_err(|error| format!("{type_name}: {error}"))?;
        let path = |text: &str| text.parse::<FieldPath>().map_err(|error| error.to_string());
        let maybe = |text: &Option<String>| text.as_deref().map(path).transpose();
        let strength = maybe(&fields.rssi_field)?;
        let distance = match (maybe(&fields.range_field)?, strength, fields.path_loss) {
            (Some(range), ..) => Some(Distance::Range(range)),
            (None, Some(strength), Some(model)) => Some(Distance::Strength(strength, model)),
            _ => None,
        };
        let bearing = match maybe(&fields.bearing_field)? {
            Some(path) => Some(Bearing {
                path,
                unit: fields.bearing_unit.unwrap_or(1.0),
                stddev: maybe(&fields.bearing_stddev_field)?,
                usual_stddev: fields.bearing_stddev.unwrap_or(0.0),
            }),
            None => None,
        };
        let pose = maybe(&fields.pose_field)?;
        if distance.is_none() && bearing.is_none() && pose.is_none() {
            return Err("no field with the range, bearing or pose of a tag is set".to_owned());
        }
        Ok(Self {
            schema,
            each: maybe(&fields.each)?,
            id: fields.id_field.split(':').map(path).collect::<Result<_, _>>()?,
            distance,
            stddev: maybe(&fields.stddev_field)?,
            usual_stddev: fields.stddev.unwrap_or(0.0),
            // Since ROS 2 Iron.
            variance: (type_name == "sensor_msgs/msg/Range").then(|| path("variance")).transpose()?,
            unit: fields.range_unit.unwrap_or(1.0),
            bearing,
            pose,
        })
    }

    /// Reads the tags in a message of `robot`.
    ///
    /// # Errors
    /// The message does not match its type, or lacks a field.
    pub(crate) fn read(&self, robot: &str, message: &[u8]) -> Result<TagMessage, String> {
        let message = self.schema.decode(message).map_err(|error| error.to_string())?;
        let header = message.field("header");
        let stamp = header.and_then(|header| header.field("stamp"));
        let part = |name: &str| number(stamp?.field(name)?);
        let stamp = Time {
            sec: part("sec").map_or(0, |sec| sec as i32),
            nanosec: part("nanosec").map_or(0, |nanosec| nanosec as u32),
        };
        let frame_id = match header.and_then(|header| header.field("frame_id")) {
            Some(Value::Scalar(Scalar::Text(frame))) => (*frame).to_owned(),
            _ => String::new(),
        };
        let mut readings = Vec::new();
        match &self.each {
            None => self.add_readings(robot, &message, &mut readings)?,
            Some(each) => match message.find(each).map_err(|error| error.to_string())? {
                Value::Array(array) => {
                    for element in (0..array.len()).filter_map(|at| array.element(at)) {
                        self.add_readings(robot, &element, &mut readings)?;
                    }
                }
                _ => return Err(format!("`{each}` is not an array")),
            },
        }
        Ok(TagMessage { stamp, frame_id, readings })
    }

    /// Adds the readings in a message or array element: range and bearing, or else position.
    fn add_readings(&self, robot: &str, of: &Value<'_>, readings: &mut Vec<LoggedReading>) -> Result<(), String> {
        let find = |path: &FieldPath| of.find(path).map_err(|error| error.to_string());
        let a_number = |path: &FieldPath| number(&find(path)?).ok_or_else(|| format!("`{path}` is not a number"));
        let mut id = Vec::new();
        for path in &self.id {
            id.push(match find(path)? {
                // A tag has the same id in the frames of all robots.
                Value::Scalar(Scalar::Text(text)) => without_robot(robot, text).to_owned(),
                Value::Scalar(whole @ (Scalar::Int(_) | Scalar::Uint(_))) => whole.to_string(),
                _ => return Err(format!("`{path}` is neither a string nor an integer")),
            });
        }
        let tag_id = id.join(":");
        let mut add = |measurement| readings.push(LoggedReading { tag_id: tag_id.clone(), measurement });
        if let Some(distance) = &self.distance {
            let stddev = self.stddev.as_ref().map(a_number).transpose()?;
            let variance = || number(&of.find(self.variance.as_ref()?).ok()?).filter(|variance| *variance > 0.0);
            let stated = stddev.map(|stddev| stddev * self.unit).or_else(|| Some(variance()?.sqrt() * self.unit));
            let stddev = stated.unwrap_or(self.usual_stddev);
            add(match distance {
                Distance::Range(path) => Measurement::Range { range: a_number(path)? * self.unit, stddev, rssi: 0.0 },
                Distance::Strength(path, model) => {
                    let rssi = a_number(path)?;
                    let (range, by_model) = model.distance(rssi);
                    let stddev = if stddev > 0.0 { stddev } else { by_model };
                    Measurement::Range { range, stddev, rssi: rssi as f32 }
                }
            });
        }
        if let Some(Bearing { path, unit, stddev, usual_stddev }) = &self.bearing {
            let stddev = stddev.as_ref().map(a_number).transpose()?;
            let stddev = stddev.map_or(*usual_stddev, |stddev| (stddev * unit).abs());
            add(Measurement::Bearing { bearing: a_number(path)? * unit, stddev });
        }
        if let Some(path) = self.pose.as_ref().filter(|_| self.distance.is_none() && self.bearing.is_none()) {
            let pose = find(path)?;
            let point = pose.field("position").unwrap_or(&pose);
            let axis = |name: &str| number(point.field(name)?);
            let place = || Some(Point3::new(axis("x")?, axis("y")?, axis("z")?));
            add(Measurement::Position(place().ok_or_else(|| format!("`{path}` is neither a pose nor a point"))?));
        }
        Ok(())
    }
}

fn number(value: &Value<'_>) -> Option<f64> {
    match value {
        Value::Scalar(scalar) => scalar.as_f64(),
        _ => None,
    }
}

/// A frame name without the robot's name.
fn without_robot<'a>(robot: &str, frame: &'a str) -> &'a str {
    frame.strip_prefix(robot).and_then(|rest| rest.strip_prefix('/')).filter(|rest| !rest.is_empty()).unwrap_or(frame)
}
