//! The stage: keeps each robot's last map, and sends what a plan of searches tells of pairs of robots.

use super::{MergePlan, Statement};
use crate::registration::search::MapAlignerParameters;
use crate::shared::geometry::row_by_row;
use crate::shared::robot_maps::RobotMaps;
use gridweave_runtime::ros::{Alignment, Header, OccupancyGrid};
use gridweave_runtime::stage::{InitialPoses, Out, Output, OutputPorts, Outputs, Received, StageError};

/// What the stage sends.
pub(super) struct Guesses {
    alignment: Out<Alignment>,
}

impl Outputs for Guesses {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "First guesses for each pair of robots, the best first, or why there is none. The score is the probability that the \
                       best of as many places would lead the others by less if all fitted by chance.";
        Self { alignment: ports.output("alignment", summary) }
    }
}

/// Aligns the maps of robots.
pub(super) struct MapAligner {
    maps: RobotMaps<()>,
    plan: MergePlan,
    /// Whether guesses are marked as provisional.
    provisional: bool,
}

impl MapAligner {
    pub(super) fn new(parameters: MapAlignerParameters, initial_poses: InitialPoses) -> Self {
        let provisional = parameters.provisional;
        Self { provisional, maps: RobotMaps::default(), plan: MergePlan::new(parameters, initial_poses) }
    }

    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<Guesses>,
    ) -> Result<(), StageError> {
        let is_same = self.maps.get(map.robot()).is_some_and(|before| before.is_same(&map));
        if !self.maps.keep(&map, output, |_| ()) || is_same {
            return Ok(());
        }
        let grids = self.maps.iter().map(|(robot, map)| (robot.to_owned(), map.grid())).collect();
        let statements = self.plan.update(map.robot(), &grids);
        self.tell(&statements, output)
    }

    pub(super) fn finish(&mut self, output: &Output<Guesses>) -> Result<(), StageError> {
        let statements = self.plan.finish();
        self.tell(&statements, output)
    }

    fn tell(&mut self, statements: &[Statement], output: &Output<Guesses>) -> Result<(), StageError> {
        output.count("searches", std::mem::take(&mut self.plan.searches));
        output.count("predictions", std::mem::take(&mut self.plan.predictions));
        statements.iter().try_for_each(|statement| self.send(statement, output))
    }

    /// Sends what is told of a pair: each guess in a message of its own, the best first, or why there is none.
    fn send(&self, statement: &Statement, output: &Output<Guesses>) -> Result<(), StageError> {
        let Some(map_a) = self.maps.get(&statement.pair.a) else { return Ok(()) };
        let of_pair = Alignment {
            header: Header::new(output.log_time(), map_a.frame_id.clone()),
            a: statement.pair.a.clone(),
            b: statement.pair.b.clone(),
            source: "maps".into(),
            method: "maps".into(),
            ..Alignment::default()
        };
        let guesses = match &statement.found {
            Ok(guesses) => guesses,
            Err(reason) => return output.alignment.send("", &Alignment { reason: reason.clone(), ..of_pair }),
        };
        for (rank, (found, reason)) in (0..).zip(guesses) {
            let mut alignment = Alignment {
                covariance: row_by_row(&found.covariance),
                score: 1.0 - (-found.lead.max(0.0)).exp(),
                accepted: true,
                provisional: self.provisional && !statement.is_supported,
                rank,
                hypotheses: guesses.len() as u32,
                reason: reason.clone(),
                ..of_pair.clone()
            };
            alignment.set_transform_a_b(&found.transform_a_b);
            output.alignment.send("", &alignment)?;
        }
        Ok(())
    }
}
