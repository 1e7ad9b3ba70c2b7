//! The stage: keeps the edges of each robot's map and the rotation of each pair, and matches a pair when these
//! change.

use super::{Edge, EdgeMatcherParameters, edges, match_edges};
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Alignment, Header, TopologicalMap};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use gridweave_stages::shared::geometry::row_by_row;
use gridweave_stages::shared::robot_pair::RobotPair;
use nalgebra::UnitComplex;
use std::collections::BTreeMap;

/// Outputs of the stage.
pub(super) struct Alignments {
    alignment: Out<Alignment>,
}

impl Outputs for Alignments {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "One alignment for each that comes in, accepted or refused, and at the end for maps that have come since. The \
                       score is the share of the votes by which the translation leads the best one elsewhere.";
        Self { alignment: ports.output("alignment", summary) }
    }
}

/// Matches the edges of robots' topological maps.
pub(super) struct EdgeMatcher {
    parameters: EdgeMatcherParameters,
    maps: BTreeMap<String, RobotEdges>,
    rotations: BTreeMap<RobotPair, Rotation>,
}

/// The edges of a robot's map.
struct RobotEdges {
    edges: Vec<Edge>,
    came: LogTime,
}

/// An alignment of a pair, and when the pair was matched by it.
struct Rotation {
    alignment: Alignment,
    matched: LogTime,
}

impl EdgeMatcher {
    pub(super) fn new(parameters: EdgeMatcherParameters) -> Self {
        Self { parameters, maps: BTreeMap::new(), rotations: BTreeMap::new() }
    }

    /// A map waits for the rotations that belong to it, which follow at the same log time, or for the end.
    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, TopologicalMap>,
        output: &Output<Alignments>,
    ) -> Result<(), StageError> {
        let edges = edges(&map, self.parameters.min_length);
        self.maps.insert(map.robot.clone(), RobotEdges { edges, came: output.log_time() });
        Ok(())
    }

    pub(super) fn receive_alignment(
        &mut self,
        alignment: Received<'_, Alignment>,
        output: &Output<Alignments>,
    ) -> Result<(), StageError> {
        let alignment = alignment.into_content();
        if alignment.accepted && !(alignment.yaw.is_finite() && alignment.covariance[8] >= 0.0) {
            output.warn("an alignment was left out: its rotation or its variance is not finite");
            return Ok(());
        }
        let pair = RobotPair::of(&alignment);
        self.rotations.insert(pair.clone(), Rotation { alignment, matched: output.log_time() });
        let Some(rotation) = self.rotations.get(&pair) else { return Ok(()) };
        match self.maps.contains_key(&pair.a) && self.maps.contains_key(&pair.b) || !rotation.alignment.accepted {
            true => self.send(&pair, &rotation.alignment, output),
            false => Ok(()),
        }
    }

    /// Pairs of which a map came after the rotation, or not at all.
    pub(super) fn finish(&mut self, output: &Output<Alignments>) -> Result<(), StageError> {
        let is_newer = |robot: &String, matched| self.maps.get(robot).is_none_or(|map| map.came > matched);
        let waiting = self.rotations.iter().filter(|(pair, rotation)| {
            let is_newer = is_newer(&pair.a, rotation.matched) || is_newer(&pair.b, rotation.matched);
            rotation.alignment.accepted && is_newer
        });
        waiting.into_iter().try_for_each(|(pair, rotation)| self.send(pair, &rotation.alignment, output))
    }

    fn send(&self, pair: &RobotPair, rotation: &Alignment, output: &Output<Alignments>) -> Result<(), StageError> {
        let header = Header::new(output.log_time(), rotation.header.frame_id.clone());
        let method = format!("{}+edges", rotation.method);
        let refused = |reason: String| Alignment {
            header: header.clone(),
            a: pair.a.clone(),
            b: pair.b.clone(),
            source: rotation.source.clone(),
            method: method.clone(),
            reason,
            ..Alignment::default()
        };
        if !rotation.accepted {
            return output.alignment.send("", &refused(rotation.reason.clone()));
        }
        let missing: Vec<&str> = pair.robots().into_iter().filter(|robot| !self.maps.contains_key(*robot)).collect();
        let (Some(a), Some(b)) = (self.maps.get(&pair.a), self.maps.get(&pair.b)) else {
            let reason = format!("no topological map of {} has come", missing.join(" and "));
            return output.alignment.send("", &refused(reason));
        };
        let turn = UnitComplex::new(rotation.yaw);
        let found = match match_edges(&a.edges, &b.edges, &turn, rotation.covariance[8], &self.parameters) {
            Ok(found) => found,
            Err(refusal) => return output.alignment.send("", &refused(refusal.to_string())),
        };
        let mut alignment = Alignment {
            covariance: row_by_row(&found.covariance),
            score: (1.0 - found.second_best).clamp(0.0, 1.0),
            accepted: true,
            ..refused(format!("{}\n\n{}", found.reason(), rotation.reason))
        };
        alignment.set_transform_a_b(&found.transform_a_b);
        output.alignment.send("", &alignment)
    }
}
