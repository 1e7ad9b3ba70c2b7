//! Robots in one building, and how many searches they take.

use super::{MergePlan, PairReport};
use crate::registration::search::MapAlignerParameters;
use crate::registration::search::tests::angular_office;
use crate::shared::geometry::Grid;
use crate::shared::robot_pair::RobotPair;
use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, apart, drawing, seen};
use gridweave_runtime::stage::InitialPoses;
use std::collections::{BTreeMap, BTreeSet};

/// A plan that receives maps one by one.
struct Bench {
    plan: MergePlan,
    reported: Vec<PairReport>,
    maps: BTreeMap<String, DrawnMap>,
}

impl Bench {
    fn new() -> Self {
        let plan = MergePlan::new(MapAlignerParameters::default(), InitialPoses::new());
        Self { plan, reported: Vec::new(), maps: BTreeMap::new() }
    }

    fn give(&mut self, robot: &str, map: DrawnMap) {
        self.maps.insert(robot.to_owned(), map);
        let grids: BTreeMap<String, Grid<'_>> =
            self.maps.iter().map(|(robot, map)| (robot.clone(), map.view().grid)).collect();
        self.reported.extend(self.plan.update(robot, &grids));
    }

    fn finish(mut self) -> Self {
        self.reported.extend(self.plan.finish());
        self
    }

    /// Latest report on each pair.
    fn last(&self) -> BTreeMap<RobotPair, &PairReport> {
        self.reported.iter().map(|reported| (reported.pair.clone(), reported)).collect()
    }

    /// The robots that hypotheses connect to the first one.
    fn tied(&self) -> BTreeSet<String> {
        let last = self.last();
        let mut tied: BTreeSet<String> = self.maps.keys().take(1).cloned().collect();
        for _ in 0..self.maps.len() {
            for (RobotPair { a, b }, reported) in &last {
                if reported.found.is_ok() && (tied.contains(a) || tied.contains(b)) {
                    tied.extend([a.clone(), b.clone()]);
                }
            }
        }
        tied
    }

    #[track_caller]
    fn assert_right(&self) {
        for (RobotPair { a, b }, reported) in self.last() {
            let Ok(found) = &reported.found else { continue };
            let (map_a, map_b) = (&self.maps[&a], &self.maps[&b]);
            let (metres, radians) = apart(&found[0].0.transform_a_b, &map_a.transform_to(map_b), map_b);
            assert!(metres < 0.3 && radians.to_degrees() < 1.5, "{a} {b}: {metres} m, {radians} rad: {found:?}");
        }
    }
}

/// A part of the office as one of several robots sees it.
fn part(number: usize) -> DrawnMap {
    let west = [-0.2, 4.0, 1.0, 6.0, 2.5, 5.0, 0.0, 3.0][number % 8];
    let own = f64::from(number as u8);
    angular_office().draw(seen(west, -0.2, west + 13.0, 12.2), drawing(own, 2.0 - own, 0.7 * own))
}

#[test]
fn robots_of_one_building_take_about_one_search_each() {
    let count = 8;
    let mut bench = Bench::new();
    for number in 0..count {
        bench.give(&format!("robot{number}"), part(number));
    }
    let bench = bench.finish();
    assert_eq!(bench.tied().len(), count, "{:?}", bench.last());
    bench.assert_right();
    assert!(bench.plan.searches < 3 * count as u64, "{} searches", bench.plan.searches);
    // There are more connections than a tree has, so that they can be checked against each other.
    let ties = bench.last().values().filter(|reported| reported.found.is_ok()).count();
    assert!(ties >= count + 2 && bench.plan.predictions as usize >= count, "{ties} ties");
}

#[test]
fn the_map_of_another_building_is_merged_with_no_other() {
    let mut bench = Bench::new();
    bench.give("robot0", part(0));
    bench.give("robot1", FloorPlan::another_office().draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(1.0, 1.0, 1.0)));
    bench.give("robot2", part(1));
    bench.give("robot3", part(2));
    let bench = bench.finish();
    let clear = |reported: &&PairReport| {
        // One hypothesis only, or a second one that is much worse.
        reported.found.as_ref().is_ok_and(|found| found.get(1).is_none_or(|(second, _)| second.share < 0.5))
    };
    let last = bench.last();
    let of_stranger = last.values().filter(|reported| reported.pair.concerns("robot1")).copied();
    assert_eq!(of_stranger.filter(clear).count(), 0, "{last:?}");
    let of_others = last.values().filter(|reported| !reported.pair.concerns("robot1")).copied();
    assert!(of_others.filter(clear).count() >= 2, "{last:?}");
}

#[test]
fn maps_are_searched_as_one_only_if_they_agree_in_nearly_all_of_much_wall() {
    let searches = |second: &FloorPlan, east: f64| {
        let mut bench = Bench::new();
        bench.give("robot0", angular_office().draw(seen(-0.2, -0.2, 20.2, 12.2), drawing(0.0, 0.0, 0.0)));
        bench.give("robot1", second.draw(seen(-0.2, -0.2, east, 12.2), drawing(3.0, 1.0, 1.0)));
        assert!(bench.last().values().all(|reported| reported.found.is_ok()), "the pose is reported in any case");
        bench.give("robot2", part(0));
        bench.plan.searches
    };
    let rebuilt = angular_office().with(&[[3.5, 9.0, 10.0, 9.0], [4.0, 5.0, 8.0, 5.0], [10.5, 1.0, 16.0, 1.0]]);
    assert_eq!(searches(&angular_office(), 20.2), 2, "the third map is searched on the first two at once");
    assert!(searches(&rebuilt, 20.2) > 2, "an eighth of the walls contradicts");
    assert!(searches(&angular_office(), 6.0) > 2, "there is little wall in common");
}

#[test]
fn in_which_order_two_maps_come_makes_no_difference() {
    let reported = |order: [usize; 2]| {
        let mut bench = Bench::new();
        order.into_iter().for_each(|number| bench.give(&format!("robot{number}"), part(number)));
        bench.finish().reported
    };
    let (forth, back) = (reported([0, 1]), reported([1, 0]));
    assert!(forth == back && forth.len() == 1 && forth[0].found.is_ok(), "{forth:?} {back:?}");
}

#[test]
fn a_map_that_has_grown_a_little_is_not_searched_again() {
    let office = angular_office();
    let draw = |east: f64| office.draw(seen(1.0, -0.2, east, 12.2), drawing(12.0, 6.0, 0.4));
    let mut bench = Bench::new();
    bench.give("robot0", part(0));
    bench.give("robot1", draw(16.0));
    assert_eq!(bench.plan.searches, 1);
    bench.give("robot1", draw(16.6));
    assert_eq!((bench.plan.searches, bench.reported.len()), (1, 2));
    bench.give("robot1", draw(20.2));
    assert_eq!(bench.plan.searches, 2);
    bench.assert_right();
}

#[test]
fn the_last_maps_are_searched_at_the_end_whatever_has_grown() {
    let office = angular_office();
    let draw = |east: f64| office.draw(seen(4.0, -0.2, east, 12.2), drawing(12.0, 6.0, 0.4));
    let reported = |maps: &[f64]| {
        let mut bench = Bench::new();
        bench.give("robot0", part(0));
        maps.iter().for_each(|east| bench.give("robot1", draw(*east)));
        let before = bench.plan.searches;
        let bench = bench.finish();
        bench.assert_right();
        (bench.plan.searches - before, bench.last().values().map(|reported| (*reported).clone()).collect::<Vec<_>>())
    };
    let (searches, at_once) = reported(&[17.8]);
    assert_eq!(searches, 0, "it was searched when it came");
    let (searches, little_by_little) = reported(&[17.0, 17.2, 17.4, 17.6, 17.8]);
    assert_eq!((searches, little_by_little), (1, at_once));
}

#[test]
fn a_robot_without_a_pose_is_searched_again_when_its_map_has_grown_and_at_the_end() {
    let stranger = |east: f64| FloorPlan::another_office().draw(seen(-0.2, -0.2, east, 12.2), drawing(1.0, 1.0, 1.0));
    let mut bench = Bench::new();
    bench.give("robot0", part(0));
    let mut searches = vec![];
    for east in [12.0, 12.5, 13.0, 20.2] {
        bench.give("robot1", stranger(east));
        searches.push(bench.plan.searches);
    }
    assert_eq!(searches, [1, 1, 1, 2]);
    bench.give("robot1", stranger(20.4));
    assert_eq!(bench.finish().plan.searches, 3);
}

#[test]
fn what_no_longer_holds_is_retracted() {
    let mut bench = Bench::new();
    bench.give("robot0", part(0));
    bench.give("robot1", part(1));
    bench.give("robot2", part(2));
    assert!(bench.last().values().all(|reported| reported.found.is_ok()));
    // The robot has begun a map of an area that no other robot has seen.
    let elsewhere = FloorPlan::new(&[[0.0, 0.0, 30.0, 0.0], [30.0, 0.0, 30.0, 25.0], [3.0, 22.0, 9.0, 30.0]]);
    bench.give("robot2", elsewhere.draw(seen(-1.0, -1.0, 31.0, 31.0), drawing(0.0, 0.0, 0.0)));
    let of_third: Vec<PairReport> = bench
        .last()
        .values()
        .filter(|reported| reported.pair.b == "robot2")
        .map(|reported| (*reported).clone())
        .collect();
    assert_eq!(of_third.len(), 2);
    let tied = of_third.iter().filter(|reported| reported.found.as_ref().is_ok_and(|found| found.len() == 1)).count();
    assert_eq!(tied, 0, "{of_third:?}");
}
