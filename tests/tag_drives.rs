//! Drives past tags of which all is known: odometry that drifts, ranges and bearings with outliers, and tags that a
//! camera sees.
//!
//! They have the shapes of public logs: that of UTIAS (Leung, Halpern, Barfoot and Liu, "The UTIAS multi-robot
//! cooperative localization and mapping dataset", 2011), whose robots see landmarks in a hall by a camera, and that of
//! Plaza (Djugash, Hamner and Roth, "Navigating with ranging radios", 2009), where radio ranges of tens of metres have
//! outliers; both without maps.

use crate::{LogBuilder, header};
use gridweave_runtime::ros::{PoseStamped, TFMessage, Transform, TransformStamped, Vector3, encode};
use nalgebra::{Isometry2, Point2, Vector2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Metres a second.
const SPEED: f64 = 0.8;
/// Seconds between two poses.
const TICK: f64 = 0.1;

/// How a robot perceives tags.
#[derive(Clone, Copy, Debug)]
pub enum Sense {
    /// Standard deviation of its range measurements, metres; this share of the ranges is up to 5 m too long.
    Ranges {
        /// Metres.
        stddev: f64,
        /// Share of all ranges.
        outliers: f64,
    },
    /// It perceives in which direction they are by antennas that look to the left, with this standard deviation in
    /// radians; this share of the bearings are any. A reading is a `sensor_msgs/msg/JointState` whose only joint is the
    /// tag, its position the bearing in degrees and clockwise.
    Bearings {
        /// Radians.
        stddev: f64,
        /// Share of all bearings.
        outliers: f64,
    },
    /// It sees where they are, with this standard deviation per metre of distance: tags of the AprilTag family
    /// `tag36h11`.
    Camera {
        /// Metres per metre.
        stddev: f64,
    },
}

/// One robot's drive.
#[derive(Clone, Debug)]
pub struct TagDrive {
    /// Its name.
    pub robot: &'static str,
    /// Its start in the world: the frame of its poses.
    pub start: Isometry2<f64>,
    /// The corners of its way in the world, metres, which it drives round twice.
    pub corners: Vec<Point2<f64>>,
    /// How its odometry drifts: radians of heading after one metre, growing with the root of the way.
    pub drift: f64,
    /// How far tags are perceived, metres.
    pub reach: f64,
    /// How.
    pub sense: Sense,
    /// Seeds its noise.
    pub seed: u64,
}

/// The place of the camera on the robot, metres.
const CAMERA: Vector2<f64> = Vector2::new(0.1, 0.0);

/// The pose of the antennas on the robot.
fn antennas() -> Isometry2<f64> {
    Isometry2::new(Vector2::new(-0.2, 0.1), FRAC_PI_2)
}

/// A transform from one frame to another.
fn transform(seconds: f64, [parent, child]: [String; 2], transform: Transform) -> TFMessage {
    TFMessage {
        transforms: vec![TransformStamped { header: header(seconds, parent), child_frame_id: child, transform }],
    }
}

impl TagDrive {
    /// Writes the poses of the robot and its measurements of tags, which are named by their number.
    pub fn write(&self, log: &mut LogBuilder, tags: &[Point2<f64>]) {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        let robot = self.robot;
        self.write_sensor(log);
        let mut place = Point2::from(self.start.translation.vector);
        let mut odometry = Isometry2::identity();
        let mut heading = self.start.rotation.angle();
        let mut seconds = 0.0;
        for corner in self.corners.iter().chain(&self.corners) {
            while (corner - place).norm() > SPEED * TICK {
                let step = (corner - place).normalize() * SPEED * TICK;
                let turn = step.y.atan2(step.x) - heading;
                heading += turn;
                place += step;
                let error = self.drift * step.norm().sqrt() * noise(&mut random);
                odometry = odometry * Isometry2::rotation(turn + error) * Isometry2::translation(step.norm(), 0.0);
                seconds += TICK;
                let pose = PoseStamped { header: header(seconds, format!("{robot}/map")), pose: odometry.into() };
                log.message(seconds, &format!("/{robot}/pose"), &pose);
                let base = Isometry2::new(place.coords, heading);
                for (number, tag) in tags.iter().enumerate() {
                    let seen = base.inverse() * tag;
                    if seen.coords.norm() <= self.reach {
                        self.write_measurement(log, seconds, number, seen, &mut random);
                    }
                }
            }
        }
    }

    /// Writes where the sensor is on the robot.
    fn write_sensor(&self, log: &mut LogBuilder) {
        let robot = self.robot;
        let (name, pose) = match self.sense {
            Sense::Ranges { .. } => return,
            Sense::Bearings { .. } => ("antennas", antennas()),
            Sense::Camera { .. } => {
                let topic = format!("/{robot}/camera/tags");
                log.raw(0.0, &topic, "apriltag_msgs/msg/AprilTagDetectionArray", &[0, 1, 0, 0]);
                ("camera", Isometry2::new(CAMERA, 0.0))
            }
        };
        let frames = [format!("{robot}/base_link"), format!("{robot}/{name}")];
        log.message(0.0, "/tf_static", &transform(0.0, frames, pose.into()));
    }

    /// Writes a measurement of a tag that is at `seen` in the frame of the robot.
    fn write_measurement(
        &self,
        log: &mut LogBuilder,
        seconds: f64,
        number: usize,
        seen: Point2<f64>,
        random: &mut ChaCha8Rng,
    ) {
        let (robot, distance) = (self.robot, seen.coords.norm());
        match self.sense {
            Sense::Ranges { stddev, outliers } => {
                let longer = if random.random::<f64>() < outliers { 5.0 * random.random::<f64>() } else { 0.0 };
                let range = (distance + stddev * noise(random) + longer).max(0.01);
                log.reading(seconds, robot, &format!("beacon{number}"), range);
            }
            Sense::Bearings { stddev, outliers } => {
                let from_antennas = antennas().inverse() * seen;
                let any = random.random::<f64>() < outliers;
                let turn = if any { TAU * random.random::<f64>() } else { stddev * noise(random) };
                let bearing = from_antennas.y.atan2(from_antennas.x) + turn;
                let header = header(seconds, format!("{robot}/antennas"));
                let none = Vec::<f64>::new();
                let name = vec![format!("tag{number}")];
                let bytes = encode(&(header, name, vec![-bearing.to_degrees()], none.clone(), none)).unwrap();
                log.raw(seconds, &format!("/{robot}/directions"), "sensor_msgs/msg/JointState", &bytes);
            }
            Sense::Camera { stddev } => {
                let error = Vector2::new(noise(random), noise(random));
                let seen = seen.coords + error * stddev * distance - CAMERA;
                let translation = Vector3 { x: seen.x, y: seen.y, z: 0.2 };
                let frames = [format!("{robot}/camera"), format!("tag36h11:{number}")];
                let at = Transform { translation, ..Default::default() };
                log.message(seconds, "/tf", &transform(seconds, frames, at));
            }
        }
    }
}

/// A sample of the standard normal distribution.
fn noise(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}
