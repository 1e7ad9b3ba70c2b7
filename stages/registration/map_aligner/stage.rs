//! The stage: keeps each robot's latest map, and sends the hypotheses of the plan for pairs of robots.

use super::{MergePlan, PairReport};
use crate::registration::search::MapAlignerParameters;
use crate::shared::geometry::row_by_row;
use crate::shared::robot_maps::RobotMaps;
use gridweave_runtime::ros::{Alignment, Header, OccupancyGrid};
use gridweave_runtime::stage::{InitialPoses, Out, Output, OutputPorts, Outputs, Received, StageError};

/// Outputs of the stage.
pub(super) struct Guesses {
    alignment: Out<Alignment>,
}

impl Outputs for Guesses {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "Hypotheses for each pair of robots, the best first, or why there is none. The score is the probability that the \
                       best of as many poses would exceed the others by less if all fitted by chance.";
        Self { alignment: ports.output("alignment", summary) }
    }
}

/// Searches the relative poses of the robots' maps.
pub(super) struct MapAligner {
    maps: RobotMaps<()>,
    plan: MergePlan,
    /// Whether hypotheses are marked as provisional.
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
        let reports = self.plan.update(map.robot(), &grids);
        self.send_all(&reports, output)
    }

    pub(super) fn finish(&mut self, output: &Output<Guesses>) -> Result<(), StageError> {
        let reports = self.plan.finish();
        self.send_all(&reports, output)
    }

    fn send_all(&mut self, reports: &[PairReport], output: &Output<Guesses>) -> Result<(), StageError> {
        output.count("searches", std::mem::take(&mut self.plan.searches));
        output.count("predictions", std::mem::take(&mut self.plan.predictions));
        reports.iter().try_for_each(|report| self.send(report, output))
    }

    /// Sends the report on a pair: each hypothesis in a message, the best first, or the reason why there is none.
    fn send(&self, report: &PairReport, output: &Output<Guesses>) -> Result<(), StageError> {
        let Some(map_a) = self.maps.get(&report.pair.a) else { return Ok(()) };
        let of_pair = Alignment {
            header: Header::new(output.log_time(), map_a.frame_id.clone()),
            a: report.pair.a.clone(),
            b: report.pair.b.clone(),
            source: "maps".into(),
            method: "maps".into(),
            ..Alignment::default()
        };
        let guesses = match &report.found {
            Ok(guesses) => guesses,
            Err(reason) => return output.alignment.send("", &Alignment { reason: reason.clone(), ..of_pair }),
        };
        for (rank, (found, reason)) in (0..).zip(guesses) {
            let mut alignment = Alignment {
                covariance: row_by_row(&found.covariance),
                score: 1.0 - (-found.significance.max(0.0)).exp(),
                margin: found.margin,
                accepted: true,
                provisional: self.provisional && !report.is_supported,
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
