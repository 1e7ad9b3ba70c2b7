//! Logs of which messages are changed.

use super::LogBuilder;
use gridweave_runtime::ros::{PoseStamped, RosMessage, TagRange, decode, encode};
use nalgebra::{Isometry2, Point2, Vector2};
use std::collections::BTreeMap;
use std::path::Path;

/// Writes a log again with its messages changed: `change` is given the topic, the type and the bytes of each, and gives
/// none for one that is to be left out.
pub(crate) fn change_log(log: &Path, to: &Path, mut change: impl FnMut(&str, &str, &[u8]) -> Option<Vec<u8>>) {
    let bytes = std::fs::read(log).unwrap();
    let mut changed = LogBuilder::new(to);
    let mut start = None;
    for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
        let seconds = (message.log_time - *start.get_or_insert(message.log_time)) as f64 * 1e-9;
        let topic = message.channel.topic.as_str();
        let name = message.channel.schema.as_ref().map_or("", |schema| schema.name.as_str());
        if let Some(data) = change(topic, name, &message.data) {
            changed.raw(seconds, topic, name, &data);
        }
    }
    changed.finish();
}

/// Writes a log again with its tag readings changed: `change` is given the robot, the reading, and the place of the
/// robot in its map, and gives none for a reading that is to be left out. Topics are as the simulator has them.
pub(crate) fn change_readings(
    log: &Path,
    to: &Path,
    mut change: impl FnMut(&str, TagRange, Point2<f64>) -> Option<TagRange>,
) {
    let mut places: BTreeMap<String, Point2<f64>> = BTreeMap::new();
    change_log(log, to, |topic, name, data| {
        let robot = topic.split('/').nth(1).unwrap_or_default();
        if name == PoseStamped::NAME {
            let pose: PoseStamped = decode(data).unwrap();
            places.insert(robot.to_owned(), Point2::from(pose.pose.planar().translation.vector));
        } else if name == TagRange::NAME {
            let place = places.get(robot).copied().unwrap_or_default();
            return Some(encode(&change(robot, decode(data).unwrap(), place)?).unwrap());
        }
        Some(data.to_vec())
    });
}

/// The place of a tag in the map of robot2, by the truth of a log of which robot1 is the reference.
pub(crate) fn place_in_map_2(truth: &serde_json::Value, tag: &str) -> Point2<f64> {
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let frame = &truth["frames"]["robot2"];
    let transform_1_2 = Isometry2::new(Vector2::new(number(&frame["x"]), number(&frame["y"])), number(&frame["yaw"]));
    let place = &truth["tags"][tag];
    transform_1_2.inverse() * Point2::new(number(&place[0]), number(&place[1]))
}

/// A reading as it would be if the tag were at `to` and not at `from`, for a robot at `position`: it keeps its noise.
/// None if the tag is out of reach there.
pub(crate) fn moved_reading(
    mut reading: TagRange,
    position: Point2<f64>,
    from: Point2<f64>,
    to: Point2<f64>,
) -> Option<TagRange> {
    const REACH: f64 = 3.0;
    reading.range += (position - to).norm() - (position - from).norm();
    (0.0..REACH).contains(&reading.range).then_some(reading)
}
