//! Readings of tags in messages of any type, found by the definition that their log holds.

use crate::dynamic::{FieldPath, Scalar, Schema, Value};
use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::Time;
use gridweave_runtime::stage::{PathLoss, TagFields};
use nalgebra::Point3;

#[cfg(test)]
mod tests;

/// Reads the messages of one channel.
#[derive(Debug)]
pub(crate) struct TagReader {
    schema: Schema,
    each: Option<FieldPath>,
    /// The id's parts, which a colon joins.
    id: Vec<FieldPath>,
    distance: Option<Distance>,
    stddev: Option<FieldPath>,
    /// Where no field tells it, metres.
    usual_stddev: f64,
    /// The variance of the distance, which some versions of a type have; 0 if it is not known.
    variance: Option<FieldPath>,
    /// What one unit of a distance is in metres.
    unit: f64,
    bearing: Option<Bearing>,
    pose: Option<FieldPath>,
}

/// What tells in which direction a tag is.
#[derive(Debug)]
struct Bearing {
    path: FieldPath,
    /// What one unit of it is in radians, counterclockwise.
    unit: f64,
    stddev: Option<FieldPath>,
    /// Where no field tells it, radians.
    usual_stddev: f64,
}

/// What tells how far a tag is.
#[derive(Debug)]
enum Distance {
    Range(FieldPath),
    Strength(FieldPath, PathLoss),
}

/// The readings in one message.
#[derive(Debug, PartialEq)]
pub(crate) struct TagMessage {
    pub(crate) stamp: Time,
    /// The frame that positions are in.
    pub(crate) frame_id: String,
    pub(crate) readings: Vec<TagReading>,
}

/// What a message says of one tag.
#[derive(Debug, PartialEq)]
pub(crate) struct TagReading {
    pub(crate) tag_id: String,
    pub(crate) seen: Seen,
}

/// How a tag was read.
#[derive(Debug, PartialEq)]
pub(crate) enum Seen {
    /// How far it is, metres, with the standard deviation of that (0 if it is not known), and the signal strength, dBm.
    Range { range: f64, stddev: f64, rssi: f32 },
    /// The direction in which it is, radians about the z axis of the frame of the message, counterclockwise from its x axis, with
    /// the standard deviation of that (0 if it is not known).
    Bearing { bearing: f64, stddev: f64 },
    /// Where it is in the frame of the message, metres.
    At(Point3<f64>),
}

/// Where readings are in messages of types that are known: a range of a sonar or a radio, named by its frame, and what the
/// detectors of visual tags say that give poses.
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

/// Whether a type is that of detections whose poses are in tf.
pub(crate) fn has_poses_in_tf(type_name: &str) -> bool {
    type_name == "apriltag_msgs/msg/AprilTagDetectionArray"
}

/// The id of a visual tag whose pose is in tf, by the name of its frame: `tag36h11:5` for `robot1/tag36h11:5`.
pub(crate) fn tag_of_frame(frame: &str) -> Option<&str> {
    let id = frame.rsplit('/').next()?;
    let (family, number) = id.split_once(':')?;
    let is_tag = !family.is_empty() && !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_digit());
    is_tag.then_some(id)
}

impl TagReader {
    /// Reads the messages of `channel`, in which readings are where `fields` says.
    ///
    /// # Errors
    /// Nobody knows the type's definition, a path is none, or the fields say nothing of where a tag is.
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
            return Err("nothing says which field tells where a tag is".to_owned());
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

    /// The readings in a message of `robot`.
    ///
    /// # Errors
    /// The message does not fit its type, or has no such fields.
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
                _ => return Err(format!("`{each}` is no array")),
            },
        }
        Ok(TagMessage { stamp, frame_id, readings })
    }

    /// What a message or an element says of a tag: its distance and its bearing, or else its place.
    fn add_readings(&self, robot: &str, of: &Value<'_>, readings: &mut Vec<TagReading>) -> Result<(), String> {
        let find = |path: &FieldPath| of.find(path).map_err(|error| error.to_string());
        let a_number = |path: &FieldPath| number(&find(path)?).ok_or_else(|| format!("`{path}` is no number"));
        let mut id = Vec::new();
        for path in &self.id {
            id.push(match find(path)? {
                // The same tag has one name in the frames of all robots.
                Value::Scalar(Scalar::Text(text)) => without_robot(robot, text).to_owned(),
                Value::Scalar(whole @ (Scalar::Int(_) | Scalar::Uint(_))) => whole.to_string(),
                _ => return Err(format!("`{path}` is neither a text nor a whole number")),
            });
        }
        let tag_id = id.join(":");
        let mut add = |seen| readings.push(TagReading { tag_id: tag_id.clone(), seen });
        if let Some(distance) = &self.distance {
            let stddev = self.stddev.as_ref().map(a_number).transpose()?;
            let variance = || number(&of.find(self.variance.as_ref()?).ok()?).filter(|variance| *variance > 0.0);
            let told = stddev.map(|stddev| stddev * self.unit).or_else(|| Some(variance()?.sqrt() * self.unit));
            let stddev = told.unwrap_or(self.usual_stddev);
            add(match distance {
                Distance::Range(path) => Seen::Range { range: a_number(path)? * self.unit, stddev, rssi: 0.0 },
                Distance::Strength(path, model) => {
                    let rssi = a_number(path)?;
                    let (range, by_model) = model.distance(rssi);
                    let stddev = if stddev > 0.0 { stddev } else { by_model };
                    Seen::Range { range, stddev, rssi: rssi as f32 }
                }
            });
        }
        if let Some(Bearing { path, unit, stddev, usual_stddev }) = &self.bearing {
            let stddev = stddev.as_ref().map(a_number).transpose()?;
            let stddev = stddev.map_or(*usual_stddev, |stddev| (stddev * unit).abs());
            add(Seen::Bearing { bearing: a_number(path)? * unit, stddev });
        }
        if let Some(path) = self.pose.as_ref().filter(|_| self.distance.is_none() && self.bearing.is_none()) {
            let pose = find(path)?;
            let point = pose.field("position").unwrap_or(&pose);
            let axis = |name: &str| number(point.field(name)?);
            let place = || Some(Point3::new(axis("x")?, axis("y")?, axis("z")?));
            add(Seen::At(place().ok_or_else(|| format!("`{path}` is neither a pose nor a point"))?));
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

/// A frame's name without that of its robot.
fn without_robot<'a>(robot: &str, frame: &'a str) -> &'a str {
    frame.strip_prefix(robot).and_then(|rest| rest.strip_prefix('/')).filter(|rest| !rest.is_empty()).unwrap_or(frame)
}
