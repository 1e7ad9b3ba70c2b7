//! Which maps are passed on.

use super::{MapSelectorParameters, changed_cells, kind, known_cells};
use crate::shared::geometry::{Grid, GridGeometry, UNKNOWN, pose};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, MapMetaData, OccupancyGrid, decode};
use gridweave_runtime::stage::{Parameters, StageHarness};
use proptest::prelude::*;

/// A map of `width` x 10 cells, known in the first `known` columns, whose corner lies `column` cells to the right.
fn map(column: i32, width: usize, known: usize) -> (GridGeometry, Vec<i8>) {
    let origin = pose(1.0, 2.0, 0.3) * pose(0.05 * f64::from(column), 0.0, 0.0);
    let value = |index: usize| if index % width < known { 0 } else { UNKNOWN };
    (GridGeometry { width, height: 10, resolution: 0.05, origin }, (0..width * 10).map(value).collect())
}

/// The changed cells as a share of those known before; infinite if the cells do not coincide.
fn share(before: &(GridGeometry, Vec<i8>), after: &(GridGeometry, Vec<i8>)) -> f64 {
    let changed = changed_cells(&Grid::new(before.0, &before.1).unwrap(), &Grid::new(after.0, &after.1).unwrap());
    let share = |changed| if changed == 0 { 0.0 } else { changed as f64 / known_cells(&before.1) as f64 };
    changed.map_or(f64::INFINITY, share)
}

#[test]
fn what_has_changed_is_a_share_of_what_was_known() {
    assert_eq!(share(&map(0, 40, 20), &map(0, 40, 20)), 0.0);
    assert_eq!(share(&map(0, 40, 20), &map(0, 40, 25)), 0.25);
    assert_eq!(share(&map(0, 40, 20), &map(0, 60, 30)), 0.5, "the grid has grown");
    assert_eq!(share(&map(0, 40, 20), &map(-10, 60, 30)), 0.5, "and to the other side");
    assert_eq!(share(&map(0, 40, 20), &map(100, 40, 20)), 2.0, "nothing in common");
    assert_eq!(share(&map(0, 40, 0), &map(0, 40, 1)), f64::INFINITY);
    assert_eq!(share(&map(0, 40, 0), &map(5, 40, 0)), 0.0);
}

#[test]
fn maps_whose_cells_do_not_coincide_have_changed_altogether() {
    let (before, (geometry, cells)) = (map(0, 40, 20), map(0, 40, 20));
    for other in [
        GridGeometry { resolution: 0.1, ..geometry },
        GridGeometry { origin: geometry.origin * pose(0.02, 0.0, 0.0), ..geometry },
        GridGeometry { origin: geometry.origin * pose(0.0, 0.0, 0.01), ..geometry },
    ] {
        assert_eq!(share(&before, &(other, cells.clone())), f64::INFINITY);
    }
}

#[test]
fn how_probable_an_obstacle_is_does_not_count() {
    let (geometry, cells) = map(0, 40, 20);
    let other = cells.iter().map(|value| if *value == 0 { 3 } else { *value }).collect();
    assert_eq!(share(&(geometry, cells.clone()), &(geometry, other)), 0.0);
    let wall = cells.iter().map(|value| if *value == 0 { 100 } else { *value }).collect();
    assert_eq!(share(&(geometry, cells), &(geometry, wall)), 1.0);
}

/// The indices of the maps of two robots, in turn, that are passed on if they know so many columns; and at the end.
fn passed_on(known: &[usize], min_change: f64) -> (Vec<usize>, Vec<usize>) {
    let mut stage = StageHarness::new(&kind(), &format!("min_change = {min_change:?}")).unwrap();
    let take = |stage: &mut StageHarness| -> Vec<usize> {
        let sent = stage.take_messages("map");
        sent.iter().map(|map| decode::<OccupancyGrid<'_>>(map.bytes()).unwrap().header.stamp.sec as usize).collect()
    };
    for (number, known) in known.iter().enumerate() {
        let (geometry, cells) = map(0, 40, *known);
        let info = MapMetaData {
            resolution: 0.05,
            width: 40,
            height: 10,
            origin: geometry.origin.into(),
            ..Default::default()
        };
        let data: Vec<u8> = cells.iter().map(|value| *value as u8).collect();
        let header = Header::new(LogTime(number as u64 * 1_000_000_000), "map");
        let robot = ["a", "b"][number % 2];
        let map = OccupancyGrid { header, info, data: &data };
        stage.give::<OccupancyGrid<'_>>("map", robot, LogTime(number as u64), &map).unwrap();
    }
    let during = take(&mut stage);
    stage.finish(LogTime(1000)).unwrap();
    (during, take(&mut stage))
}

#[test]
fn the_first_map_each_that_has_changed_and_the_last_are_passed_on() {
    let known = [10, 20, 11, 20, 14, 20, 15, 31, 16, 32];
    assert_eq!(passed_on(&known, 0.5), (vec![0, 1, 6, 7], vec![8, 9]));
    assert_eq!(passed_on(&known, 0.0), ((0..10).collect(), vec![]));
    assert_eq!(passed_on(&[10, 20], 0.5), (vec![0, 1], vec![]), "none is passed on twice");
}

#[test]
fn a_last_map_that_is_much_smaller_than_an_earlier_one_is_a_warning() {
    let warnings = |known: &[usize]| {
        let mut stage = StageHarness::new(&kind(), "").unwrap();
        for (number, known) in (1..).zip(known) {
            let (_, cells) = map(0, 40, *known);
            let info = MapMetaData { resolution: 0.05, width: 40, height: 10, ..Default::default() };
            let data: Vec<u8> = cells.iter().map(|value| *value as u8).collect();
            let map = OccupancyGrid { info, data: &data, ..Default::default() };
            stage.give::<OccupancyGrid<'_>>("map", "a", LogTime::MIN.plus_seconds(f64::from(number)), &map).unwrap();
        }
        stage.finish(LogTime::MIN.plus_seconds(9.0)).unwrap();
        stage.warnings().keys().cloned().collect::<Vec<_>>()
    };
    assert_eq!(warnings(&[10, 20, 18, 11]), [""; 0]);
    let started_again = warnings(&[10, 20, 2, 9]);
    assert!(
        started_again[0].contains("a shows 0.2 square metres, and that of 7 s before the end showed 0.5"),
        "{started_again:?}"
    );
}

#[test]
fn an_invalid_map_is_passed_on_so_that_its_robot_is_known() {
    let mut stage = StageHarness::new(&kind(), "").unwrap();
    let info = MapMetaData { resolution: 0.05, width: 40, height: 10, ..Default::default() };
    let too_short = OccupancyGrid { info, data: &[0; 7], ..Default::default() };
    stage.give::<OccupancyGrid<'_>>("map", "a", LogTime(0), &too_short).unwrap();
    assert_eq!((stage.take_messages("map").len(), stage.warnings().len()), (1, 1));
    stage.finish(LogTime(1)).unwrap();
    assert_eq!(stage.take_messages("map").len(), 0);
}

proptest! {
    #[test]
    fn waiting_changes_are_less_than_min_change_and_the_last_map_is_never_lost(
        known in prop::collection::vec(0usize..40, 1..30), min_change in 0.0..2.0,
    ) {
        let (during, last) = passed_on(&known, min_change);
        for robot in 0..2 {
            let of_robot = |numbers: &[usize]| -> Vec<usize> {
                numbers.iter().copied().filter(|number| number % 2 == robot).collect()
            };
            let (during, last, all) = (of_robot(&during), of_robot(&last), of_robot(&(0..known.len()).collect::<Vec<_>>()));
            prop_assert_eq!(last.last().or(during.last()), all.last());
            for number in all {
                let before = during.iter().copied().rfind(|passed| *passed <= number).unwrap();
                let changed = share(&map(0, 40, known[before]), &map(0, 40, known[number]));
                prop_assert!(changed < min_change || changed == 0.0 || before == number, "{changed}");
            }
        }
    }
}

#[test]
fn nonsense_is_no_share() {
    assert!(MapSelectorParameters::default().check().is_empty());
    assert_eq!(MapSelectorParameters { min_change: f64::NAN }.check().len(), 1);
}
