//! The stage `quadrant_classifier`.

use super::{Direction, QuadrantClassifierParameters, first_guess, map_direction};
use crate::geometry::turn_difference;
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{Alignment, CommonTags, Header, MapDirection, Segments};
use gridweave_runtime::stage::{InputPort, Output, OutputPort, PortType, Stage, StageError, StageKind};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

const SEGMENTS: usize = 0;
const DIRECTION: usize = 0;
const ALIGNMENT: usize = 1;

/// The stage kind `quadrant_classifier`: walls and common tags in, the maps' directions and first alignments out.
pub fn kind() -> StageKind {
    StageKind::stage(
        "quadrant_classifier",
        "Finds the direction of each map's walls, and with common tags how two maps lie to each other",
        vec![
            InputPort::one("segments", PortType::of::<Segments>(), "The straight walls of each map"),
            InputPort::one("common", PortType::of::<CommonTags>(), "The common tags of each pair of robots"),
        ],
        vec![
            OutputPort::new("direction", PortType::of::<MapDirection>(), "The direction of each map's walls"),
            OutputPort::new(
                "alignment",
                PortType::of::<Alignment>(),
                "A first guess of how two maps lie to each other",
            ),
        ],
        |parameters: QuadrantClassifierParameters, _| Ok(QuadrantClassifier { parameters, ..Default::default() }),
    )
}

/// The names of two robots, the first by name first.
type Pair = (String, String);

/// What is known of one robot's map.
struct Map {
    direction: Direction,
    frame_id: String,
}

#[derive(Default)]
struct QuadrantClassifier {
    parameters: QuadrantClassifierParameters,
    maps: BTreeMap<String, Map>,
    common: BTreeMap<Pair, CommonTags>,
    sent: BTreeMap<Pair, Alignment>,
}

impl Stage for QuadrantClassifier {
    fn receive(&mut self, port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        match port {
            SEGMENTS => match message.decode() {
                Ok(segments) => self.receive_segments(segments, output),
                Err(error) => warn_undecoded("segments", &error, output),
            },
            _ => match message.decode() {
                Ok(common) => self.receive_common(common, output),
                Err(error) => warn_undecoded("common tags", &error, output),
            },
        }
    }

    fn report(&self) -> Option<serde_json::Value> {
        let direction = |(robot, map): (&String, &Map)| {
            let Direction { angle, deviation, agreement, valid, .. } = map.direction;
            let value = serde_json::json!({
                "direction": angle, "deviation": deviation, "agreement": agreement, "valid": valid,
            });
            (robot.clone(), value)
        };
        let directions: serde_json::Map<String, serde_json::Value> = self.maps.iter().map(direction).collect();
        Some(serde_json::json!({ "directions": directions }))
    }
}

fn warn_undecoded(what: &str, error: &impl std::fmt::Display, output: &mut Output<'_>) -> Result<(), StageError> {
    output.warn(format!("{what} were left out: {error}"));
    Ok(())
}

impl QuadrantClassifier {
    fn receive_segments(&mut self, segments: Segments, output: &mut Output<'_>) -> Result<(), StageError> {
        let Segments { header, robot, segments } = segments;
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
        output.send(DIRECTION, &robot, &message)?;
        self.maps.insert(robot.clone(), Map { direction, frame_id: header.frame_id });

        // What refines an alignment works on the maps, so each new map calls for it, changed or not.
        let pairs: Vec<Pair> = self.common.keys().filter(|(a, b)| *a == robot || *b == robot).cloned().collect();
        for pair in pairs {
            if let Some(alignment) = self.align(&pair, output) {
                self.send(pair, alignment, output)?;
            }
        }
        Ok(())
    }

    fn receive_common(&mut self, common: CommonTags, output: &mut Output<'_>) -> Result<(), StageError> {
        if common.robot_a == common.robot_b {
            output.warn(format!("common tags of `{}` with itself were left out", common.robot_a));
            return Ok(());
        }
        let pair = (common.robot_a.clone(), common.robot_b.clone());
        self.common.insert(pair.clone(), common);
        match self.align(&pair, output) {
            Some(alignment) if self.differs(&pair, &alignment) => self.send(pair, alignment, output),
            _ => Ok(()),
        }
    }

    fn align(&self, pair: &Pair, output: &Output<'_>) -> Option<Alignment> {
        let common = self.common.get(pair)?;
        let (a, b) = (self.maps.get(&pair.0), self.maps.get(&pair.1));
        let frame_id = a.map_or_else(|| format!("{}/map", pair.0), |map| map.frame_id.clone());
        let mut alignment = Alignment {
            header: Header::new(output.log_time(), frame_id),
            a: pair.0.clone(),
            b: pair.1.clone(),
            method: "tags".into(),
            ..Default::default()
        };
        if !common.accepted {
            alignment.reason.clone_from(&common.reason);
            return Some(alignment);
        }
        let direction = |map: Option<&Map>| map.map(|map| map.direction);
        match first_guess(&common.tags, direction(a).as_ref(), direction(b).as_ref(), &self.parameters) {
            Ok(guess) => {
                alignment.set_transform_a_b(&guess.transform_a_b);
                // A symmetric matrix reads the same by rows as by columns.
                alignment.covariance.copy_from_slice(guess.covariance.as_slice());
                alignment.score = guess.score;
                alignment.method = guess.method.into();
                alignment.reason = guess.reason;
                alignment.accepted = true;
            }
            Err(error) => alignment.reason = error.to_string(),
        }
        Some(alignment)
    }

    fn differs(&self, pair: &Pair, alignment: &Alignment) -> bool {
        let Some(sent) = self.sent.get(pair) else { return true };
        let moved = (alignment.x - sent.x).hypot(alignment.y - sent.y);
        let turned = turn_difference(alignment.yaw, sent.yaw, TAU).abs();
        moved > self.parameters.resend_distance
            || turned > self.parameters.resend_angle
            || (alignment.accepted, &alignment.method, &alignment.reason) != (sent.accepted, &sent.method, &sent.reason)
    }

    fn send(&mut self, pair: Pair, alignment: Alignment, output: &mut Output<'_>) -> Result<(), StageError> {
        output.send(ALIGNMENT, "", &alignment)?;
        self.sent.insert(pair, alignment);
        Ok(())
    }
}
