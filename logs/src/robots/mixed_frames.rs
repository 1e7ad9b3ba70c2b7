//! Messages of several robots on one topic, which only their frames distinguish.

use super::merged_maps::own;
use super::part_names::is_part;
use std::collections::BTreeMap;

/// The first frame of each topic of one robot.
#[derive(Clone, Debug, Default)]
pub(crate) struct MixedFrames(BTreeMap<String, String>);

impl MixedFrames {
    /// Adds the frame of a message on a topic of `robot`. Returns the problem if another message was another robot's.
    pub(crate) fn add(&mut self, topic: &str, robot: &str, frame: &str) -> Option<String> {
        let frame = own(robot, frame);
        match self.0.get(topic) {
            Some(first) if first == frame => None,
            Some(first) => problem(topic, [first, frame]),
            None => {
                self.0.insert(topic.to_owned(), frame.to_owned());
                None
            }
        }
    }
}

/// The problem of messages on a topic in these frames if two of them are those of two robots.
pub(crate) fn problem_of_frames<'a>(topic: &str, frames: impl Iterator<Item = &'a String>) -> Option<String> {
    let robot = topic.split('/').nth(1).unwrap_or_default();
    let frames: Vec<&str> = frames.map(|frame| own(robot, frame)).collect();
    let mut pairs = frames.iter().flat_map(|one| frames.iter().map(move |other| [*one, *other]));
    pairs.find_map(|pair| problem(topic, pair))
}

/// The problem of messages on one topic in two frames: that they are those of two robots, `robot1/laser` and
/// `robot2/laser`. One robot may have two lidars, `front/laser` and `rear/laser`.
fn problem(topic: &str, frames: [&str; 2]) -> Option<String> {
    let [(one, of_one), (other, of_other)] = [frames[0].split_once('/')?, frames[1].split_once('/')?];
    (one != other && of_one == of_other && !is_part(one) && !is_part(other)).then(|| {
        let name = topic.rsplit('/').next().unwrap_or_default();
        format!(
            "`{topic}` has the messages of several robots, by their frames {} and {}: record those of each robot on a topic of \
             its own, such as `/{one}/{name}` and `/{other}/{name}`",
            frames[0], frames[1]
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_differ_in_the_name_of_the_robot_alone_are_those_of_two_robots() {
        let mut mixed = MixedFrames::default();
        assert_eq!(mixed.add("/all/scan", "all", "all/r1/laser"), None);
        assert_eq!(mixed.add("/all/scan", "all", "r1/laser"), None);
        let text = mixed.add("/all/scan", "all", "all/r2/laser").unwrap();
        assert!(
            text.starts_with("`/all/scan` has the messages of several robots, by their frames r1/laser and r2/laser")
        );
        assert!(text.ends_with("such as `/r1/scan` and `/r2/scan`"), "{text}");
        for (one, other) in
            [("front/laser", "rear/laser"), ("laser", "lidar"), ("a/laser", "a/lidar"), ("lidar1/x", "lidar2/x")]
        {
            let mut mixed = MixedFrames::default();
            assert_eq!([mixed.add("/r/scan", "r", one), mixed.add("/r/scan", "r", other)], [None, None], "{one}");
        }
    }
}
