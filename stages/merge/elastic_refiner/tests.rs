//! The stage with drawn maps.

use super::kind;
use crate::shared::geometry::UNKNOWN;
use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, MapDeformation, OccupancyGrid, RobotFrame, RobotFrames};
use gridweave_runtime::stage::StageHarness;

/// A stage that has received two maps and their frames.
fn stage(parameters: &str, map_b: &[i8]) -> (StageHarness, DrawnMap, RobotFrames) {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let mut stage = StageHarness::new(&kind(), parameters).unwrap();
    for (robot, cells) in [("robot1", &map.cells[..]), ("robot2", map_b)] {
        let data: Vec<u8> = cells.iter().map(|cell| *cell as u8).collect();
        let header = Header { frame_id: format!("{robot}/map"), ..Default::default() };
        let message = OccupancyGrid { header, info: map.info(), data: &data };
        stage.give::<OccupancyGrid<'_>>("map", robot, LogTime(1), &message).unwrap();
    }
    let frame = |robot: &str| RobotFrame { robot: robot.into(), ..Default::default() };
    let frames = RobotFrames {
        reference: "robot1".into(),
        frames: vec![frame("robot1"), frame("robot2")],
        ..Default::default()
    };
    stage.give::<RobotFrames>("frames", "", LogTime(2), &frames).unwrap();
    (stage, map, frames)
}

#[test]
fn a_map_that_comes_last_is_aligned_as_if_all_had_come_at_once() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let deformed = |most: f64| map.deformed(most).cells;
    let maps = [map.cells.clone(), deformed(0.2), deformed(-0.25), deformed(0.3)];
    let names = ["robot1", "robot2", "robot3", "robot4"];
    let frame = |robot: &&str| RobotFrame { robot: (*robot).to_owned(), ..Default::default() };
    let frames_of = |count: usize| RobotFrames {
        reference: "robot1".into(),
        frames: names[..count].iter().map(frame).collect(),
        ..Default::default()
    };
    // One stage gets the last robot after it has deformed the others, one gets all at once. The last map is a quarter of
    // all, so one of them estimates all together again, and in another the others stay as they are.
    let runs = [("min_growth = 0.2", [3, 4]), ("min_growth = 0.3", [3, 4]), ("", [4, 4])];
    let [together, alone, at_once] = runs.map(|(parameters, counts)| {
        let mut stage = StageHarness::new(&kind(), parameters).unwrap();
        for (name, cells) in names.iter().zip(&maps) {
            let data: Vec<u8> = cells.iter().map(|cell| *cell as u8).collect();
            let header = Header { frame_id: format!("{name}/map"), ..Default::default() };
            let message = OccupancyGrid { header, info: map.info(), data: &data };
            stage.give::<OccupancyGrid<'_>>("map", name, LogTime(1), &message).unwrap();
        }
        for count in counts {
            stage.take::<MapDeformation>("deformation").unwrap();
            stage.give::<RobotFrames>("frames", "", LogTime(2), &frames_of(count)).unwrap();
        }
        let while_it_runs: Vec<MapDeformation> = stage.take("deformation").unwrap();
        stage.finish(LogTime(3)).unwrap();
        (while_it_runs, stage.take::<MapDeformation>("deformation").unwrap())
    });
    assert!(at_once.0.is_empty() && at_once.1.is_empty(), "nothing has changed since");
    // Where the others stay, the last one gives way for them.
    for ((from_known, at_the_end), sent, most) in [(together, &names[..], 0.05), (alone, &names[3..], 0.1)] {
        assert!(from_known.iter().map(|message| &message.robot).eq(sent), "{}", from_known.len());
        assert_eq!(at_the_end.len(), 4, "it starts again at the end");
        for (one, other) in from_known.iter().rev().zip(at_the_end.iter().rev()) {
            assert!(one.sharpness.apart < 0.03 && one.sharpness.doubled < 0.03, "{:?}", one.sharpness);
            let pairs = one.nodes.iter().zip(&other.nodes);
            let apart = pairs.map(|(one, other)| (one.dx - other.dx).hypot(one.dy - other.dy)).fold(0.0, f64::max);
            assert!(apart > 0.0 && apart < most, "{}: {apart}", one.robot);
        }
    }
}

#[test]
fn frames_that_change_little_go_through_and_are_bent_anew_at_the_end() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let (mut stage, _, mut frames) = stage("", &map.deformed(0.2).cells);
    stage.take::<MapDeformation>("deformation").unwrap();
    stage.take::<RobotFrames>("frames").unwrap();
    for (x, count) in [(0.05, 0), (0.3, 2), (0.33, 0)] {
        frames.frames[1].x = x;
        stage.give::<RobotFrames>("frames", "", LogTime(3), &frames).unwrap();
        assert_eq!(stage.take::<MapDeformation>("deformation").unwrap().len(), count, "{x}");
        assert_eq!(stage.take::<RobotFrames>("frames").unwrap(), [frames.clone()]);
    }
    stage.finish(LogTime(4)).unwrap();
    assert_eq!(stage.take::<MapDeformation>("deformation").unwrap().len(), 2);
}

#[test]
fn maps_that_have_grown_are_bent_anew_when_frames_come() {
    let map = FloorPlan::office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
    let width = map.info().width as usize;
    let of_half = |(index, cell): (usize, &i8)| if index % width < width / 2 { *cell } else { UNKNOWN };
    let half: Vec<i8> = map.cells.iter().enumerate().map(of_half).collect();
    for (parameters, count) in [("", 2), ("min_growth = 10.0", 0)] {
        let (mut stage, map, frames) = stage(parameters, &half);
        stage.take::<MapDeformation>("deformation").unwrap();
        let data: Vec<u8> = map.cells.iter().map(|cell| *cell as u8).collect();
        let message = OccupancyGrid { info: map.info(), data: &data, ..Default::default() };
        stage.give::<OccupancyGrid<'_>>("map", "robot2", LogTime(3), &message).unwrap();
        stage.give::<RobotFrames>("frames", "", LogTime(4), &frames).unwrap();
        assert_eq!(stage.take::<MapDeformation>("deformation").unwrap().len(), count, "{parameters}");
    }
}
