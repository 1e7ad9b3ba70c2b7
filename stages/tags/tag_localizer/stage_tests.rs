//! The stage as a whole: messages in, messages out.

use super::kind;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, Pose, PoseStamped, PoseWithCovarianceStamped, TagEstimates, TagRange};
use gridweave_runtime::stage::StageHarness;

/// The stage with messages of `robot1`.
struct Bench {
    stage: StageHarness,
    seconds: f64,
}

impl Bench {
    fn new(parameters: &str) -> Self {
        Self { stage: StageHarness::new(&kind(), parameters).unwrap(), seconds: 0.0 }
    }

    fn pose(&mut self, seconds: f64, x: f64, y: f64) {
        self.seconds = seconds;
        let pose = Pose::from(nalgebra::Isometry2::translation(x, y));
        let stamped = PoseStamped { header: Header::new(at(seconds), "robot1/map"), pose };
        self.send_pose(&stamped.into());
    }

    fn send_pose(&mut self, pose: &PoseWithCovarianceStamped) {
        self.stage.give::<PoseWithCovarianceStamped>("pose", "robot1", at(self.seconds), pose).unwrap();
    }

    fn reading(&mut self, seconds: f64, tag_id: &str, range: f64) {
        self.seconds = seconds;
        let header = Header::new(at(seconds), "robot1/base_link");
        let reading = TagRange { header, tag_id: tag_id.into(), range, range_stddev: 0.05, rssi: 0.0 };
        self.send_reading(&reading);
    }

    fn send_reading(&mut self, reading: &TagRange) {
        self.stage.give::<TagRange>("tags", "robot1", at(self.seconds), reading).unwrap();
    }

    /// Around the tags, one turn in 20 s.
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
        self.stage.finish(at(self.seconds)).unwrap();
    }

    fn take(&mut self) -> Vec<TagEstimates> {
        self.stage.take("estimates").unwrap()
    }

    fn warnings(&self) -> Vec<(String, u64)> {
        self.stage.warnings().into_iter().collect()
    }
}

fn at(seconds: f64) -> LogTime {
    LogTime(1_000_000_000_000).plus_seconds(seconds)
}

#[test]
fn a_tag_that_is_read_again_goes_on_gathering_readings() {
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
    assert_eq!(bench.take().len(), 0, "3 m from the last position, where the tag was 2 m away");
    bench.pose(20.5, 9.0, 0.0);
    assert_eq!(bench.take().len(), 0, "it was read a moment ago");
    bench.pose(21.0, 9.0, 0.0);
    assert_eq!(bench.take().len(), 1);
}

#[test]
fn poses_that_jump_back_and_forth_do_not_read_out_the_tags_at_every_jump() {
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
fn a_robot_without_tags_is_reported_at_the_end() {
    let mut bench = Bench::new("");
    bench.pose(0.0, 0.0, 0.0);
    bench.finish();
    let sent = bench.take();
    assert_eq!((sent.len(), sent[0].tags.len(), sent[0].robot.as_str()), (1, 0, "robot1"));
}

#[test]
fn a_reading_without_a_stamp_is_located_at_its_log_time() {
    let mut bench = Bench::new("min_readings = 1");
    bench.pose(0.0, 0.0, 0.0);
    bench.seconds = 0.3;
    let reading = TagRange { tag_id: "tag".into(), range: 1.0, ..Default::default() };
    bench.send_reading(&reading);
    bench.finish();
    assert_eq!(bench.take()[0].tags.len(), 1);
    assert_eq!(bench.warnings(), vec![]);
}
