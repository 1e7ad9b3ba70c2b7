//! Robots that localise in one map have nothing to merge.

use crate::support::{Ended, LogBuilder, TestMap, gridweave, json};
use gridweave_runtime::ros::{
    OccupancyGrid, Pose, PoseStamped, PoseWithCovarianceStamped, TFMessage, Transform, TransformStamped,
};
use gridweave_tests::header;
use nalgebra::{Isometry2, Vector2};
use serde_json::Value;
use tempfile::TempDir;

const SENTENCE: &str = "robot1 and robot2 localise in one map, `/map`, in frame `map`";

/// A map in the frame `map`.
fn grid(log: &mut LogBuilder, topic: &str) {
    let map = TestMap::flat();
    let bytes: Vec<u8> = map.cells.iter().map(|cell| *cell as u8).collect();
    log.message(0.0, topic, &OccupancyGrid { header: header(0.0, "map"), info: map.info, data: &bytes });
}

/// Poses of two robots by AMCL.
fn localised(log: &mut LogBuilder) {
    for second in 0..20 {
        for robot in ["robot1", "robot2"] {
            let at = f64::from(second);
            let pose = Pose::from(Isometry2::new(Vector2::new(1.0 + 0.1 * at, 2.0), 0.0));
            let pose = PoseWithCovarianceStamped::from(PoseStamped { header: header(at, "map"), pose });
            log.message(at, &format!("/{robot}/amcl_pose"), &pose);
        }
    }
}

/// The same in tf. Each robot's frames have its name and `separator` before them, or else its transforms are on a topic of
/// its own.
fn localised_in_tf(log: &mut LogBuilder, separator: Option<char>) {
    for second in 0..20 {
        for robot in ["robot1", "robot2"] {
            let at = f64::from(second);
            let edge = |parent: &str, child: &str| TransformStamped {
                header: header(at, parent),
                child_frame_id: child.into(),
                transform: Transform::default(),
            };
            let (topic, prefix) = match separator {
                Some(separator) => ("/tf".into(), format!("{robot}{separator}")),
                None => (format!("/{robot}/tf"), String::new()),
            };
            let [odom, base] = ["odom", "base_link"].map(|frame| format!("{prefix}{frame}"));
            log.message(at, &topic, &TFMessage { transforms: vec![edge(&odom, &base), edge("map", &odom)] });
        }
    }
}

fn write(folder: &TempDir, fill: impl FnOnce(&mut LogBuilder)) {
    let mut log = LogBuilder::new(&folder.path().join("in.mcap"));
    fill(&mut log);
    log.finish();
}

fn merge(folder: &TempDir) -> Ended {
    gridweave(folder.path(), &["merge", "in.mcap", "-o", "out.mcap", "--summary", "out.json"])
}

fn assert_says_nothing_of_tags(ended: &Ended) {
    assert!(!ended.text().contains("tag in common") && !ended.text().contains("no map was found"), "{ended:#?}");
}

#[test]
fn of_robots_that_localise_in_one_map_it_is_said_that_nothing_is_to_be_merged() {
    let folder = TempDir::new().unwrap();
    let ways: [&dyn Fn(&mut LogBuilder); 4] = [
        &localised,
        &|log| localised_in_tf(log, Some('/')),
        &|log| localised_in_tf(log, None),
        // Nothing but the frames in tf names the robots.
        &|log| localised_in_tf(log, Some('_')),
    ];
    for (way, has_costmap) in ways.into_iter().zip([true, true, true, false]) {
        write(&folder, |log| {
            grid(log, "/map");
            if has_costmap {
                grid(log, "/robot1/global_costmap/costmap");
            }
            way(log);
        });
        let ended = merge(&folder);
        ended.assert(3, &["not merged: robot1: ", "not merged: robot2: ", SENTENCE, "there is nothing to merge"]);
        assert_says_nothing_of_tags(&ended);
        let summary: Value = json(&folder.path().join("out.json"));
        assert!(summary["unmerged"]["robot2"].as_str().unwrap().starts_with(SENTENCE), "{summary}");
        let info = gridweave(folder.path(), &["info", "in.mcap"]);
        info.assert(0, &[SENTENCE, "there is nothing to merge"]);
        assert!(!info.text().contains("no map was recognised"), "{info:#?}");
    }
    let map = gridweave(folder.path(), &["merge", "in.mcap", "-o", "merged.yaml"]);
    map.assert(1, &["there is no merged map to write", SENTENCE]);
}

#[test]
fn robots_with_maps_of_their_own_beside_those_in_one_map_are_merged() {
    let folder = TempDir::new().unwrap();
    write(&folder, |log| {
        grid(log, "/map");
        localised(log);
        log.map(0.0, "robot3", &TestMap::flat()).map(0.0, "robot4", &TestMap::flat());
    });
    let ended = merge(&folder);
    ended.assert(3, &["merged 2 of 4 robots; map frames in the frame of robot3", "not merged: robot1: ", SENTENCE]);
    assert_says_nothing_of_tags(&ended);
}

#[test]
fn a_map_beside_robots_with_maps_of_their_own_is_no_map_in_which_they_localise() {
    let folder = TempDir::new().unwrap();
    write(&folder, |log| {
        grid(log, "/map");
        localised(log);
        log.map(0.0, "robot1", &TestMap::flat()).map(0.0, "robot2", &TestMap::flat());
    });
    let ended = merge(&folder);
    ended.assert(0, &["merged 2 of 2"]);
    assert!(!ended.text().contains("localise in one map"), "{ended:#?}");
    // On another topic, the maps are still theirs.
    write(&folder, |log| {
        ["/map", "/robot1/grid", "/robot2/grid"].into_iter().for_each(|topic| grid(log, topic));
        localised(log);
    });
    let info = gridweave(folder.path(), &["info", "in.mcap"]);
    assert!(!info.text().contains("localise in one map"), "{info:#?}");
    let ended = merge(&folder);
    ended.assert(3, &["robot1 and robot2 have sent no map", "it has sent no map"]);
}

#[test]
fn a_merged_map_of_another_program_is_left_out_and_the_map_of_a_drone_in_the_world_is_kept() {
    let folder = TempDir::new().unwrap();
    let map = TestMap::flat();
    let cells: Vec<u8> = map.cells.iter().map(|cell| *cell as u8).collect();
    let write = |other: &str, frame: &str, is_posed: bool| {
        write(&folder, |log| {
            for robot in ["robot1", "robot2"] {
                log.map(0.0, robot, &map).pose(1.0, robot, 1.0, 2.0).pose(2.0, robot, 2.0, 2.0);
            }
            let grid = OccupancyGrid { header: header(1.5, frame), info: map.info, data: &cells };
            log.message(1.5, &format!("/{other}/map"), &grid);
            if is_posed {
                log.pose(2.0, other, 1.0, 2.0);
            }
        });
    };
    let left_out = "maps on `/base/map` are merged ones of another program, and are not taken as a robot's; if they are a \
                    robot's, give --robots base,robot1,robot2";
    write("base", "robot1/map", false);
    merge(&folder).assert(0, &["merged 2 of 2", left_out]);
    gridweave(folder.path(), &["info", "in.mcap"]).assert(0, &[left_out]);
    let with_base = ["merge", "in.mcap", "-o", "out.mcap", "--robots", "base,robot1,robot2"];
    gridweave(folder.path(), &with_base).assert(0, &["merged 3 of 3"]);
    write("drone", "world", true);
    let ended = merge(&folder);
    ended.assert(0, &["merged 3 of 3"]);
    assert!(!ended.text().contains("merged ones"), "{ended:#?}");
}
