//! The stage `tag_localizer`.

use super::{CovarianceProblem, Position, TagLocalizer, TagLocalizerParameters, position_covariance};
use crate::geometry::Point2;
use gridweave_runtime::message::{LogTime, Message};
use gridweave_runtime::ros::{Header, Pose, PoseWithCovarianceStamped, TagEstimate, TagEstimates, TagRange, Time};
use gridweave_runtime::stage::{InputPort, Output, OutputPort, PortType, Stage, StageError, StageKind};
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;

const POSE: usize = 0;
const ESTIMATES: usize = 0;

/// The beginning of a `PoseWithCovarianceStamped`: its header, the pose, and the first two rows of the covariance.
/// A log holds tens of thousands of them, and nobody asks for the other rows.
#[derive(Deserialize)]
struct PoseStart {
    header: Header,
    pose: Pose,
    covariance: [[f64; 6]; 2],
}

/// The stage kind `tag_localizer`.
pub fn kind() -> StageKind {
    StageKind::stage::<TagLocalizerParameters, TagLocalizerStage>(
        "tag_localizer",
        "Locates radio tags in each robot's map from range readings (Tsardoulias et al., section 3). Sends all tags of a \
         robot whenever one of them gets out of reach, and at the end.",
        vec![
            InputPort::one(
                "pose",
                PortType::of::<PoseWithCovarianceStamped>(),
                "poses of the robots in their maps; a covariance of zeros is not known",
            ),
            InputPort::one("tags", PortType::of::<TagRange>(), "range readings of tags"),
        ],
        vec![OutputPort::new(
            "estimates",
            PortType::of::<TagEstimates>(),
            "all tags of one robot, the most certain first",
        )],
        |parameters, _| Ok(TagLocalizerStage { parameters, robots: BTreeMap::new() }),
    )
}

struct TagLocalizerStage {
    parameters: TagLocalizerParameters,
    robots: BTreeMap<String, Robot>,
}

struct Robot {
    localizer: TagLocalizer,
    /// How far a tag can be heard, metres.
    reach: f64,
    frame_id: Option<String>,
    sent: bool,
}

impl Stage for TagLocalizerStage {
    fn receive(&mut self, port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let name = message.robot();
        if name.is_empty() {
            output.warn("poses and tag readings without a robot are left out");
            return Ok(());
        }
        if !self.robots.contains_key(name) {
            let localizer = TagLocalizer::new(self.parameters.clone());
            let reach = self.parameters.reach;
            self.robots.insert(name.to_owned(), Robot { localizer, reach, frame_id: None, sent: false });
        }
        match self.robots.get_mut(name) {
            Some(robot) if port == POSE => robot.receive_pose(name, message, output),
            Some(robot) => {
                robot.receive_reading(message, output);
                Ok(())
            }
            None => Ok(()),
        }
    }

    fn finish(&mut self, output: &mut Output<'_>) -> Result<(), StageError> {
        for (name, robot) in &mut self.robots {
            robot.localizer.place_pending(|problem| output.warn(problem.to_string()));
            if robot.localizer.read_out_all() || !robot.sent {
                robot.send(name, output)?;
            }
        }
        Ok(())
    }

    fn report(&self) -> Option<Value> {
        let robots = self.robots.iter().map(|(name, robot)| {
            let tags = robot.localizer.modes().map(|(id, mode, readings)| {
                let stddev = (mode.covariance.trace() / 2.0).max(0.0).sqrt();
                (id.to_owned(), json!({ "certainty": mode.certainty, "stddev": stddev, "readings": readings }))
            });
            (name.clone(), Value::Object(tags.collect()))
        });
        Some(Value::Object(robots.collect()))
    }
}

impl Robot {
    fn receive_pose(&mut self, name: &str, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let start: PoseStart = match message.decode() {
            Ok(start) => start,
            Err(error) => {
                output.warn(format!("poses that cannot be read are left out: {error}"));
                return Ok(());
            }
        };
        let frame_id = self.frame_id.get_or_insert_with(|| start.header.frame_id.clone());
        if *frame_id != start.header.frame_id {
            output.warn(format!(
                "poses of {name} in frame `{}` are left out, because its first pose is in frame `{frame_id}`",
                start.header.frame_id
            ));
            return Ok(());
        }
        let place = Point2::new(start.pose.position.x, start.pose.position.y);
        if !place.iter().all(|value| value.is_finite()) {
            output.warn("poses with a value that is no finite number are left out");
            return Ok(());
        }
        let (covariance, problem) = position_covariance(&start.covariance, self.reach);
        match problem {
            Some(CovarianceProblem::Impossible) => output.warn(format!(
                "covariances of poses of {name} that are no covariances (not finite, or below 0) are taken as not known"
            )),
            Some(CovarianceProblem::Huge) => output.warn(format!(
                "poses of {name} are known less exactly than `reach`: readings there say next to nothing"
            )),
            None => {}
        }
        let position = Position { place, covariance };
        let time = time_of(start.header.stamp, message);
        if !self.localizer.add_pose(time, position, |problem| output.warn(problem.to_string())) {
            output.warn("poses that are older than the one before are left out");
        }
        match self.localizer.read_out_lost() {
            true => self.send(name, output),
            false => Ok(()),
        }
    }

    fn receive_reading(&mut self, message: &Message, output: &mut Output<'_>) {
        let reading: TagRange = match message.decode() {
            Ok(reading) => reading,
            Err(error) => return output.warn(format!("tag readings that cannot be read are left out: {error}")),
        };
        let time = time_of(reading.header.stamp, message);
        if let Err(problem) = self.localizer.add_reading(time, &reading.tag_id, reading.range, reading.range_stddev) {
            output.warn(problem.to_string());
        }
    }

    fn send(&mut self, name: &str, output: &mut Output<'_>) -> Result<(), StageError> {
        self.sent = true;
        let mut tags: Vec<TagEstimate> = self
            .localizer
            .modes()
            .map(|(id, mode, readings)| TagEstimate {
                tag_id: id.to_owned(),
                x: mode.position.x,
                y: mode.position.y,
                covariance: [mode.covariance.m11, mode.covariance.m12, mode.covariance.m21, mode.covariance.m22],
                certainty: mode.certainty,
                readings,
            })
            .collect();
        // The sort is stable, and the tags come by id.
        tags.sort_by(|a, b| b.certainty.total_cmp(&a.certainty));
        let header = Header::new(output.log_time(), self.frame_id.clone().unwrap_or_default());
        output.send(ESTIMATES, name, &TagEstimates { header, robot: name.to_owned(), tags })
    }
}

/// The time that a message tells of: that of its header or, where it has none, when it was logged.
fn time_of(stamp: Time, message: &Message) -> LogTime {
    match LogTime::from(stamp) {
        LogTime::MIN => message.header().log_time,
        time => time,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::{FixedText, MessageHeader};
    use gridweave_runtime::ros::{PoseStamped, RosMessage, encode};
    use gridweave_runtime::stage::{CollectedOutputs, Context, Node};
    use serde::Serialize;

    const TAGS: usize = 1;

    /// The stage, fed with messages about `robot1` unless another name is given.
    struct Bench {
        stage: Box<dyn Stage>,
        outputs: CollectedOutputs,
        seconds: f64,
    }

    impl Bench {
        fn new(parameters: &str) -> Self {
            let kind = kind();
            let Ok(Node::Stage(stage)) = kind.make(toml_table(parameters), &Context::default()) else {
                panic!("no stage")
            };
            Self { stage, outputs: CollectedOutputs::new(&kind), seconds: 0.0 }
        }

        fn send<T: RosMessage + Serialize>(&mut self, robot: &str, port: usize, message: &T) {
            let log_time = at(self.seconds);
            let header = MessageHeader { log_time, robot: FixedText::new(robot).unwrap(), ..Default::default() };
            let message = Message::from_vec(header, encode(message).unwrap());
            self.stage.receive(port, &message, &mut self.outputs.output(log_time)).unwrap();
        }

        fn pose(&mut self, seconds: f64, x: f64, y: f64) {
            self.seconds = seconds;
            let pose = Pose::from(nalgebra::Isometry2::translation(x, y));
            let stamped = PoseStamped { header: Header::new(at(seconds), "robot1/map"), pose };
            self.send("robot1", POSE, &PoseWithCovarianceStamped::from(stamped));
        }

        fn reading(&mut self, seconds: f64, tag_id: &str, range: f64) {
            self.seconds = seconds;
            let header = Header::new(at(seconds), "robot1/base_link");
            let reading = TagRange { header, tag_id: tag_id.into(), range, range_stddev: 0.05, rssi: 0.0 };
            self.send("robot1", TAGS, &reading);
        }

        /// Round the tags, one turn in 20 s.
        fn drive(&mut self, tags: &[(&str, f64, f64)], from: f64) {
            for step in 0..200 {
                let (x, y) = ((0.0314 * f64::from(step)).cos(), (0.0314 * f64::from(step)).sin());
                let seconds = from + 0.1 * f64::from(step);
                self.pose(seconds, x, y);
                for (tag, tag_x, tag_y) in tags {
                    self.reading(seconds, tag, (tag_x - x).hypot(tag_y - y));
                }
            }
        }

        fn finish(&mut self) {
            let log_time = at(self.seconds);
            self.stage.finish(&mut self.outputs.output(log_time)).unwrap();
        }

        fn take(&mut self) -> Vec<TagEstimates> {
            self.outputs.take(ESTIMATES).iter().map(|message| message.decode().unwrap()).collect()
        }

        fn warnings(&self) -> Vec<(&str, u64)> {
            self.outputs.warnings().iter().map(|(text, count)| (text.as_str(), *count)).collect()
        }
    }

    fn at(seconds: f64) -> LogTime {
        LogTime(1_000_000_000_000).plus_seconds(seconds)
    }

    fn toml_table(text: &str) -> toml::Table {
        text.parse().unwrap()
    }

    #[test]
    fn all_tags_are_sent_when_one_gets_out_of_reach() {
        let mut bench = Bench::new("");
        bench.drive(&[("far", 0.3, 2.0), ("near", 0.0, 0.1)], 0.0);
        assert_eq!(bench.take(), vec![], "both are in reach");
        bench.pose(22.0, 0.0, 0.0);
        let sent = bench.take();
        assert_eq!(sent.len(), 1);
        assert_eq!((sent[0].robot.as_str(), sent[0].header.frame_id.as_str()), ("robot1", "robot1/map"));
        assert_eq!(LogTime::from(sent[0].header.stamp), at(22.0));
        assert_eq!(sent[0].tags.len(), 2);
        assert!(sent[0].tags[0].certainty >= sent[0].tags[1].certainty);
        for tag in &sent[0].tags {
            let truth = if tag.tag_id == "far" { (0.3, 2.0) } else { (0.0, 0.1) };
            assert!((tag.x - truth.0).hypot(tag.y - truth.1) < 0.01, "{tag:?}");
            assert!(tag.certainty > 0.9 && tag.readings == 200, "{tag:?}");
        }
        bench.finish();
        assert_eq!(bench.take(), vec![], "nothing has changed since");
    }

    #[test]
    fn a_tag_that_is_met_again_goes_on_gathering_readings() {
        let mut bench = Bench::new("");
        bench.drive(&[("tag", 0.3, 2.0)], 0.0);
        bench.pose(30.0, 0.0, 0.0);
        bench.drive(&[("tag", 0.3, 2.0)], 40.0);
        bench.finish();
        let readings: Vec<u32> = bench.take().iter().map(|estimates| estimates.tags[0].readings).collect();
        assert_eq!(readings, [200, 400]);
    }

    #[test]
    fn a_tag_is_out_of_reach_when_the_robot_has_gone_too_far() {
        let mut bench = Bench::new("timeout = 1000.0");
        bench.drive(&[("tag", 0.3, 2.0)], 0.0);
        bench.pose(20.0, 4.0, 0.0);
        assert_eq!(bench.take().len(), 0, "3 m from the last place, where the tag was 2 m away");
        bench.pose(20.5, 9.0, 0.0);
        assert_eq!(bench.take().len(), 0, "it was read a moment ago");
        bench.pose(21.0, 9.0, 0.0);
        assert_eq!(bench.take().len(), 1);
    }

    #[test]
    fn poses_that_jump_to_and_fro_do_not_have_the_tags_read_out_at_every_jump() {
        let mut bench = Bench::new("");
        for step in 0..100 {
            let seconds = 0.1 * f64::from(step);
            bench.pose(seconds, if step % 2 == 0 { 0.0 } else { 1000.0 }, 0.0);
            bench.reading(seconds, "tag", 1.0);
        }
        assert_eq!(bench.take().len(), 0);
        bench.finish();
        assert_eq!(bench.take().len(), 1);
    }

    #[test]
    fn a_robot_without_tags_is_told_of_at_the_end() {
        let mut bench = Bench::new("");
        bench.pose(0.0, 0.0, 0.0);
        bench.finish();
        let sent = bench.take();
        assert_eq!((sent.len(), sent[0].tags.len(), sent[0].robot.as_str()), (1, 0, "robot1"));
    }

    #[test]
    fn a_tag_with_few_readings_is_not_reported() {
        let mut bench = Bench::new("min_readings = 4");
        bench.pose(0.0, 0.0, 0.0);
        for _ in 0..3 {
            bench.reading(0.1, "few", 1.0);
        }
        for _ in 0..4 {
            bench.reading(0.1, "enough", 1.0);
        }
        bench.finish();
        let ids: Vec<String> = bench.take().remove(0).tags.into_iter().map(|tag| tag.tag_id).collect();
        assert_eq!(ids, ["enough"]);
    }

    #[test]
    fn readings_that_cannot_be_used_are_counted_and_left_out() {
        let mut bench = Bench::new("min_readings = 1");
        bench.reading(0.0, "tag", 1.0);
        bench.pose(1.0, 0.0, 0.0);
        for range in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
            bench.reading(1.0, "tag", range);
        }
        bench.reading(1.0, "", 1.0);
        bench.reading(1.0, "tag", 3.3);
        bench.pose(2.0, f64::NAN, 0.0);
        bench.reading(9.0, "tag", 1.0);
        bench.finish();
        assert_eq!(bench.take()[0].tags, vec![]);
        let counts: Vec<u64> = bench.warnings().iter().map(|(_, count)| *count).collect();
        assert_eq!(counts, [1, 1, 1, 4, 1, 1], "{:?}", bench.warnings());
    }

    #[test]
    fn bytes_that_are_no_message_are_counted_and_left_out() {
        let mut bench = Bench::new("");
        for port in [POSE, TAGS] {
            let header = MessageHeader { robot: FixedText::new("robot1").unwrap(), ..Default::default() };
            let message = Message::from_vec(header, vec![0, 1, 0, 0, 9]);
            bench.stage.receive(port, &message, &mut bench.outputs.output(at(0.0))).unwrap();
        }
        assert_eq!(bench.warnings().len(), 2, "{:?}", bench.warnings());
    }

    #[test]
    fn poses_in_another_frame_are_left_out() {
        let mut bench = Bench::new("min_readings = 1");
        bench.pose(0.0, 0.0, 0.0);
        let odometry = PoseWithCovarianceStamped { header: Header::new(at(0.1), "odom"), ..Default::default() };
        bench.send("robot1", POSE, &odometry);
        assert_eq!(bench.warnings().len(), 1);
        assert!(bench.warnings()[0].0.contains("`odom`"), "{:?}", bench.warnings());
    }

    #[test]
    fn a_reading_without_a_stamp_is_placed_at_its_log_time() {
        let mut bench = Bench::new("min_readings = 1");
        bench.pose(0.0, 0.0, 0.0);
        bench.seconds = 0.3;
        let reading = TagRange { tag_id: "tag".into(), range: 1.0, ..Default::default() };
        bench.send("robot1", TAGS, &reading);
        bench.finish();
        assert_eq!(bench.take()[0].tags.len(), 1);
        assert_eq!(bench.warnings(), vec![]);
    }
}
