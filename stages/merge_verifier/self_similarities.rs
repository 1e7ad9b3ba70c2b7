//! What is kept of where the maps of robots look like themselves, so that not every map is searched for it.

use super::{Alias, MapView, MergeVerifierParameters, SelfSimilarity, Verdict};
use crate::geometry::is_known;
use crate::place_window::PlaceWindow;
use gridweave_runtime::ros::Alignment;
use std::collections::BTreeMap;

/// What was found in a map holds for others of the robot until as large a share of its known area is new, or is gone.
const LITTLE_CHANGE: f64 = 0.2;

/// What was found in maps of robots, by robot.
#[derive(Debug, Default)]
pub(super) struct SelfSimilarities(BTreeMap<String, Searched>);

#[derive(Debug)]
struct Searched {
    /// The number of the robot's map, and of its known cells.
    number: u64,
    known_cells: usize,
    found: SelfSimilarity,
}

impl SelfSimilarities {
    /// The likeliest alias of a place that was accepted by the walls of two maps, of which each comes with its number among those of its
    /// robot, and is searched if that is due.
    pub(super) fn alias(
        &mut self,
        verdict: &Verdict<'_>,
        (a, b): ((u64, &MapView<'_>), (u64, &MapView<'_>)),
        window: Option<&PlaceWindow>,
        parameters: &MergeVerifierParameters,
    ) -> Option<Alias> {
        let Alignment { a: robot_a, b: robot_b, .. } = verdict.candidate.alignment;
        self.search(robot_a, a, parameters);
        self.search(robot_b, b, parameters);
        let (of_a, of_b) = (self.0.get(robot_a)?, self.0.get(robot_b)?);
        Alias::of(verdict, (a.1, &of_a.found), (b.1, &of_b.found), window, parameters)
    }

    /// Searches a map of a robot if nothing that is known of others of it holds.
    fn search(&mut self, robot: &str, (number, map): (u64, &MapView<'_>), parameters: &MergeVerifierParameters) {
        let known_cells = map.grid.cells.iter().filter(|value| is_known(**value)).count();
        let holds = |searched: &Searched| {
            searched.known_cells.abs_diff(known_cells) as f64 <= LITTLE_CHANGE * searched.known_cells as f64
        };
        if !self.0.get(robot).is_some_and(holds) {
            let found = SelfSimilarity::new(map, parameters);
            self.0.insert(robot.to_owned(), Searched { number, known_cells, found });
        }
    }

    /// Forgets what was found in a map that was not the last of its robot, of which `last` gives the number. The robots whose it was.
    pub(super) fn forget_former(&mut self, last: impl Fn(&str) -> Option<u64>) -> Vec<String> {
        self.0.extract_if(.., |robot, searched| last(robot) != Some(searched.number)).map(|(robot, _)| robot).collect()
    }
}
