//! The marker maker as a stage.

use super::hypothesis_markers::HypothesisMarkers;
use super::{direction, hypotheses, segments, tags, ways};
use gridweave_runtime::robot_colour::robot_colour;
use gridweave_runtime::ros::{Alignment, MapDirection, MarkerArray, Segments, TagEstimates, TopologicalMap, Verdicts};
use gridweave_runtime::stage::{Context, Out, Output, OutputPorts, Outputs, Received, StageError, StageKind};
use std::collections::BTreeMap;

/// The kind `marker_maker`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "marker_maker",
        "Turns walls, directions, tags, topological maps and hypotheses into shapes that RViz and Foxglove draw.",
        |(), _: &Context| Ok(MarkerMaker::default()),
    )
    .optional_inputs("segments", "the walls of the maps", MarkerMaker::segments)
    .optional_inputs("direction", "the directions of their walls", MarkerMaker::direction)
    .optional_inputs("tags", "where the tags are", MarkerMaker::tags)
    .optional_inputs("topology", "topological maps", MarkerMaker::topology)
    .optional_inputs("alignment", "hypotheses of the relative poses of maps", MarkerMaker::alignment)
    .optional_inputs("verdicts", "the verdict on each pair of robots", MarkerMaker::verdicts)
    .finish(MarkerMaker::finish)
    .build()
}

struct Markers {
    segments: Out<MarkerArray>,
    direction: Out<MarkerArray>,
    tags: Out<MarkerArray>,
    ways: Out<MarkerArray>,
    hypotheses: Out<MarkerArray>,
    graph: Out<MarkerArray>,
}

impl Outputs for Markers {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            segments: ports.output_on("/{robot}/markers/walls", "segments", "the walls as lines"),
            direction: ports.output_on(
                "/{robot}/markers/direction",
                "direction",
                "the direction of the walls as arrows",
            ),
            tags: ports.output_on("/{robot}/markers/tags", "tags", "the tags as ellipses of two standard deviations"),
            ways: ports.output_on("/{robot}/markers/ways", "ways", "topological maps as lines and balls"),
            hypotheses: ports.output_on(
                "/markers/hypotheses",
                "hypotheses",
                "the relative poses of the hypotheses: of all pairs, or, where they are many, of the one that has changed",
            ),
            graph: ports.output_on("/markers/graph", "graph", "the pairs of robots, and the verdict on each"),
        }
    }
}

#[derive(Default)]
struct MarkerMaker {
    /// In the order of their first message.
    robots: Vec<String>,
    hypotheses: HypothesisMarkers,
    /// Frame of a robot's map.
    frames: BTreeMap<String, String>,
}

impl MarkerMaker {
    fn colour(&mut self, robot: &str) -> [u8; 3] {
        let known = self.robots.iter().position(|known| known == robot);
        robot_colour(known.unwrap_or_else(|| {
            self.robots.push(robot.to_owned());
            self.robots.len() - 1
        }))
    }

    fn segments(&mut self, found: Received<'_, Segments>, output: &Output<Markers>) -> Result<(), StageError> {
        let colour = self.colour(&found.robot);
        output.segments.send(&found.robot, &segments(&found, colour))
    }

    fn direction(&mut self, found: Received<'_, MapDirection>, output: &Output<Markers>) -> Result<(), StageError> {
        let colour = self.colour(&found.robot);
        output.direction.send(&found.robot, &direction(&found, colour))
    }

    fn tags(&mut self, found: Received<'_, TagEstimates>, output: &Output<Markers>) -> Result<(), StageError> {
        let colour = self.colour(&found.robot);
        output.tags.send(&found.robot, &tags(&found, colour))
    }

    fn topology(&mut self, found: Received<'_, TopologicalMap>, output: &Output<Markers>) -> Result<(), StageError> {
        let colour = self.colour(&found.robot);
        output.ways.send(&found.robot, &ways(&found, colour))
    }

    /// Hypotheses of a pair arrive one by one, by rank; they are shown once all have arrived.
    fn alignment(&mut self, found: Received<'_, Alignment>, output: &Output<Markers>) -> Result<(), StageError> {
        let source = (found.wire(), found.a.clone(), found.b.clone());
        let alignment = found.into_content();
        if !self.frames.contains_key(&alignment.a) {
            self.frames.insert(alignment.a.clone(), alignment.header.frame_id.clone());
        }
        let is_last = alignment.rank + 1 >= alignment.hypotheses;
        self.hypotheses.push(source.clone(), alignment);
        if !is_last {
            return Ok(());
        }
        output.hypotheses.send("", &self.hypotheses.changed(&source))
    }

    /// The last message shows all hypotheses.
    fn finish(&mut self, output: &Output<Markers>) -> Result<(), StageError> {
        match self.hypotheses.rest() {
            Some(shapes) => output.hypotheses.send("", &shapes),
            None => Ok(()),
        }
    }

    /// Verdicts name no frames: their frames are those of the alignments.
    fn verdicts(&mut self, found: Received<'_, Verdicts>, output: &Output<Markers>) -> Result<(), StageError> {
        let mut verdicts = found.into_content();
        for alignment in verdicts.verdicts.iter_mut().map(|verdict| &mut verdict.alignment) {
            if let Some(frame) = self.frames.get(&alignment.a).filter(|_| alignment.header.frame_id.is_empty()) {
                alignment.header.frame_id.clone_from(frame);
            }
        }
        output.graph.send("", &hypotheses(verdicts.verdicts.iter().map(|verdict| &verdict.alignment)))
    }
}
