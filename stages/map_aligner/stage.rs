//! The stage: keeps each robot's last map, and sends what a plan of searches tells of pairs of robots.

use super::{MapAlignerParameters, MergePlan, Statement};
use crate::geometry::{Grid, read_map, row_by_row};
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{Alignment, Header};
use gridweave_runtime::stage::{Output, Stage, StageError};
use std::collections::BTreeMap;

/// The output port of the first guesses.
const ALIGNMENT: usize = 0;

/// Aligns the maps of robots.
pub(super) struct MapAligner {
    /// The last usable map of each robot, as it came.
    maps: BTreeMap<String, Message>,
    plan: MergePlan,
    /// Whether guesses are marked as provisional.
    provisional: bool,
}

impl MapAligner {
    pub(super) fn new(parameters: MapAlignerParameters) -> Self {
        Self { provisional: parameters.provisional, maps: BTreeMap::new(), plan: MergePlan::new(parameters) }
    }

    /// Sends what is told of a pair: each guess in a message of its own, the best first, or why there is none.
    fn send(&self, statement: &Statement, output: &mut Output<'_>) -> Result<(), StageError> {
        let doing = || format!("align the maps of `{}` and `{}`", statement.a, statement.b);
        let Some(map_a) = self.maps.get(&statement.a) else { return Ok(()) };
        let (header, _) = read_map(map_a).map_err(|error| StageError::new(doing(), error))?;
        let of_pair = Alignment {
            header: Header::new(output.log_time(), header.frame_id),
            a: statement.a.clone(),
            b: statement.b.clone(),
            method: "maps".into(),
            ..Alignment::default()
        };
        let guesses = match &statement.found {
            Ok(guesses) => guesses,
            Err(reason) => return output.send(ALIGNMENT, "", &Alignment { reason: reason.clone(), ..of_pair }),
        };
        for (rank, (found, reason)) in (0..).zip(guesses) {
            let mut alignment = Alignment {
                covariance: row_by_row(&found.covariance),
                score: found.share,
                accepted: true,
                provisional: self.provisional && !statement.is_supported,
                rank,
                hypotheses: guesses.len() as u32,
                reason: reason.clone(),
                ..of_pair.clone()
            };
            alignment.set_transform_a_b(&found.transform_a_b);
            output.send(ALIGNMENT, "", &alignment)?;
        }
        Ok(())
    }
}

impl Stage for MapAligner {
    fn receive(&mut self, _port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let robot = message.robot().to_owned();
        let grid = match read_map(message) {
            Ok((_, grid)) => grid,
            Err(problem) => {
                output.warn(format!("a map of {robot} was left out: {problem}"));
                return Ok(());
            }
        };
        let before = self.maps.get(&robot).and_then(|before| read_map(before).ok());
        let is_same = before.is_some_and(|(_, before)| is_same_map(&before, &grid));
        self.maps.insert(robot.clone(), message.clone());
        if is_same {
            return Ok(());
        }
        let grids = self.maps.iter().filter_map(|(robot, map)| Some((robot.clone(), read_map(map).ok()?.1)));
        let statements = self.plan.update(&robot, &grids.collect());
        statements.iter().try_for_each(|statement| self.send(statement, output))
    }

    fn finish(&mut self, output: &mut Output<'_>) -> Result<(), StageError> {
        let statements = self.plan.finish();
        statements.iter().try_for_each(|statement| self.send(statement, output))
    }

    fn report(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "searches": self.plan.searches, "predictions": self.plan.predictions }))
    }
}

fn is_same_map(one: &Grid<'_>, other: &Grid<'_>) -> bool {
    one.geometry == other.geometry && one.cells == other.cells
}
