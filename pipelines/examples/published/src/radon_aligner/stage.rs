//! The stage: keeps each robot's last map, and aligns it with those of the others when it has changed.

use super::align::{NamedMap, PreparedMap, RadonAlignment, align};
use super::{RadonAlignerParameters, RadonRefusal};
use gridweave_runtime::ros::{Alignment, Header, OccupancyGrid};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use gridweave_stages::shared::geometry::row_by_row;
use gridweave_stages::shared::robot_maps::{RobotMap, RobotMaps};
use gridweave_stages::shared::robot_pair::RobotPair;

/// What the stage sends.
pub(super) struct Alignments {
    alignment: Out<Alignment>,
}

impl Outputs for Alignments {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "One alignment for each pair of robots whenever a map of theirs has changed, accepted or refused. The score is \
                       the acceptance index.";
        Self { alignment: ports.output("alignment", summary) }
    }
}

/// Aligns the maps of robots.
pub(super) struct RadonAligner {
    parameters: RadonAlignerParameters,
    maps: RobotMaps<PreparedMap>,
}

impl RadonAligner {
    pub(super) fn new(parameters: RadonAlignerParameters) -> Self {
        Self { parameters, maps: RobotMaps::default() }
    }

    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<Alignments>,
    ) -> Result<(), StageError> {
        let robot = map.robot();
        let is_same = self.maps.get(robot).is_some_and(|before| before.is_same(&map));
        let steps = self.parameters.steps();
        if is_same || !self.maps.keep(&map, output, |grid| PreparedMap::new(grid, steps)) {
            return Ok(());
        }
        let others: Vec<&str> = self.maps.iter().map(|(other, _)| other).filter(|other| *other != robot).collect();
        others.into_iter().try_for_each(|other| self.align(&RobotPair::by_name(robot, other), output))
    }

    fn align(&self, pair: &RobotPair, output: &Output<Alignments>) -> Result<(), StageError> {
        let Some((a, b)) = self.maps.pair(pair) else { return Ok(()) };
        let found = align(&named(&pair.a, a), &named(&pair.b, b), &self.parameters);
        output.alignment.send("", &message(&found, pair, Header::new(output.log_time(), a.frame_id.clone())))
    }
}

fn named<'a>(robot: &'a str, map: &'a RobotMap<PreparedMap>) -> NamedMap<'a> {
    NamedMap { robot, grid: map.grid(), prepared: &map.own }
}

fn message(found: &Result<RadonAlignment, RadonRefusal>, pair: &RobotPair, header: Header) -> Alignment {
    let (a, b, name) = (pair.a.clone(), pair.b.clone(), "radon".to_owned());
    let of_pair = Alignment { header, a, b, source: "maps".into(), method: name, ..Alignment::default() };
    match found {
        Ok(found) => {
            let mut alignment = Alignment {
                covariance: row_by_row(&found.covariance),
                score: found.similarity,
                accepted: true,
                reason: found.reason(),
                ..of_pair
            };
            alignment.set_transform_a_b(&found.transform_a_b);
            alignment
        }
        Err(refusal) => {
            let score = if let RadonRefusal::Dissimilar { similarity, .. } = refusal { *similarity } else { 0.0 };
            Alignment { score, reason: refusal.to_string(), ..of_pair }
        }
    }
}
