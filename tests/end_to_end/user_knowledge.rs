//! Poses that the user knows decide between hypotheses where the maps alone do not.

use crate::support::{SimulatedWorld, gridweave};
use gridweave_logs::summary::Frame;
use std::fs;

/// Two robots in a building that looks the same after half a turn, without tags.
fn symmetric_world() -> SimulatedWorld {
    SimulatedWorld::new("905", &["tags=0", "snapshots=1", "overlap=1.0", "clutter=0.0", "layout=\"symmetric\""])
}

#[test]
fn an_initial_pose_distinguishes_one_end_of_a_building_from_the_other() {
    let world = symmetric_world();
    world.merge(&[]).assert(3, &["the maps fit at 2 poses", "try: --accept robot2=N", "--initial robot2=X,Y,YAW"]);
    let Frame { x, y, yaw, .. } = world.truth();
    let initial = format!("robot2={},{},{}", x + 0.8, y - 0.6, yaw + 0.2);
    for engine in ["threads", "processes"] {
        let more = ["--reference", "robot1", "--initial", &initial, "--engine", engine];
        world.merge(&more).assert(0, &["merged 2 of 2 robots"]);
        assert!(world.error() < 0.2, "{} m", world.error());
    }
    // Both in a frame of their own, and by a pipeline file.
    let merge = gridweave(world.folder.path(), &["graph", "auto_merge", "--format", "toml"]);
    let known = format!(
        "{}\n[robots.robot1]\ninitial = {{ x = 0.0, y = 0.0, yaw = 0.0 }}\n[robots.robot2]\ninitial = {{ x = {x}, y = {y}, yaw = {yaw} }}\n",
        merge.stdout
    );
    fs::write(world.folder.path().join("known.toml"), known).unwrap();
    let args = ["run", "known.toml", "-i", "in.mcap", "-o", "out.mcap", "--summary", "summary.json"];
    gridweave(world.folder.path(), &args).assert(0, &["merged 2 of 2 robots"]);
    assert!(world.error() < 0.2, "{} m", world.error());

    let far = format!("robot2={},{},{}", x + 9.0, y, yaw);
    world.merge(&["--reference", "robot1", "--initial", &far]).assert(3, &["not merged: robot2", "initial poses"]);
    world.merge(&["--initial", &initial]).assert(2, &["the initial pose of `robot2` alone", "name the reference"]);
    world.merge(&["--initial", "robot2=1,2"]).assert(2, &["expected 3 to 5 numbers, found 2"]);
}

#[test]
fn a_place_that_was_listed_is_accepted_when_the_user_says_so() {
    let world = symmetric_world();
    let errors = ["1", "2"].map(|number| {
        let headline = format!("hypothesis {number} of 2, chosen by the user");
        world.merge(&["--accept", &format!("robot2={number}")]).assert(0, &["merged 2 of 2 robots", &headline]);
        assert!(world.summary().alignments[0].score < 0.999);
        world.error()
    });
    assert!(errors[0].min(errors[1]) < 0.2 && errors[0].max(errors[1]) > 5.0, "{errors:?}");
    world.merge(&["--accept", "robot1/robot2=1"]).assert(0, &["merged 2 of 2 robots"]);
    world.merge(&["--accept", "robot2=3"]).assert(3, &["hypothesis 3 was chosen, but there are only 2"]);
    world.merge(&["--accept", "robot7=1"]).assert(3, &["`robot7` matches no pair of robots"]);
    for wrong in ["robot2", "robot2=0", "robot2=first"] {
        world.merge(&["--accept", wrong]).assert(2, &["write ROBOT=N", "ROBOT=initial"]);
    }
    let initial = ["--reference", "robot1", "--initial", "robot2=5,6,0.5", "--accept", "robot2=initial"];
    world.merge(&initial).assert(0, &["aligned by the initial poses, as the user chose"]);
    let Frame { x, y, yaw, .. } = world.summary().frames["robot2"];
    assert_eq!((x, y, yaw), (5.0, 6.0, 0.5));
}

#[test]
fn a_refusal_is_short_and_explained_in_full_on_demand() {
    let world = symmetric_world();
    let short = world.merge(&[]);
    short.assert(3, &["missing: a probability of 0.98"]);
    let refusal =
        short.stdout.lines().skip_while(|line| !line.starts_with("not merged")).take_while(|line| !line.is_empty());
    refusal.for_each(|line| assert!(line.len() <= 80, "{line}"));
    assert!(!short.stdout.contains("the maps alone"), "{}", short.stdout);
    world
        .merge(&["--explain", "robot2"])
        .assert(3, &["robot1 and robot2, refused with", "the maps alone", "by the tags"]);
    world.merge(&["--explain", "robot3"]).assert(1, &["there is no robot `robot3` to explain"]);
}
