//! The stage: keeps each robot's last topological map, and matches those of each pair.

use super::icp_svd::IcpSvd;
use super::judge::{PoseJudgement, judge};
use super::matched_pose::MatchedPose;
use super::parameters::{MatchingMethod, PATHS_FOR_EACH_NODE, TopologyMatcherParameters};
use super::{Topology, exhaustive, icp_svd};
use crate::shared::geometry::row_by_row;
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::{Alignment, Header, TopologicalMap};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use std::collections::BTreeMap;

/// Outputs of the stage.
pub(super) struct Matches {
    alignment: Out<Alignment>,
    hypotheses: Out<Alignment>,
}

impl Outputs for Matches {
    fn declare(ports: &mut OutputPorts) -> Self {
        let alignment = "The relative pose of the maps of each pair of robots, and whether it is used. The score is the share of \
                         the paths of the map with fewer that coincide with paths of the other.";
        let hypotheses = "The best poses of each pair, ranked and marked as provisional, for icp_refiner and merge_verifier; \
                          the same score.";
        Self { alignment: ports.output("alignment", alignment), hypotheses: ports.output("hypotheses", hypotheses) }
    }
}

/// A robot's last topological map.
struct Kept {
    frame_id: String,
    topology: Topology,
}

/// Matches the topological maps of robots.
pub(super) struct TopologyMatcher {
    parameters: TopologyMatcherParameters,
    maps: BTreeMap<String, Kept>,
}

impl TopologyMatcher {
    pub(super) fn new(parameters: TopologyMatcherParameters) -> Self {
        Self { parameters, maps: BTreeMap::new() }
    }

    pub(super) fn receive_topology(
        &mut self,
        map: Received<'_, TopologicalMap>,
        output: &Output<Matches>,
    ) -> Result<(), StageError> {
        let robot = if map.robot().is_empty() { map.robot.as_str() } else { map.robot() };
        let topology = match Topology::from_message(&map) {
            Ok(topology) => topology,
            Err(problem) => {
                output.warn(format!("a topological map of {robot} was left out: {problem}"));
                return Ok(());
            }
        };
        let kept = Kept { frame_id: map.header.frame_id.clone(), topology };
        let before = self.maps.insert(robot.to_owned(), kept);
        let is_same =
            before.is_some_and(|before| self.maps.get(robot).is_some_and(|now| now.topology == before.topology));
        if is_same {
            return Ok(());
        }
        let pairs = self.maps.keys().filter(|other| *other != robot).map(|other| RobotPair::by_name(robot, other));
        pairs.collect::<Vec<_>>().iter().try_for_each(|pair| self.match_pair(pair, output))
    }

    fn match_pair(&self, pair: &RobotPair, output: &Output<Matches>) -> Result<(), StageError> {
        let Some((map_a, map_b)) = self.maps.get(&pair.a).zip(self.maps.get(&pair.b)) else { return Ok(()) };
        let (a, b) = (&map_a.topology, &map_b.topology);
        let method = match self.parameters.method {
            MatchingMethod::Exhaustive => "topology+exhaustive",
            MatchingMethod::IcpSvd => "topology+icp_svd",
        };
        let of_pair = Alignment {
            header: Header::new(output.log_time(), map_a.frame_id.clone()),
            a: pair.a.clone(),
            b: pair.b.clone(),
            source: "topology".into(),
            method: method.into(),
            ..Alignment::default()
        };
        let (poses, work) = match self.poses(a, b, output) {
            Ok(found) => found,
            Err(reason) => return output.alignment.send("", &Alignment { reason, ..of_pair }),
        };
        let PoseJudgement { accepted, score, reason } = judge(a, b, &poses, &self.parameters);
        let verdict = Alignment { score, accepted, reason: format!("{reason}\n\n{work}"), ..of_pair.clone() };
        output.alignment.send("", &placed(verdict, poses.first()))?;
        for (rank, matched_pose) in (0..).zip(&poses) {
            let hypothesis = Alignment {
                score: score * matched_pose.similarity as f64 / poses[0].similarity.max(1) as f64,
                accepted: true,
                provisional: true,
                rank,
                hypotheses: poses.len() as u32,
                reason: format!(
                    "{} paths coincide, their ends {:.2} m apart",
                    matched_pose.similarity, matched_pose.rms
                ),
                ..of_pair.clone()
            };
            output.hypotheses.send("", &placed(hypothesis, Some(matched_pose)))?;
        }
        Ok(())
    }

    /// The best poses of a pair, and a description of the search; or why the maps are too large to be matched.
    fn poses(
        &self,
        a: &Topology,
        b: &Topology,
        output: &Output<Matches>,
    ) -> Result<(Vec<MatchedPose>, String), String> {
        let parameters = &self.parameters;
        let (nodes, most) = ([a.nodes.len(), b.nodes.len()], parameters.max_nodes);
        if nodes.iter().any(|count| *count > most) {
            let [a, b] = nodes;
            return Err(format!(
                "the topological maps have {a} and {b} nodes, and at most {most} are matched (max_nodes)"
            ));
        }
        let (paths, most) = ([a.paths.len(), b.paths.len()], parameters.max_paths());
        if paths.iter().any(|count| *count > most) {
            let [a, b] = paths;
            return Err(format!(
                "the topological maps have {a} and {b} paths, and at most {most} are matched ({PATHS_FOR_EACH_NODE} for each of max_nodes)"
            ));
        }
        match parameters.method {
            MatchingMethod::Exhaustive => {
                let found = exhaustive(a, b, parameters).map_err(|too_dense| too_dense.to_string())?;
                output.count("trials", found.trials);
                let work = format!("{} trials: {} nodes on {} nodes", found.trials, b.nodes.len(), a.nodes.len());
                Ok((found.poses, work))
            }
            MatchingMethod::IcpSvd => {
                let (runs, poses) = icp_svd(a, b, parameters);
                output.count("iterations", runs.iter().map(|run| run.errors.len() as u64).sum());
                Ok((poses, runs.iter().enumerate().map(run_text).collect::<Vec<_>>().join("\n")))
            }
        }
    }
}

fn placed(alignment: Alignment, matched_pose: Option<&MatchedPose>) -> Alignment {
    let Some(matched_pose) = matched_pose else { return alignment };
    let mut alignment = Alignment { covariance: row_by_row(&matched_pose.covariance), ..alignment };
    alignment.set_transform_a_b(&matched_pose.transform_a_b);
    alignment
}

/// A run with its error by iteration.
fn run_text((number, run): (usize, &IcpSvd)) -> String {
    let errors: Vec<String> = run.errors.iter().map(|error| format!("{error:.3}")).collect();
    let end = if run.converged { "converged after" } else { "not converged after" };
    format!("start {number}: {end} {} iterations; error by iteration, m²: {}", errors.len(), errors.join(" "))
}
