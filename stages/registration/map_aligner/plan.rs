//! Which maps of many robots are searched, so that not every pair of them must be.

use super::group::{Group, Groups};
use super::statement::{Statement, with_reasons};
use crate::registration::place_window::PlaceWindow;
use crate::registration::search::{
    CommonWalls, JUDGED, MapAlignerParameters, MapAlignment, MapAlignments, PreparedMap, SearchRefusal, align_near,
    align_prepared, is_near, overlay,
};
use crate::shared::geometry::{Grid, Pose2};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::stage::InitialPoses;
use std::collections::{BTreeMap, BTreeSet};

/// As many groups, the largest first, are tried for a robot when its map comes; the others at the end, when all groups that are left are
/// tried on each other as long as any two of them come to lie together.
const GROUPS_TRIED: usize = 3;
/// Guesses are kept for a map that has grown a little if they score at least this share of what they did.
const KEPT_SCORE: f64 = 0.9;

/// Robots whose maps are searched, and those that are laid together.
///
/// Maps that fit clearly at one place make a group, which is searched as one map: so a robot that comes in takes one
/// search, however many robots there are.
pub struct MergePlan {
    parameters: MapAlignerParameters,
    /// Where the user knows maps to lie.
    initial_poses: InitialPoses,
    /// The side of the narrowest cells, metres.
    cell: f64,
    robots: BTreeMap<String, Robot>,
    groups: Groups,
    /// Pairs of groups that were searched, by number.
    tried: BTreeSet<(u64, u64)>,
    /// What was told last of each pair.
    told: BTreeMap<RobotPair, Statement>,
    /// Searches made since they were last counted.
    pub searches: u64,
    /// Guesses made without a search since they were last counted.
    pub predictions: u64,
}

struct Robot {
    map: Result<PreparedMap, SearchRefusal>,
    /// Known cells when it was searched last.
    searched_cells: usize,
    /// Whether it is this map that was searched last.
    is_searched: bool,
}

impl MergePlan {
    /// Without any robots.
    pub fn new(parameters: MapAlignerParameters, initial_poses: InitialPoses) -> Self {
        Self {
            initial_poses,
            cell: 0.5 * parameters.cell,
            parameters,
            robots: BTreeMap::new(),
            groups: Groups::default(),
            tried: BTreeSet::new(),
            told: BTreeMap::new(),
            searches: 0,
            predictions: 0,
        }
    }

    /// A robot has another map. `grids` are the last maps of all robots, itself among them.
    pub fn update(&mut self, robot: &str, grids: &BTreeMap<String, Grid<'_>>) -> Vec<Statement> {
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
                return self.tell(kept);
            }
        }
        self.groups.leave(&[robot]);
        let number = self.add_alone(robot);
        let mut statements = self.refusals(robot);
        if let Some(number) = number {
            self.tie_with_others(number, GROUPS_TRIED, &mut statements);
        }
        statements.extend(self.retractions(robot, &statements));
        self.tell(statements)
    }

    /// No more maps come: the last maps that were not searched are searched, so that what is told rests on them, and all that
    /// has not found its place is tried on all else.
    pub fn finish(&mut self) -> Vec<Statement> {
        let mut statements = Vec::new();
        let not_searched = self.robots.iter().filter(|(_, known)| known.map.is_ok() && !known.is_searched);
        let robots: Vec<String> = not_searched.map(|(robot, _)| robot.clone()).collect();
        self.groups.leave(&robots.iter().map(String::as_str).collect::<Vec<_>>());
        for robot in &robots {
            self.add_alone(robot);
        }
        for robot in &robots {
            if let Some(number) = self.groups.of(robot).map(|group| group.number) {
                self.tie_with_others(number, usize::MAX, &mut statements);
            }
        }
        for robot in &robots {
            statements.extend(self.retractions(robot, &statements));
        }
        loop {
            let count = self.groups.len();
            for number in self.groups.by_size() {
                self.tie_with_others(number, usize::MAX, &mut statements);
            }
            if self.groups.len() == count {
                break;
            }
        }
        self.tell(statements)
    }

    /// Tries to lay a group together with others, the largest first.
    fn tie_with_others(&mut self, number: u64, most: usize, statements: &mut Vec<Statement>) {
        let mut mine = number;
        let others: Vec<u64> = self.groups.by_size().into_iter().filter(|other| *other != number).take(most).collect();
        for other in others {
            let pair = (mine.min(other), mine.max(other));
            if self.tried.insert(pair) {
                mine = self.tie(mine, other, statements).unwrap_or(mine);
            }
        }
    }

    /// Searches one group on another. The number of the group of both, if they fit clearly.
    fn tie(&mut self, one: u64, other: u64, statements: &mut Vec<Statement>) -> Option<u64> {
        let (one, other) = (self.groups.get(one)?, self.groups.get(other)?);
        // The larger stays; of two robots the first by name.
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
                statements.push(Statement::of(pair, Err(refusal.to_string())));
                return None;
            }
        };
        let is_clear = found.runner_up_share <= self.parameters.tie_runner_up && self.agrees_in_much(&found);
        let MapAlignment { transform_a_b: best, lead, .. } = *found.hypotheses.first()?;
        if count_a + count_b == 2 {
            statements.push(Statement::of(pair, Ok(with_reasons(&found))));
            return is_clear.then(|| self.groups.unite(first, second, &best)).flatten();
        }
        let pairs = self.pairs_in_common(group_a, group_b, &best);
        if is_clear {
            let told = pairs.iter().filter_map(|pair| self.predicted(pair, count_a.max(count_b), lead));
            let told = told.map(|told| Statement { is_supported: true, ..told });
            let told: Vec<Statement> = told.take(1 + self.parameters.predictions).collect();
            self.predictions += told.len() as u64;
            let fits = !told.is_empty();
            statements.extend(told);
            return fits.then(|| self.groups.unite(first, second, &best)).flatten();
        }
        if self.has_alike(&found) {
            let reason = format!(
                "on the maps of {} robots together the map fits at several places, and it cannot be told which is right: {}",
                count_a + count_b - 1,
                found.reason(0)
            );
            statements.extend(pairs.first().map(|PairInCommon { pair, .. }| Statement::of(pair.clone(), Err(reason))));
            return None;
        }
        // On all maps together it is not clear. What the two robots with the most in common have to say is told as it is.
        statements.extend(self.searched(pairs.first()?));
        None
    }

    /// Where one group can lie on another, by the first robots of both of which it is known.
    fn window(&self, group_a: &Group, group_b: &Group) -> Option<PlaceWindow> {
        let known = |group: &Group| {
            let mut poses =
                group.members.iter().filter_map(|(robot, place)| Some((*self.initial_poses.get(robot)?, *place)));
            poses.next()
        };
        let ((a, place_a), (b, place_b)) = (known(group_a)?, known(group_b)?);
        Some(PlaceWindow::between(&a, &b).of_wholes(place_a, place_b))
    }

    /// Whether at another guess, which scores too much for the place to be clear, about as large a share of the walls agrees: the building
    /// is alike in both, and what two of the maps say alone is no more.
    fn has_alike(&self, found: &MapAlignments) -> bool {
        let Some((best, others)) = found.hypotheses.split_first() else { return false };
        let is_alike = |other: &MapAlignment| {
            other.share > self.parameters.tie_runner_up
                && other.wall_agreement + self.parameters.alike_margin >= best.wall_agreement
        };
        others.iter().any(is_alike)
    }

    /// Whether two groups agree on so much wall, and so well, that they can be laid together. What is laid together wrongly shows a
    /// part of the building twice, and no map that comes later has one place on it.
    fn agrees_in_much(&self, found: &MapAlignments) -> bool {
        let MapAlignerParameters { tie_wall_length, tie_wall_agreement, .. } = self.parameters;
        let agrees =
            |best: &MapAlignment| best.wall_in_common >= tie_wall_length && best.wall_agreement >= tie_wall_agreement;
        found.hypotheses.first().is_some_and(agrees)
    }

    /// The guesses for a pair of robots by a search of their own.
    fn searched(&mut self, PairInCommon { pair, .. }: &PairInCommon) -> Option<Statement> {
        let window = PlaceWindow::of(pair, &self.initial_poses);
        let found = align_prepared(self.map(&pair.a)?, self.map(&pair.b)?, window.as_ref(), &self.parameters);
        self.searches += 1;
        let found = found.map(|found| with_reasons(&found)).map_err(|refusal| refusal.to_string());
        Some(Statement::of(pair.clone(), found))
    }

    /// The guess for a pair of robots where their groups put it.
    /// The lead is that of the search in which the groups were found to lie so.
    fn predicted(
        &self,
        PairInCommon { pair, transform_a_b, .. }: &PairInCommon,
        others: usize,
        lead: f64,
    ) -> Option<Statement> {
        let found = align_near(self.map(&pair.a)?, self.map(&pair.b)?, transform_a_b, lead, &self.parameters)?;
        if found.wall_in_common < self.parameters.min_wall_length {
            return None;
        }
        let reason = format!(
            "the maps alone: {:.0} m of walls in common, at the place that stands out on the maps of {others} robots \
             together",
            found.wall_in_common
        );
        Some(Statement::of(pair.clone(), Ok(vec![(found, reason)])))
    }

    /// The pairs of a robot of each group, those with the most wall in common first, if the groups lie so.
    fn pairs_in_common(&self, group_a: &Group, group_b: &Group, transform_groups: &Pose2) -> Vec<PairInCommon> {
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

    /// The guesses of a robot whose map has grown a little, if all still fit.
    fn kept(&mut self, robot: &str) -> Option<Vec<Statement>> {
        let mut kept = Vec::new();
        for statement in self.told.values().filter(|told| told.pair.concerns(robot)) {
            let Ok(found) = &statement.found else { continue };
            let (map_a, map_b) = (self.map(&statement.pair.a)?, self.map(&statement.pair.b)?);
            let mut refined = Vec::new();
            for (before, reason) in found {
                let again = align_near(map_a, map_b, &before.transform_a_b, before.lead, &self.parameters)?;
                if again.score < KEPT_SCORE * before.score {
                    return None;
                }
                refined.push((again, reason.clone()));
            }
            let best = refined.first().map_or(1.0, |(best, _)| best.score);
            refined.iter_mut().for_each(|(again, _)| again.share = again.score / best);
            kept.push(Statement { found: Ok(refined), ..statement.clone() });
        }
        self.predictions += kept.len() as u64;
        Some(kept)
    }

    /// Why a robot cannot be aligned with others, for those of them for which a map alone says so.
    fn refusals(&self, robot: &str) -> Vec<Statement> {
        let Some(mine) = self.robots.get(robot) else { return Vec::new() };
        let others = self.robots.iter().filter(|(other, _)| *other != robot);
        let refusals = others.filter_map(|(other, known)| {
            let (first, second) = if robot < other.as_str() { (mine, known) } else { (known, mine) };
            let refusal = first.map.as_ref().err().or(second.map.as_ref().err())?;
            Some(Statement::of(RobotPair::by_name(robot, other), Err(refusal.to_string())))
        });
        refusals.collect()
    }

    /// What was told of a robot before, and cannot be so any more.
    fn retractions(&self, robot: &str, statements: &[Statement]) -> Vec<Statement> {
        let group = self.groups.of(robot);
        let stands = |told: &Statement| {
            let (Some(group), Ok(found)) = (group, &told.found) else { return told.found.is_err() };
            let places = group.members.get(&told.pair.a).zip(group.members.get(&told.pair.b));
            places.zip(found.first()).is_some_and(|((a, b), (best, _))| {
                let common = self.common_walls(&told.pair.a, &told.pair.b, &best.transform_a_b);
                let place = a.inverse() * b;
                common.is_some_and(|common| is_near(&best.transform_a_b, &place, &common.centre, &self.parameters))
            })
        };
        let is_told_again = |told: &Statement| statements.iter().any(|new| new.pair == told.pair);
        let told = self.told.values().filter(|told| told.pair.concerns(robot));
        let fallen = told.filter(|told| !is_told_again(told) && !stands(told));
        let reason = format!("the map of {robot} has changed, and does not lie where it lay on this map any more");
        fallen.map(|told| Statement { found: Err(reason.clone()), ..told.clone() }).collect()
    }

    /// Remembers what is told, and leaves out what was told before.
    fn tell(&mut self, statements: Vec<Statement>) -> Vec<Statement> {
        let mut news = Vec::new();
        for statement in statements {
            if self.told.get(&statement.pair) != Some(&statement) {
                self.told.insert(statement.pair.clone(), statement.clone());
                news.push(statement);
            }
        }
        news
    }

    /// Makes a robot that is in no group, and is about to be searched, a group of its own. Its number, if its map can be
    /// searched.
    fn add_alone(&mut self, robot: &str) -> Option<u64> {
        let known = self.robots.get_mut(robot)?;
        known.is_searched = true;
        known.searched_cells = known.map.as_ref().map_or(0, |map| map.level(0).known_cells());
        known.map.is_ok().then(|| self.groups.add(BTreeMap::from([(robot.to_owned(), Pose2::identity())])))
    }

    fn map_of<'a>(&'a self, group: &'a Group) -> Option<&'a PreparedMap> {
        group.map(|robot| self.map(robot))
    }

    fn map(&self, robot: &str) -> Option<&PreparedMap> {
        self.robots.get(robot)?.map.as_ref().ok()
    }

    fn common_walls(&self, a: &str, b: &str, transform_a_b: &Pose2) -> Option<CommonWalls> {
        overlay(self.map(a)?, self.map(b)?, JUDGED, 0.0).common_walls(transform_a_b)
    }
}

/// Two robots of different groups, and how they lie if the groups lie so.
struct PairInCommon {
    /// The first by name as robot a.
    pair: RobotPair,
    transform_a_b: Pose2,
    /// About the length of wall in common, metres.
    length: f64,
}
