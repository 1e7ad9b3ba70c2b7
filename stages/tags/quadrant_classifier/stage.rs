//! The stage `quadrant_classifier`.

use super::{
    Direction, FirstGuess, QuadrantClassifierParameters, RotationFrom, first_guess, map_direction, provisional_guess,
    single_tag_guesses,
};
use crate::shared::geometry::{row_by_row, turn_difference};
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::{Alignment, CommonTag, CommonTags, Header, MapDirection, Segments};
use gridweave_runtime::stage::{Context, Out, Output, OutputPorts, Outputs, Received, StageError, StageKind};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// The stage kind `quadrant_classifier`: walls and common tags in, the maps' directions and first alignments out.
pub fn kind() -> StageKind {
    StageKind::stage(
        "quadrant_classifier",
        "Estimates the direction of each map's walls, and with common tags a first guess of the relative pose of two maps",
        QuadrantClassifier::new,
    )
    .optional_input(
        "segments",
        "The straight walls of each map; not needed where the rotation is that of the tags only",
        QuadrantClassifier::receive_segments,
    )
    .input("common", "The common tags of each pair of robots", QuadrantClassifier::receive_common)
    .build()
}

/// Direction and frame of one robot's map.
struct Map {
    direction: Direction,
    frame_id: String,
}

#[derive(Default)]
struct QuadrantClassifier {
    parameters: QuadrantClassifierParameters,
    maps: BTreeMap<String, Map>,
    common: BTreeMap<RobotPair, CommonTags>,
    /// Alignments sent last for a pair, by rank.
    sent: BTreeMap<RobotPair, Vec<Alignment>>,
}

struct Rotations {
    direction: Out<MapDirection>,
    alignment: Out<Alignment>,
}

impl Outputs for Rotations {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            direction: ports.output("direction", "The direction of each map's walls"),
            alignment: ports.output("alignment", "A first guess of the relative pose of two maps"),
        }
    }
}

impl QuadrantClassifier {
    fn new(parameters: QuadrantClassifierParameters, context: &Context) -> Result<Self, StageError> {
        // In isolation, as in a test, a stage has no wires at all.
        let is_in_a_pipeline = !context.inputs.is_empty();
        if parameters.rotation != RotationFrom::Tags && is_in_a_pipeline && !context.is_wired("segments") {
            let cause = "its input `segments` is not wired, and the rotation is to come from the walls";
            return Err(StageError::new(format!("make the stage {}", context.stage), cause)
                .with_help("wire a line_extractor to it, or set rotation = \"tags\""));
        }
        Ok(Self { parameters, ..Default::default() })
    }

    fn receive_segments(
        &mut self,
        segments: Received<'_, Segments>,
        output: &Output<Rotations>,
    ) -> Result<(), StageError> {
        let Segments { header, robot, segments } = segments.into_content();
        let direction = map_direction(&segments, &self.parameters);
        let message = MapDirection {
            header: header.clone(),
            robot: robot.clone(),
            direction: direction.angle,
            deviation: direction.deviation,
            groups: direction.groups,
            agreement: direction.agreement,
            valid: direction.valid,
        };
        output.direction.send(&robot, &message)?;
        self.maps.insert(robot.clone(), Map { direction, frame_id: header.frame_id });

        // ICP works on the maps, so each new map needs the alignment again, changed or not.
        let pairs: Vec<RobotPair> = self.common.keys().filter(|pair| pair.concerns(&robot)).cloned().collect();
        for pair in pairs {
            let alignments = self.align(&pair, output);
            self.send(pair, alignments, output)?;
        }
        Ok(())
    }

    fn receive_common(
        &mut self,
        common: Received<'_, CommonTags>,
        output: &Output<Rotations>,
    ) -> Result<(), StageError> {
        let common = common.into_content();
        if common.robot_a == common.robot_b {
            output.warn(format!("common tags of `{}` with itself were left out", common.robot_a));
            return Ok(());
        }
        let pair = RobotPair::new(&common.robot_a, &common.robot_b);
        self.common.insert(pair.clone(), common);
        let alignments = self.align(&pair, output);
        match self.differs(&pair, &alignments) {
            true => self.send(pair, alignments, output),
            false => Ok(()),
        }
    }

    /// Alignment of a pair from its common tags, or several from a single tag; accepted or refused.
    fn align(&self, pair: &RobotPair, output: &Output<Rotations>) -> Vec<Alignment> {
        let Some(common) = self.common.get(pair) else { return Vec::new() };
        let (a, b) = (self.maps.get(&pair.a), self.maps.get(&pair.b));
        let frame_id = a.map_or_else(|| format!("{}/map", pair.a), |map| map.frame_id.clone());
        let of_pair = Alignment {
            header: Header::new(output.log_time(), frame_id),
            a: pair.a.clone(),
            b: pair.b.clone(),
            source: "tags".into(),
            method: "tags".into(),
            ..Default::default()
        };
        let refused = |reason: String| vec![Alignment { reason, ..of_pair.clone() }];
        let (a, b) = (a.map(|map| &map.direction), b.map(|map| &map.direction));
        let guesses = match (common.accepted, common.provisional, self.single_tag(common)) {
            (true, false, _) => first_guess(&common.tags, a, b, &self.parameters).map(|guess| vec![guess]),
            (true, true, _) => provisional_guess(&common.tags, a, b, &self.parameters).map(|guess| vec![guess]),
            (false, _, Some(tag)) => single_tag_guesses(tag, a, b, &self.parameters),
            (false, _, None) => return refused(common.reason.clone()),
        };
        let guesses = match guesses {
            Ok(guesses) => guesses,
            Err(error) => return refused(error.to_string()),
        };
        let count = guesses.len() as u32;
        let alignment = |(rank, guess): (u32, FirstGuess)| {
            let mut alignment = Alignment {
                covariance: row_by_row(&guess.covariance),
                score: guess.score,
                method: guess.method.into(),
                reason: guess.reason,
                accepted: true,
                provisional: common.provisional || !common.accepted,
                rank,
                hypotheses: if count > 1 { count } else { 0 },
                ..of_pair.clone()
            };
            alignment.set_transform_a_b(&guess.transform_a_b);
            alignment
        };
        (0..).zip(guesses).map(alignment).collect()
    }

    /// The only common tag of a pair, if it may give hypotheses.
    fn single_tag<'a>(&self, common: &'a CommonTags) -> Option<&'a CommonTag> {
        let [tag] = common.tags.as_slice() else { return None };
        let is_certain = tag.common_precision() >= self.parameters.single_tag_certainty;
        (self.parameters.single_tag && is_certain).then_some(tag)
    }

    fn differs(&self, pair: &RobotPair, alignments: &[Alignment]) -> bool {
        let Some(sent) = self.sent.get(pair).filter(|sent| sent.len() == alignments.len()) else { return true };
        sent.iter().zip(alignments).any(|(sent, alignment)| {
            let moved = (alignment.x - sent.x).hypot(alignment.y - sent.y);
            let turned = turn_difference(alignment.yaw, sent.yaw, TAU).abs();
            moved > self.parameters.resend_distance
                || turned > self.parameters.resend_angle
                || (alignment.accepted, alignment.provisional, &alignment.method, &alignment.reason)
                    != (sent.accepted, sent.provisional, &sent.method, &sent.reason)
        })
    }

    fn send(
        &mut self,
        pair: RobotPair,
        alignments: Vec<Alignment>,
        output: &Output<Rotations>,
    ) -> Result<(), StageError> {
        alignments.iter().try_for_each(|alignment| output.alignment.send("", alignment))?;
        self.sent.insert(pair, alignments);
        Ok(())
    }
}
