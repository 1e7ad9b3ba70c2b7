//! Which maps of many robots are searched, so that not every pair must be.

use super::group::{Groups, MergedGroup};
use super::pair_report::{PairReport, with_reasons};
use crate::registration::pose_window::PoseWindow;
use crate::registration::search::{
    CommonWalls, JUDGED, MapAlignerParameters, MapAlignment, MapAlignments, PreparedMap, SearchRefusal, align_near,
    align_prepared, is_near, overlay,
};
use crate::shared::geometry::{Grid, Pose2};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::stage::InitialPoses;
use std::collections::{BTreeMap, BTreeSet};

/// Number of groups, the largest first, on which a robot is searched when its map arrives. At the end all remaining
/// groups are searched on each other, until no further two are united.
const GROUPS_TRIED: usize = 3;
/// Hypotheses of a map that has grown a little are kept if they score at least this share of their former score.
const KEPT_SCORE: f64 = 0.9;

/// Robots whose maps are searched, and the groups of robots whose maps are merged.
///
/// Maps with one clear relative pose are merged into a group, which is searched as one map: so a further robot takes
/// one search, however many robots there are.
pub struct MergePlan {
    parameters: MapAlignerParameters,
    /// Initial poses that the user knows.
    initial_poses: InitialPoses,
    /// Side of the narrowest cells, metres.
    cell: f64,
    robots: BTreeMap<String, Robot>,
    groups: Groups,
    /// Pairs of groups that were searched, by number.
    tried: BTreeSet<(u64, u64)>,
    /// Latest report on each pair.
    reported: BTreeMap<RobotPair, PairReport>,
    /// Searches since they were last counted.
    pub searches: u64,
    /// Hypotheses without a search of their own since they were last counted.
    pub predictions: u64,
}

struct Robot {
    map: Result<PreparedMap, SearchRefusal>,
    /// Known cells at the last search.
    searched_cells: usize,
    /// Whether the latest map was searched.
    is_searched: bool,
}

impl MergePlan {
    /// A plan without robots.
    pub fn new(parameters: MapAlignerParameters, initial_poses: InitialPoses) -> Self {
        Self {
            initial_poses,
            cell: 0.5 * parameters.cell,
            parameters,
            robots: BTreeMap::new(),
            groups: Groups::default(),
            tried: BTreeSet::new(),
            reported: BTreeMap::new(),
            searches: 0,
            predictions: 0,
        }
    }

    /// Replaces the map of a robot. `grids` are the latest maps of all robots, including this one. Returns what has
    /// changed.
    pub fn update(&mut self, robot: &str, grids: &BTreeMap<String, Grid<'_>>) -> Vec<PairReport> {
        let Some(grid) = grids.get(robot) else { return Vec::new() };
        let least = PreparedMap::least_cell(grid);
        if least > self.cell {
            // All maps take cells of one size.
            self.cell = least;
            for (name, known) in &mut self.robots {
                if let Some(grid) = grids.get(name) {
                    known.map = PreparedMap::new(name, grid, self.cell, self.parameters.max_extent);
                }
            }
        }
        let map = PreparedMap::new(robot, grid, self.cell, self.parameters.max_extent);
        let cells = map.as_ref().map_or(0, |map| map.level(0).known_cells());
        let searched_cells = self.robots.get(robot).map_or(0, |known| known.searched_cells);
        let has_grown_little =
            map.is_ok() && (cells as f64) <= searched_cells as f64 * (1.0 + self.parameters.little_growth);
        self.robots.insert(robot.to_owned(), Robot { map, searched_cells, is_searched: false });
        if let (true, Some(group)) = (has_grown_little, self.groups.of(robot)) {
            let number = group.number;
            if group.members.len() == 1 {
                return Vec::new();
            }
            if let Some(kept) = self.kept(robot) {
                self.groups.renew(number);
                return self.changed(kept);
            }
        }
        self.groups.leave(&[robot]);
        let number = self.add_alone(robot);
        let mut reports = self.refusals(robot);
        if let Some(number) = number {
            self.unite_with_others(number, GROUPS_TRIED, &mut reports);
        }
        reports.extend(self.retractions(robot, &reports));
        self.changed(reports)
    }

    /// Searches the latest maps that were not searched, so that the final reports rest on them, and tries all groups
    /// on each other. Returns what has changed.
    pub fn finish(&mut self) -> Vec<PairReport> {
        let mut reports = Vec::new();
        let not_searched = self.robots.iter().filter(|(_, known)| known.map.is_ok() && !known.is_searched);
        let robots: Vec<String> = not_searched.map(|(robot, _)| robot.clone()).collect();
        self.groups.leave(&robots.iter().map(String::as_str).collect::<Vec<_>>());
        for robot in &robots {
            self.add_alone(robot);
        }
        for robot in &robots {
            if let Some(number) = self.groups.of(robot).map(|group| group.number) {
                self.unite_with_others(number, usize::MAX, &mut reports);
            }
        }
        for robot in &robots {
            reports.extend(self.retractions(robot, &reports));
        }
        loop {
            let count = self.groups.len();
            for number in self.groups.by_size() {
                self.unite_with_others(number, usize::MAX, &mut reports);
            }
            if self.groups.len() == count {
                break;
            }
        }
        self.changed(reports)
    }

    /// Searches a group on others, the largest first.
    fn unite_with_others(&mut self, number: u64, most: usize, reports: &mut Vec<PairReport>) {
        let mut mine = number;
        let others: Vec<u64> = self.groups.by_size().into_iter().filter(|other| *other != number).take(most).collect();
        for other in others {
            let pair = (mine.min(other), mine.max(other));
            if self.tried.insert(pair) {
                mine = self.unite(mine, other, reports).unwrap_or(mine);
            }
        }
    }

    /// Searches one group on another. Returns the number of the united group, if the relative pose is clear.
    fn unite(&mut self, one: u64, other: u64, reports: &mut Vec<PairReport>) -> Option<u64> {
        let (one, other) = (self.groups.get(one)?, self.groups.get(other)?);
        // The larger one is map a; of two robots the first by name.
        let (group_a, group_b) = if one.rank() < other.rank() { (one, other) } else { (other, one) };
        let (first, second) = (group_a.number, group_b.number);
        let window = self.window(group_a, group_b);
        let found = align_prepared(self.map_of(group_a)?, self.map_of(group_b)?, window.as_ref(), &self.parameters);
        let pair = RobotPair::by_name(group_a.name(), group_b.name());
        let (count_a, count_b) = (group_a.members.len(), group_b.members.len());
        self.searches += 1;
        let found = match found {
            Ok(found) => found,
            Err(refusal) => {
                reports.push(PairReport::of(pair, Err(refusal.to_string())));
                return None;
            }
        };
        let is_clear = found.second_best_share <= self.parameters.tie_second_best && self.agrees_in_much(&found);
        let on_merged = found.hypotheses.first()?;
        let best = on_merged.transform_a_b;
        let mut fits = is_clear;
        if count_a + count_b == 2 {
            reports.push(PairReport::of(pair, Ok(with_reasons(&found))));
        } else {
            let pairs = self.pairs_in_common(group_a, group_b, &best);
            let of_pairs = match is_clear {
                true => self.predicted_pairs(&pairs, count_a.max(count_b), on_merged),
                false => self.undecided(pairs.first()?, count_a + count_b, &found).into_iter().collect(),
            };
            fits &= !of_pairs.is_empty();
            reports.extend(of_pairs);
        }
        fits.then(|| self.groups.unite(first, second, &best)).flatten()
    }

    /// Hypotheses of the pairs with the most wall in common, where the relative pose of their groups is clear.
    fn predicted_pairs(&mut self, pairs: &[PairInCommon], others: usize, on_merged: &MapAlignment) -> Vec<PairReport> {
        let reported = pairs.iter().filter_map(|pair| self.predicted(pair, others, on_merged));
        let reported = reported.map(|reported| PairReport { is_supported: true, ..reported });
        let reported: Vec<PairReport> = reported.take(1 + self.parameters.predictions).collect();
        self.predictions += reported.len() as u64;
        reported
    }

    /// The report on the pair with the most wall in common, where the relative pose of their groups is not clear: a
    /// refusal if the building is self-similar, and otherwise the hypotheses of the two robots alone.
    fn undecided(&mut self, pair: &PairInCommon, robots: usize, found: &MapAlignments) -> Option<PairReport> {
        if !self.has_alike(found) {
            return self.searched(pair);
        }
        let (shift, turn) = found.second_best_change;
        let reason = format!(
            "on the merged map of {} robots a second pose fits {:.0} % as well, {shift:.1} m and {:.0} degrees away: the maps do not decide \
             which is right",
            robots - 1,
            100.0 * found.second_best_share,
            turn.to_degrees(),
        );
        Some(PairReport::of(pair.pair.clone(), Err(reason)))
    }

    /// Window of the relative poses of two groups, by the first robot of each with a known initial pose.
    fn window(&self, group_a: &MergedGroup, group_b: &MergedGroup) -> Option<PoseWindow> {
        let known = |group: &MergedGroup| {
            let mut poses =
                group.members.iter().filter_map(|(robot, pose)| Some((*self.initial_poses.get(robot)?, *pose)));
            poses.next()
        };
        let ((a, place_a), (b, place_b)) = (known(group_a)?, known(group_b)?);
        Some(PoseWindow::between(&a, &b).of_wholes(place_a, place_b))
    }

    /// Whether a second-best hypothesis, which scores too high for a clear pose, has about as large an inlier ratio:
    /// then the building is self-similar, and a search of two of the maps alone is no better.
    fn has_alike(&self, found: &MapAlignments) -> bool {
        let Some((best, others)) = found.hypotheses.split_first() else { return false };
        let is_alike = |other: &MapAlignment| {
            other.share > self.parameters.tie_second_best
                && other.wall_agreement + self.parameters.alike_margin >= best.wall_agreement
        };
        others.iter().any(is_alike)
    }

    /// Whether two groups have enough inliers to be merged. A wrongly merged map shows a part of the building twice,
    /// and no later map has a clear pose on it.
    fn agrees_in_much(&self, found: &MapAlignments) -> bool {
        let MapAlignerParameters { tie_wall_length, tie_wall_agreement, .. } = self.parameters;
        let agrees =
            |best: &MapAlignment| best.wall_in_common >= tie_wall_length && best.wall_agreement >= tie_wall_agreement;
        found.hypotheses.first().is_some_and(agrees)
    }

    /// Hypotheses of a pair of robots by a search of their own.
    fn searched(&mut self, PairInCommon { pair, .. }: &PairInCommon) -> Option<PairReport> {
        let window = PoseWindow::of(pair, &self.initial_poses);
        let found = align_prepared(self.map(&pair.a)?, self.map(&pair.b)?, window.as_ref(), &self.parameters);
        self.searches += 1;
        let found = found.map(|found| with_reasons(&found)).map_err(|refusal| refusal.to_string());
        Some(PairReport::of(pair.clone(), found))
    }

    /// Hypothesis of a pair of robots from the relative pose of their groups. The peak significance and the margin
    /// are those of the search of the groups.
    fn predicted(
        &self,
        PairInCommon { pair, transform_a_b, .. }: &PairInCommon,
        others: usize,
        on_merged: &MapAlignment,
    ) -> Option<PairReport> {
        let found = align_near(self.map(&pair.a)?, self.map(&pair.b)?, transform_a_b, on_merged, &self.parameters)?;
        if found.wall_in_common < self.parameters.min_wall_length {
            return None;
        }
        let reason = format!(
            "the maps alone: {:.0} m of walls in common, at the clear peak on the merged maps of {others} robots",
            found.wall_in_common
        );
        Some(PairReport::of(pair.clone(), Ok(vec![(found, reason)])))
    }

    /// Pairs with one robot of each group, those with the most wall in common first, for a relative pose of the
    /// groups.
    fn pairs_in_common(
        &self,
        group_a: &MergedGroup,
        group_b: &MergedGroup,
        transform_groups: &Pose2,
    ) -> Vec<PairInCommon> {
        let mut pairs = Vec::new();
        for (a, to_group_a) in &group_a.members {
            for (b, to_group_b) in &group_b.members {
                let transform_a_b = to_group_a.inverse() * transform_groups * to_group_b;
                let Some(CommonWalls { length, .. }) = self.common_walls(a, b, &transform_a_b) else { continue };
                let transform_a_b = if a < b { transform_a_b } else { transform_a_b.inverse() };
                pairs.push(PairInCommon { pair: RobotPair::by_name(a, b), transform_a_b, length });
            }
        }
        pairs.sort_by(|one, other| other.length.total_cmp(&one.length));
        pairs
    }

    /// Hypotheses of a robot whose map has grown a little, if all still fit.
    fn kept(&mut self, robot: &str) -> Option<Vec<PairReport>> {
        let mut kept = Vec::new();
        for report in self.reported.values().filter(|reported| reported.pair.concerns(robot)) {
            let Ok(found) = &report.found else { continue };
            let (map_a, map_b) = (self.map(&report.pair.a)?, self.map(&report.pair.b)?);
            let mut refined = Vec::new();
            for (before, reason) in found {
                let again = align_near(map_a, map_b, &before.transform_a_b, before, &self.parameters)?;
                if again.score < KEPT_SCORE * before.score {
                    return None;
                }
                refined.push((again, reason.clone()));
            }
            let best = refined.first().map_or(1.0, |(best, _)| best.score);
            refined.iter_mut().for_each(|(again, _)| again.share = again.score / best);
            kept.push(PairReport { found: Ok(refined), ..report.clone() });
        }
        self.predictions += kept.len() as u64;
        Some(kept)
    }

    /// Refusals of pairs of a robot where one of the two maps cannot be searched.
    fn refusals(&self, robot: &str) -> Vec<PairReport> {
        let Some(mine) = self.robots.get(robot) else { return Vec::new() };
        let others = self.robots.iter().filter(|(other, _)| *other != robot);
        let refusals = others.filter_map(|(other, known)| {
            let (first, second) = if robot < other.as_str() { (mine, known) } else { (known, mine) };
            let refusal = first.map.as_ref().err().or(second.map.as_ref().err())?;
            Some(PairReport::of(RobotPair::by_name(robot, other), Err(refusal.to_string())))
        });
        refusals.collect()
    }

    /// Retractions of earlier reports on a robot that no longer hold.
    fn retractions(&self, robot: &str, reports: &[PairReport]) -> Vec<PairReport> {
        let group = self.groups.of(robot);
        let stands = |reported: &PairReport| {
            let (Some(group), Ok(found)) = (group, &reported.found) else { return reported.found.is_err() };
            let poses = group.members.get(&reported.pair.a).zip(group.members.get(&reported.pair.b));
            poses.zip(found.first()).is_some_and(|((a, b), (best, _))| {
                let common = self.common_walls(&reported.pair.a, &reported.pair.b, &best.transform_a_b);
                let pose = a.inverse() * b;
                common.is_some_and(|common| is_near(&best.transform_a_b, &pose, &common.centre, &self.parameters))
            })
        };
        let is_reported_again = |reported: &PairReport| reports.iter().any(|new| new.pair == reported.pair);
        let reported = self.reported.values().filter(|reported| reported.pair.concerns(robot));
        let fallen = reported.filter(|reported| !is_reported_again(reported) && !stands(reported));
        let reason = format!("the map of {robot} has changed, and no longer fits on this map at the earlier pose");
        fallen.map(|reported| PairReport { found: Err(reason.clone()), ..reported.clone() }).collect()
    }

    /// Stores reports, and returns those that differ from the latest ones.
    fn changed(&mut self, reports: Vec<PairReport>) -> Vec<PairReport> {
        let mut changed = Vec::new();
        for report in reports {
            if self.reported.get(&report.pair) != Some(&report) {
                self.reported.insert(report.pair.clone(), report.clone());
                changed.push(report);
            }
        }
        changed
    }

    /// Makes a robot without a group, which is about to be searched, a group of its own. Returns its number, if its
    /// map can be searched.
    fn add_alone(&mut self, robot: &str) -> Option<u64> {
        let known = self.robots.get_mut(robot)?;
        known.is_searched = true;
        known.searched_cells = known.map.as_ref().map_or(0, |map| map.level(0).known_cells());
        known.map.is_ok().then(|| self.groups.add(BTreeMap::from([(robot.to_owned(), Pose2::identity())])))
    }

    fn map_of<'a>(&'a self, group: &'a MergedGroup) -> Option<&'a PreparedMap> {
        group.map(|robot| self.map(robot))
    }

    fn map(&self, robot: &str) -> Option<&PreparedMap> {
        self.robots.get(robot)?.map.as_ref().ok()
    }

    fn common_walls(&self, a: &str, b: &str, transform_a_b: &Pose2) -> Option<CommonWalls> {
        overlay(self.map(a)?, self.map(b)?, JUDGED, 0.0).common_walls(transform_a_b)
    }
}

/// Two robots of different groups, and their relative pose by that of the groups.
struct PairInCommon {
    /// The first by name as robot a.
    pair: RobotPair,
    transform_a_b: Pose2,
    /// Approximate length of wall in common, metres.
    length: f64,
}
