//! Readings of tags in messages of any type, found by the definition that their log holds.

use crate::dynamic::{FieldPath, Scalar, Schema, Value};
use crate::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::Time;
use gridweave_runtime::stage::{PathLoss, TagFields};
use nalgebra::Point3;

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

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::{Header, encode};

    const UWB: &str = "std_msgs/Header header\nAnchor[] anchors\n\
        ================================================================================\nMSG: uwb_msgs/Anchor\n\
        uint16 anchor_id\nint32 distance_mm\nfloat32 dbm\nfloat64 deviation\n\
        ================================================================================\nMSG: std_msgs/Header\n\
        builtin_interfaces/Time stamp\nstring frame_id\n\
        ================================================================================\nMSG: builtin_interfaces/Time\n\
        int32 sec\nuint32 nanosec\n";

    fn channel(schema_name: &str, text: &str) -> Channel {
        Channel {
            topic: "/robot1/uwb".into(),
            message_encoding: "cdr".into(),
            schema_name: schema_name.into(),
            schema_encoding: "ros2msg".into(),
            schema: text.as_bytes().to_vec(),
            ..Default::default()
        }
    }

    fn fields(set: impl FnOnce(&mut TagFields)) -> TagFields {
        let mut fields = TagFields { each: Some("anchors".into()), id_field: "anchor_id".into(), ..Default::default() };
        set(&mut fields);
        fields
    }

    fn uwb() -> Vec<u8> {
        let anchors = vec![(7u16, 1500i32, -60.0f32, 20.0f64), (8, 2500, -40.0, 30.0)];
        encode(&(Header::new(LogTime(3_000_000_004), "robot1/antenna"), anchors)).unwrap()
    }

    fn read(fields: &TagFields) -> Result<TagMessage, String> {
        TagReader::new(&channel("uwb_msgs/msg/Ranges", UWB), fields)?.read("robot1", &uwb())
    }

    #[test]
    fn every_element_of_an_array_is_a_reading() {
        let found = read(&fields(|fields| {
            fields.range_field = Some("distance_mm".into());
            fields.stddev_field = Some("deviation".into());
            fields.range_unit = Some(0.001);
        }))
        .unwrap();
        let reading =
            |id: &str, range, stddev| TagReading { tag_id: id.into(), seen: Seen::Range { range, stddev, rssi: 0.0 } };
        assert_eq!(found.readings, [reading("7", 1.5, 0.02), reading("8", 2.5, 0.03)]);
        assert_eq!((found.stamp, found.frame_id.as_str()), (Time { sec: 3, nanosec: 4 }, "robot1/antenna"));
    }

    #[test]
    fn a_signal_strength_is_a_distance_by_the_model() {
        let path_loss = Some(PathLoss { rssi_at_1m: -40.0, exponent: 2.0, stddev: 4.0 });
        let strength = |fields: &mut TagFields| {
            fields.rssi_field = Some("dbm".into());
            fields.path_loss = path_loss;
        };
        let found = read(&fields(strength)).unwrap();
        let Seen::Range { range, stddev, rssi } = found.readings[0].seen else { panic!("{found:?}") };
        assert!((range - 10.0).abs() < 1e-9 && (stddev - 4.605).abs() < 1e-3 && rssi == -60.0);
        let with_stddev = fields(|fields| {
            strength(fields);
            fields.stddev = Some(0.5);
        });
        let Seen::Range { stddev, .. } = read(&with_stddev).unwrap().readings[1].seen else { panic!() };
        assert_eq!(stddev, 0.5);
    }

    #[test]
    fn a_bearing_is_read_alone_or_beside_the_range() {
        let degrees = |fields: &mut TagFields| {
            fields.bearing_field = Some("dbm".into());
            fields.bearing_unit = Some(-0.01);
            fields.bearing_stddev_field = Some("deviation".into());
        };
        let found = read(&fields(degrees)).unwrap().readings;
        let bearing =
            |id: &str, bearing: f64, stddev| TagReading { tag_id: id.into(), seen: Seen::Bearing { bearing, stddev } };
        assert_eq!(found, [bearing("7", 0.6, 0.2), bearing("8", 0.4, 0.3)]);
        let both = |fields: &mut TagFields| {
            degrees(fields);
            fields.range_field = Some("distance_mm".into());
            fields.range_unit = Some(0.001);
            fields.bearing_stddev_field = None;
            fields.bearing_stddev = Some(0.05);
        };
        let found = read(&fields(both)).unwrap().readings;
        assert_eq!((found.len(), &found[1]), (4, &bearing("7", 0.6, 0.05)));
        assert!(matches!(&found[2].seen, Seen::Range { range: 2.5, .. }), "{found:?}");
    }

    #[test]
    fn fields_that_are_not_there_are_named() {
        let range = |field: &str| {
            let field = field.to_owned();
            read(&fields(|fields| fields.range_field = Some(field))).unwrap_err()
        };
        assert!(range("distance").contains("`distance`") && range("distance").contains("distance_mm"));
        assert!(range("a b").contains("no path"));
        assert!(read(&fields(|_| ())).unwrap_err().contains("nothing says"));
        let no_array =
            TagFields { each: Some("header".into()), ..fields(|fields| fields.range_field = Some("x".into())) };
        assert!(read(&no_array).unwrap_err().contains("`header` is no array"));
        let no_id = TagFields { id_field: "dbm".into(), ..fields(|fields| fields.range_field = Some("dbm".into())) };
        assert!(read(&no_id).unwrap_err().contains("neither a text nor a whole number"));
        let unknown =
            TagReader::new(&channel("p/msg/Unknown", ""), &fields(|fields| fields.range_field = Some("x".into())));
        assert!(unknown.unwrap_err().contains("p/msg/Unknown"));
    }

    #[test]
    fn a_sensors_range_is_named_by_its_frame_without_the_robot() {
        let name = "sensor_msgs/msg/Range";
        let range = (Header::new(LogTime(1), "robot1/tag7"), 1u8, 0.1f32, 0.1f32, 5.0f32, 1.25f32);
        // Up to ROS 2 Humble, whose logs may lack definitions; and since Iron, with the variance behind it.
        let before = crate::schemas::schema_text(name).unwrap();
        let since = before.replacen("float32 range\n", "float32 range\nfloat32 variance\n", 1);
        assert_ne!(before, since);
        let old = encode(&range).unwrap();
        let new = |variance: f32| encode(&(range.clone(), variance)).unwrap();
        let cases = [("", old.clone(), 0.0), (&before, old, 0.0), (&since, new(0.0), 0.0), (&since, new(0.25), 0.5)];
        for (text, bytes, stddev) in cases {
            let reader = TagReader::new(&channel(name, text), &known_fields(name).unwrap()).unwrap();
            let found = reader.read("robot1", &bytes).unwrap();
            let seen = Seen::Range { range: 1.25, stddev, rssi: 0.0 };
            assert_eq!(found.readings, [TagReading { tag_id: "tag7".into(), seen }]);
            assert!(reader.read("robot1", b"cut").is_err());
        }
    }

    /// The published text of a message of a detector, and those of what it is made of.
    fn published(text: &str, parts: &[(&str, &str)]) -> String {
        let separator = "=".repeat(80);
        let standard = ["geometry_msgs/PoseWithCovarianceStamped", "std_msgs/Header"].map(|name| {
            let text = crate::schemas::schema_text(name).unwrap();
            format!("\n{separator}\nMSG: {name}\n{text}")
        });
        let parts = parts.iter().map(|(name, text)| format!("\n{separator}\nMSG: {name}\n{text}"));
        parts.chain(standard).fold(text.to_owned(), |whole, part| whole + &part)
    }

    /// A pose of which the position matters: x, y, z and a quaternion.
    const POSE: [f64; 7] = [0.5, -0.25, 2.0, 0.0, 0.0, 0.0, 1.0];

    #[test]
    fn tags_of_isaac_ros_are_read_by_its_published_definition() {
        let name = "isaac_ros_apriltag_interfaces/msg/AprilTagDetectionArray";
        let detection = "string family\nint32 id\ngeometry_msgs/Point center      # centre in (x,y) pixel coordinates\n\
            geometry_msgs/Point[4] corners  # corners of tag ((x1,y1),(x2,y2),...)\n\
            geometry_msgs/PoseWithCovarianceStamped pose\n";
        let text = published(
            "std_msgs/Header header\nAprilTagDetection[] detections\n",
            &[("isaac_ros_apriltag_interfaces/AprilTagDetection", detection)],
        );
        let header = Header::new(LogTime(3_000_000_004), "camera");
        let covariance = [[0.0f64; 6]; 6];
        let of_tag =
            |id: i32| ("36h11", id, [320.0f64, 240.0, 0.0], [[0.0f64; 3]; 4], (header.clone(), POSE, covariance));
        let bytes = encode(&(header.clone(), vec![of_tag(5), of_tag(12)])).unwrap();
        let reader = TagReader::new(&channel(name, &text), &known_fields(name).unwrap()).unwrap();
        let found = reader.read("robot1", &bytes).unwrap();
        let seen = |id: &str| TagReading { tag_id: id.into(), seen: Seen::At(Point3::new(0.5, -0.25, 2.0)) };
        assert_eq!(found.readings, [seen("36h11:5"), seen("36h11:12")]);
        assert_eq!((found.stamp, found.frame_id.as_str()), (Time { sec: 3, nanosec: 4 }, "camera"));
    }

    #[test]
    fn tags_of_aruco_opencv_are_read_by_its_published_definition() {
        let name = "aruco_opencv_msgs/msg/ArucoDetection";
        let text = published(
            "std_msgs/Header header\naruco_opencv_msgs/MarkerPose[] markers\naruco_opencv_msgs/BoardPose[] boards",
            &[
                ("aruco_opencv_msgs/MarkerPose", "uint16 marker_id\ngeometry_msgs/Pose pose\n"),
                ("aruco_opencv_msgs/BoardPose", "string board_name\ngeometry_msgs/Pose pose\n"),
            ],
        );
        let header = Header::new(LogTime(1), "camera");
        let bytes = encode(&(header, vec![(7u16, POSE)], vec![("board", POSE)])).unwrap();
        let reader = TagReader::new(&channel(name, &text), &known_fields(name).unwrap()).unwrap();
        let seen = Seen::At(Point3::new(0.5, -0.25, 2.0));
        assert_eq!(reader.read("robot1", &bytes).unwrap().readings, [TagReading { tag_id: "7".into(), seen }]);
    }

    #[test]
    fn frames_of_tags_are_told_from_others() {
        let of = |frame| tag_of_frame(frame);
        assert_eq!((of("tag36h11:5"), of("robot1/36h11:12")), (Some("tag36h11:5"), Some("36h11:12")));
        for other in ["base_link", "robot1/base_link", "a:b", ":1", "a:", "robot1/", ""] {
            assert_eq!(of(other), None, "{other}");
        }
    }
}
