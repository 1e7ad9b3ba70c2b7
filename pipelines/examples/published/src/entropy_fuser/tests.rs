//! The filter, maps on one lattice, and the stage from outside.

use super::*;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{OccupancyGrid, RobotFrame, RobotFrames};
use gridweave_runtime::stage::{Parameters, StageHarness};
use gridweave_stages::shared::geometry::{Grid, GridGeometry, pose};
use gridweave_stages::shared::log_odds::{LogOdds, entropy};
use proptest::prelude::*;

fn geometry(width: usize, height: usize, x: f64, y: f64) -> GridGeometry {
    GridGeometry { width, height, resolution: 0.05, origin: pose(x, y, 0.0) }
}

fn table() -> LogOdds {
    LogOdds::new(0.1192, 0.971)
}

proptest! {
    #[test]
    fn what_is_kept_is_never_less_certain_than_the_better_input(a in -4f32..4.0, b in -4f32..4.0) {
        let (fused, best) = (entropy_filter(a, b), entropy(a.into()).min(entropy(b.into())));
        prop_assert!(entropy(fused.into()) <= best + 1e-6);
        let sum_is_better = entropy((a + b).into()) <= best;
        let better = if b.abs() > a.abs() { b } else { a };
        prop_assert_eq!(fused, if sum_is_better { a + b } else { better });
    }

    #[test]
    fn two_maps_give_the_same_in_either_order_unless_they_are_as_certain_of_the_opposite(a in -4f32..4.0, b in -4f32..4.0) {
        prop_assume!(a.abs() != b.abs());
        prop_assert_eq!(entropy_filter(a, b), entropy_filter(b, a));
    }
}

#[test]
fn agreement_adds_and_of_a_contradiction_the_more_certain_side_is_kept() {
    assert_eq!(entropy_filter(1.0, 0.5), 1.5);
    assert_eq!(entropy_filter(-1.0, -0.5), -1.5);
    assert_eq!(entropy_filter(3.0, -2.0), 3.0);
    assert_eq!(entropy_filter(1.0, -2.0), -2.0);
    assert_eq!(entropy_filter(2.0, 0.0), 2.0);
    assert_eq!((entropy_filter(2.0, -2.0), entropy_filter(-2.0, 2.0)), (2.0, -2.0), "the first counts");
}

#[test]
fn maps_are_fused_at_their_positions() {
    let (a, b) = ([100, 0, 70, -1], [0, 70, 100, -1, 30, -1]);
    let a = Grid::new(geometry(4, 1, 0.0, 0.0), &a).unwrap();
    // One column right of the first, and one row below.
    let b = Grid::new(geometry(3, 2, 0.05, -0.05), &b).unwrap();
    let (over, takes_part) = common_grid(&[a, b], 1000);
    let over = over.unwrap();
    assert_eq!((over.width, over.height, takes_part), (4, 2, vec![Ok(()); 2]));
    let mut fused = vec![7; 8];
    fuse(&[a, b], &over, &table(), &mut fused);
    // 70 and 30 add up to nothing, and the first counts.
    assert_eq!(fused, [-1, 0, 70, 100, 100, 0, 70, -1]);
}

#[test]
fn a_map_off_the_lattice_is_left_out() {
    let a = Grid::new(geometry(4, 2, 0.0, 0.0), &[0; 8]).unwrap();
    let with = |change: &dyn Fn(&mut GridGeometry)| {
        let mut geometry = geometry(4, 2, 0.1, 0.0);
        change(&mut geometry);
        let b = Grid { geometry, cells: &[100; 8] };
        common_grid(&[a, b], 1000).1[1]
    };
    assert_eq!(with(&|_| ()), Ok(()));
    assert_eq!(with(&|geometry| geometry.origin = pose(0.11, 0.0, 0.0)), Err(LeftOut::OtherLattice));
    assert_eq!(with(&|geometry| geometry.origin = pose(0.1, 0.0, 0.1)), Err(LeftOut::OtherLattice));
    assert_eq!(with(&|geometry| geometry.origin = pose(f64::NAN, 0.0, 0.0)), Err(LeftOut::OtherLattice));
    assert_eq!(with(&|geometry| geometry.origin = pose(1e300, 0.0, 0.0)), Err(LeftOut::OtherLattice));
    assert_eq!(with(&|geometry| geometry.resolution = 0.06), Err(LeftOut::OtherLattice));
    assert_eq!(with(&|geometry| geometry.origin = pose(50.0, 50.0, 0.0)), Err(LeftOut::TooLarge(1000.0)));
    let far = Grid { geometry: geometry(4, 2, 5e4, 5e4), cells: &[100; 8] };
    assert!(
        matches!(common_grid(&[a, far], 4_000_000_000).1[1], Err(LeftOut::TooLarge(_))),
        "next to nothing is known"
    );
    assert_eq!(common_grid(&[], 1000), (None, vec![]));
}

/// A stage that is given maps of two cells, and what it sends.
struct Run(StageHarness);

impl Run {
    fn map(&mut self, time: u64, robot: &str, cells: &[u8]) -> Vec<Vec<i8>> {
        let geometry = geometry(cells.len(), 1, 0.0, 0.0);
        let message = OccupancyGrid { info: geometry.meta_data(Default::default()), data: cells, ..Default::default() };
        self.0.give::<OccupancyGrid<'_>>("map", robot, LogTime(time), &message).unwrap();
        self.sent()
    }

    fn frames(&mut self, time: u64, robots: &[&str]) -> Vec<Vec<i8>> {
        let frame = |robot: &&str| RobotFrame { robot: (*robot).into(), ..Default::default() };
        let frames = robots.iter().map(frame).collect();
        let message = RobotFrames { reference: "b".into(), frames, ..Default::default() };
        self.0.give::<RobotFrames>("frames", "", LogTime(time), &message).unwrap();
        self.sent()
    }

    fn sent(&mut self) -> Vec<Vec<i8>> {
        let messages = self.0.take_messages("map");
        messages.iter().map(|message| message.decode::<OccupancyGrid<'_>>().unwrap().cells().to_vec()).collect()
    }
}

#[test]
fn the_stage_fuses_the_maps_of_one_time_once_and_the_reference_counts_first() {
    let mut run = Run(StageHarness::new(&kind(), "").unwrap());
    assert_eq!(run.map(1, "a", &[30, 100]), [[0; 0]; 0]);
    assert_eq!(run.map(1, "b", &[70, 255]), [[0; 0]; 0]);
    assert_eq!(run.frames(1, &["a", "b"]), [[70, 100]], "b is the reference");
    assert_eq!(run.frames(1, &["a", "b"]), [[0; 0]; 0], "nothing has changed");
    assert_eq!(run.map(2, "a", &[30, 0]), [[0; 0]; 0], "frames may follow");
    assert_eq!(run.map(3, "b", &[70, 255]), [[70, 0]], "none have");
    assert_eq!(run.frames(3, &["b"]), [[70, -1]], "a is no longer placed");
    run.map(4, "b", &[0, 0]);
    run.0.finish(LogTime(5)).unwrap();
    assert_eq!(run.sent(), [[0, 0]]);
}

#[test]
fn a_map_that_is_left_out_is_reported() {
    let mut run = Run(StageHarness::new(&kind(), "max_cells = 3").unwrap());
    run.map(1, "b", &[0, 0]);
    run.map(1, "a", &[0, 0, 0, 100]);
    assert_eq!(run.frames(1, &["a", "b"]), [[0, 0]]);
    assert!(run.0.warnings().keys().any(|text| text.contains("the map of a is not in the fused one")));
}

#[test]
fn parameters_out_of_range_are_refused() {
    assert!(EntropyFuserParameters::default().check().is_empty());
    let wrong = EntropyFuserParameters { min_probability: 0.6, max_cells: 0, ..Default::default() };
    assert_eq!(wrong.check().len(), 2);
}
