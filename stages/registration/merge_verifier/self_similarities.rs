//! Cache of the self-similarity of the robots' maps, so that not every map is searched.

use super::numbered_map::NumberedMap;
use crate::registration::comparison::Agreement;
use crate::registration::judgement::{Alias, Decision, JudgementParameters, SelfSimilarity};
use crate::registration::pose_window::PoseWindow;
use crate::shared::geometry::{Pose2, is_known};
use crate::shared::robot_pair::RobotPair;
use std::collections::BTreeMap;

/// The result for a map is valid for later ones of the robot until this share of its known area is added or removed.
const LITTLE_CHANGE: f64 = 0.2;

/// Self-similarity of maps, by robot.
#[derive(Debug, Default)]
pub(super) struct SelfSimilarities {
    searched: BTreeMap<String, Searched>,
    /// The last alias of each pair, and what it was found for.
    aliases: BTreeMap<RobotPair, (Asked, Option<Alias>)>,
}

/// What the alias of a pair depends on.
#[derive(Debug, PartialEq)]
struct Asked {
    /// Numbers of the maps of both robots, and of those that were searched.
    maps: [u64; 4],
    transform_a_b: Pose2,
    agreement: Agreement,
    window: Option<PoseWindow>,
}

#[derive(Debug)]
struct Searched {
    /// Number of the map among those of its robot.
    number: u64,
    /// Number of its known cells.
    known_cells: usize,
    found: SelfSimilarity,
}

impl SelfSimilarities {
    /// The most probable alias of a pose that was accepted by the maps only; searches the maps if necessary.
    pub(super) fn alias(
        &mut self,
        decision: &Decision,
        pair: &RobotPair,
        [a, b]: &[NumberedMap<'_>; 2],
        window: Option<&PoseWindow>,
        parameters: &JudgementParameters,
    ) -> Option<Alias> {
        self.search(&pair.a, a, parameters);
        self.search(&pair.b, b, parameters);
        let (of_a, of_b) = (self.searched.get(&pair.a)?, self.searched.get(&pair.b)?);
        let candidate = &decision.candidate;
        let asked = Asked {
            maps: [a.number, b.number, of_a.number, of_b.number],
            transform_a_b: candidate.transform_a_b(),
            agreement: candidate.agreement,
            window: window.copied(),
        };
        if let Some((_, alias)) = self.aliases.get(pair).filter(|(known, _)| *known == asked) {
            return alias.clone();
        }
        let alias = Alias::likeliest(decision, (&a.view, &of_a.found), (&b.view, &of_b.found), window, parameters);
        self.aliases.insert(pair.clone(), (asked, alias.clone()));
        alias
    }

    /// Searches a map of a robot, unless an earlier result is still valid.
    fn search(&mut self, robot: &str, map: &NumberedMap<'_>, parameters: &JudgementParameters) {
        let known_cells = map.view.grid.cells.iter().filter(|value| is_known(**value)).count();
        let holds = |searched: &Searched| {
            searched.known_cells.abs_diff(known_cells) as f64 <= LITTLE_CHANGE * searched.known_cells as f64
        };
        if !self.searched.get(robot).is_some_and(holds) {
            let found = SelfSimilarity::new(&map.view, parameters);
            self.searched.insert(robot.to_owned(), Searched { number: map.number, known_cells, found });
        }
    }

    /// Drops the results of maps that are not the latest of their robot, of which `last` returns the number. Returns
    /// those robots.
    pub(super) fn forget_former(&mut self, last: impl Fn(&str) -> Option<u64>) -> Vec<String> {
        let searched = &mut self.searched;
        searched
            .extract_if(.., |robot, searched| last(robot) != Some(searched.number))
            .map(|(robot, _)| robot)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::test_world::floor_plan::{FloorPlan, drawing, seen};

    #[test]
    fn a_map_is_searched_again_once_much_of_it_is_new_and_at_the_end() {
        let up_to = |x: f64| FloorPlan::hall().draw(seen(-0.2, -0.2, x, 12.2), drawing(3.0, 2.0, 0.4));
        let parameters = JudgementParameters::default();
        let mut kept = SelfSimilarities::default();
        for (number, map, searched) in
            [(0, up_to(10.0), 0), (1, up_to(11.0), 0), (2, up_to(14.0), 2), (3, up_to(15.0), 2)]
        {
            kept.search("robot1", &NumberedMap { number, view: map.view() }, &parameters);
            assert_eq!(kept.searched["robot1"].number, searched, "map {number}");
        }
        assert_eq!(kept.forget_former(|_| Some(2)), Vec::<String>::new());
        assert_eq!(kept.forget_former(|robot| (robot == "robot1").then_some(3)), ["robot1"]);
        assert!(kept.searched.is_empty());
    }
}
