//! The stage: keeps each robot's last map, and aligns each pair when one of its two maps has changed.

use super::{MapAlignerParameters, MapAlignments, NamedMap, align_maps};
use crate::geometry::{Grid, read_map, row_by_row};
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{Alignment, Header};
use gridweave_runtime::stage::{Output, Stage, StageError};
use std::collections::BTreeMap;

/// The output port of the first guesses.
const ALIGNMENT: usize = 0;

/// Aligns the maps of pairs of robots.
pub(super) struct MapAligner {
    parameters: MapAlignerParameters,
    /// The last usable map of each robot, as it came.
    maps: BTreeMap<String, Message>,
    /// What was sent last for a pair.
    sent: BTreeMap<(String, String), Vec<Alignment>>,
    /// Pairs of maps that were searched, for the report.
    searches: u64,
}

impl MapAligner {
    pub(super) fn new(parameters: MapAlignerParameters) -> Self {
        Self { parameters, maps: BTreeMap::new(), sent: BTreeMap::new(), searches: 0 }
    }

    /// Aligns the pair of two robots, the first by name being robot a.
    fn align(&mut self, a: &str, b: &str, output: &mut Output<'_>) -> Result<(), StageError> {
        let (Some(map_a), Some(map_b)) = (self.maps.get(a), self.maps.get(b)) else { return Ok(()) };
        let doing = || format!("align the maps of `{a}` and `{b}`");
        let (header, grid_a) = read_map(map_a).map_err(|error| StageError::new(doing(), error))?;
        let (_, grid_b) = read_map(map_b).map_err(|error| StageError::new(doing(), error))?;
        self.searches += 1;
        let (named_a, named_b) = (NamedMap { robot: a, grid: grid_a }, NamedMap { robot: b, grid: grid_b });
        let found = align_maps(&named_a, &named_b, &self.parameters);
        let refused = Alignment {
            header: Header::new(output.log_time(), header.frame_id),
            a: a.to_owned(),
            b: b.to_owned(),
            method: "maps".into(),
            ..Alignment::default()
        };
        let alignments = match found {
            Ok(found) => self.hypotheses(&found, &refused),
            Err(refusal) => vec![Alignment { reason: refusal.to_string(), ..refused }],
        };
        self.send(alignments, output)
    }

    /// What is sent of a pair for which something was found, the best first.
    fn hypotheses(&self, found: &MapAlignments, of_pair: &Alignment) -> Vec<Alignment> {
        let hypotheses = found.hypotheses.iter().zip(0..).map(|(hypothesis, rank)| {
            let mut alignment = Alignment {
                covariance: row_by_row(&hypothesis.covariance),
                score: hypothesis.share,
                accepted: true,
                provisional: self.parameters.provisional,
                rank,
                hypotheses: found.hypotheses.len() as u32,
                reason: found.reason(rank as usize),
                ..of_pair.clone()
            };
            alignment.set_transform_a_b(&hypothesis.transform_a_b);
            alignment
        });
        hypotheses.collect()
    }

    /// Sends what there is of a pair, unless it tells only what was sent last.
    fn send(&mut self, alignments: Vec<Alignment>, output: &mut Output<'_>) -> Result<(), StageError> {
        let Some(first) = alignments.first() else { return Ok(()) };
        let pair = (first.a.clone(), first.b.clone());
        let is_news = self.sent.get(&pair).is_none_or(|sent| {
            let sent = sent.iter().map(|sent| Alignment { header: first.header.clone(), ..sent.clone() });
            !sent.eq(alignments.iter().cloned())
        });
        if is_news {
            alignments.iter().try_for_each(|alignment| output.send(ALIGNMENT, "", alignment))?;
            self.sent.insert(pair, alignments);
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
        let others: Vec<String> = self.maps.keys().filter(|other| **other != robot).cloned().collect();
        others.iter().try_for_each(|other| match robot < *other {
            true => self.align(&robot, other, output),
            false => self.align(other, &robot, output),
        })
    }

    fn report(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "searches": self.searches }))
    }
}

fn is_same_map(one: &Grid<'_>, other: &Grid<'_>) -> bool {
    one.geometry == other.geometry && one.cells == other.cells
}
