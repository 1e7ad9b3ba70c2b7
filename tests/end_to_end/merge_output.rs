//! What a merge writes: the merged map, the frames, every intermediate result, and the input as it was.

use crate::support::{gridweave, simulate};
use gridweave_runtime::ros::{OccupancyGrid, RobotFrames, TFMessage, decode};
use std::collections::BTreeMap;
use std::path::Path;
use tempfile::TempDir;

/// For every topic of a log, its messages in order.
fn messages(log: &Path) -> BTreeMap<String, Vec<Vec<u8>>> {
    let bytes = std::fs::read(log).unwrap();
    let mut messages: BTreeMap<String, Vec<Vec<u8>>> = BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        messages.entry(message.channel.topic.clone()).or_default().push(message.data.into_owned());
    }
    messages
}

#[test]
fn results_stand_beside_the_input_as_it_was() {
    let folder = TempDir::new().unwrap();
    let (input, truth) = simulate(folder.path(), "in.mcap", &["--robots", "2", "--seed", "2"]);
    let args = ["merge", "in.mcap", "-o", "out.mcap", "--summary", "summary.json"];
    gridweave(folder.path(), &args).assert(0, &["merged 2 of 2 robots"]);
    let truth = ["evaluate", "summary.json", "--truth", truth.to_str().unwrap()];
    gridweave(folder.path(), &truth).assert(0, &["right 1, wrong 0, refused 0"]);

    let (before, after) = (messages(&input), messages(&folder.path().join("out.mcap")));
    for (topic, expected) in &before {
        assert!(after[topic] == *expected, "{topic} is not as it was");
    }

    let map: OccupancyGrid<'_> = decode(after["/map"].last().unwrap()).unwrap();
    assert_eq!(map.header.frame_id, "world");
    assert!(map.cells().contains(&-1) && map.cells().iter().any(|cell| *cell > 64));
    let transforms: TFMessage = decode(after["/tf_static"].last().unwrap()).unwrap();
    let frames: Vec<(&str, &str)> =
        transforms.transforms.iter().map(|t| (t.header.frame_id.as_str(), t.child_frame_id.as_str())).collect();
    assert_eq!(frames, [("world", "robot1/map"), ("world", "robot2/map")]);
    let frames: RobotFrames = decode(after["/robot_frames"].last().unwrap()).unwrap();
    assert_eq!((frames.reference.as_str(), frames.frames.len(), frames.unmerged.len()), ("robot1", 2, 0));

    // Each map that is picked has its walls found once, and no other map's are found again for it.
    for robot in ["robot1", "robot2"] {
        let maps = before[&format!("/{robot}/map")].len();
        let picked = after[&format!("/{robot}/lines/segments")].len();
        assert!((1..=maps).contains(&picked), "{picked} of {maps}");
        assert_eq!(after[&format!("/{robot}/quadrants/direction")].len(), picked);
    }
}

#[test]
fn the_input_is_left_out_on_demand() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "in.mcap", &["--robots", "2"]);
    gridweave(folder.path(), &["merge", "in.mcap", "-o", "out.mcap", "--results-only"]).assert(0, &[]);
    let after = messages(&folder.path().join("out.mcap"));
    assert!(after.contains_key("/map") && after.contains_key("/robot1/lines/segments"));
    assert!(!after.contains_key("/robot1/map") && !after.contains_key("/robot1/pose"));
}

#[test]
fn one_log_for_each_robot_is_as_good_as_one_for_all() {
    let folder = TempDir::new().unwrap();
    simulate(folder.path(), "all.mcap", &["--robots", "2"]);
    let bytes = std::fs::read(folder.path().join("all.mcap")).unwrap();
    for robot in ["robot1", "robot2"] {
        let file = std::fs::File::create(folder.path().join(format!("{robot}.mcap"))).unwrap();
        let mut writer = mcap::Writer::new(std::io::BufWriter::new(file)).unwrap();
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            let message = message.unwrap();
            if message.channel.topic.starts_with(&format!("/{robot}/")) {
                writer.write(&message).unwrap();
            }
        }
        writer.finish().unwrap();
    }
    let merge = |inputs: &[&str], output: &str| {
        let args: Vec<&str> = [&["merge"], inputs, &["-o", output, "--results-only"]].concat();
        gridweave(folder.path(), &args).assert(0, &["merged 2 of 2"]);
        messages(&folder.path().join(output))
    };
    let (apart, together) = (merge(&["robot1.mcap", "robot2.mcap"], "a.mcap"), merge(&["all.mcap"], "b.mcap"));
    assert!(apart == together);
}

#[test]
fn the_demo_leaves_what_it_promises() {
    let folder = TempDir::new().unwrap();
    gridweave(folder.path(), &["demo", "--out", "demo"]).assert(0, &["right 2, wrong 0, refused 0"]);
    for file in ["merged.mcap", "merged.png", "merged.pgm", "merged.yaml", "summary.json"] {
        assert!(std::fs::metadata(folder.path().join("demo").join(file)).unwrap().len() > 50, "{file}");
    }
}
