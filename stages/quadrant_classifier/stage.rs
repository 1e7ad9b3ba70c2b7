//! The stage `quadrant_classifier`.

use super::{
    Direction, FirstGuess, QuadrantClassifierParameters, RotationFrom, first_guess, map_direction, provisional_guess,
    single_tag_guesses,
};
use crate::geometry::{row_by_row, turn_difference};
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{Alignment, CommonTag, CommonTags, Header, MapDirection, Segments};
use gridweave_runtime::stage::{Context, InputPort, Output, OutputPort, PortType, Stage, StageError, StageKind};
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
            InputPort::one(
                "segments",
                PortType::of::<Segments>(),
                "The straight walls of each map; not needed where the rotation comes from the tags alone",
            )
            .or_none(),
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
        QuadrantClassifier::new,
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
    /// What was sent last for a pair, by rank.
    sent: BTreeMap<Pair, Vec<Alignment>>,
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
    fn new(parameters: QuadrantClassifierParameters, context: &Context) -> Result<Self, StageError> {
        // The common tags must be wired, so a single input is theirs.
        if parameters.rotation != RotationFrom::Tags && context.input_types.len() == 1 {
            let cause = "its input `segments` is not wired, and the rotation is to come from the walls";
            return Err(StageError::new(format!("make the stage {}", context.stage), cause)
                .with_help("wire a line_extractor to it, or set rotation = \"tags\""));
        }
        Ok(Self { parameters, ..Default::default() })
    }

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
            let alignments = self.align(&pair, output);
            self.send(pair, alignments, output)?;
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
        let alignments = self.align(&pair, output);
        match self.differs(&pair, &alignments) {
            true => self.send(pair, alignments, output),
            false => Ok(()),
        }
    }

    /// What the common tags of a pair come to: one alignment, or several from a single tag; accepted or refused.
    fn align(&self, pair: &Pair, output: &Output<'_>) -> Vec<Alignment> {
        let Some(common) = self.common.get(pair) else { return Vec::new() };
        let (a, b) = (self.maps.get(&pair.0), self.maps.get(&pair.1));
        let frame_id = a.map_or_else(|| format!("{}/map", pair.0), |map| map.frame_id.clone());
        let of_pair = Alignment {
            header: Header::new(output.log_time(), frame_id),
            a: pair.0.clone(),
            b: pair.1.clone(),
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

    /// The only common tag of a pair, if it may propose something.
    fn single_tag<'a>(&self, common: &'a CommonTags) -> Option<&'a CommonTag> {
        let [tag] = common.tags.as_slice() else { return None };
        let is_certain = tag.common_precision() >= self.parameters.single_tag_certainty;
        (self.parameters.single_tag && is_certain).then_some(tag)
    }

    fn differs(&self, pair: &Pair, alignments: &[Alignment]) -> bool {
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

    fn send(&mut self, pair: Pair, alignments: Vec<Alignment>, output: &mut Output<'_>) -> Result<(), StageError> {
        alignments.iter().try_for_each(|alignment| output.send(ALIGNMENT, "", alignment))?;
        self.sent.insert(pair, alignments);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Point2, Pose2, pose};
    use gridweave_runtime::message::{LogTime, MessageHeader};
    use gridweave_runtime::ros::{CommonTag, Segment, encode};
    use gridweave_runtime::stage::{CollectedOutputs, Node};

    const COMMON: usize = 1;

    struct Run {
        stage: Box<dyn Stage>,
        outputs: CollectedOutputs,
    }

    impl Run {
        fn new() -> Self {
            let kind = kind();
            let Node::Stage(stage) = kind.make(Default::default(), &Context::default()).unwrap() else {
                panic!("a stage")
            };
            Self { stage, outputs: CollectedOutputs::new(&kind) }
        }

        /// Hands the stage a message and gives the alignments that it sends.
        fn receive(&mut self, port: usize, message: &impl serde::Serialize) -> Vec<Alignment> {
            let message = Message::from_vec(MessageHeader::default(), encode(message).unwrap());
            self.stage.receive(port, &message, &mut self.outputs.output(LogTime(7))).unwrap();
            self.outputs.take(ALIGNMENT).iter().map(|message| message.decode().unwrap()).collect()
        }
    }

    /// A room whose walls stand at `angle`.
    fn segments(robot: &str, angle: f64) -> Segments {
        let wall = |(x1, y1, x2, y2): (f64, f64, f64, f64)| {
            let turn = pose(0.0, 0.0, angle);
            let (a, b) = (turn * Point2::new(x1, y1), turn * Point2::new(x2, y2));
            Segment { x1: a.x, y1: a.y, x2: b.x, y2: b.y, reliability: 1.0, inliers: 50 }
        };
        let room = [(0.0, 0.0, 8.0, 0.0), (8.0, 0.0, 8.0, 5.0), (8.0, 5.0, 0.0, 5.0), (0.0, 5.0, 0.0, 0.0)];
        let header = Header { frame_id: format!("{robot}/map"), ..Default::default() };
        Segments { header, robot: robot.into(), segments: room.map(wall).to_vec() }
    }

    fn common(transform_a_b: &Pose2) -> CommonTags {
        let tag = |(x, y): (f64, f64)| {
            let a = transform_a_b * Point2::new(x, y);
            let covariance = [0.001, 0.0, 0.0, 0.001];
            CommonTag {
                a: [a.x, a.y],
                b: [x, y],
                covariance_a: covariance,
                covariance_b: covariance,
                certainty_a: 0.95,
                certainty_b: 0.9,
                ..Default::default()
            }
        };
        let tags = [(1.0, 0.0), (8.0, 2.0), (3.0, 5.0)].map(tag).to_vec();
        let (robot_a, robot_b) = ("robot1".into(), "robot2".into());
        CommonTags { robot_a, robot_b, tags, accepted: true, ..Default::default() }
    }

    #[test]
    fn maps_and_common_tags_give_an_alignment_which_every_new_map_sends_again() {
        let mut run = Run::new();
        let truth = pose(4.0, -2.0, 2.5);
        assert!(run.receive(SEGMENTS, &segments("robot1", 2.5)).is_empty());
        let directions = run.outputs.take(DIRECTION);
        let direction: MapDirection = directions[0].decode().unwrap();
        assert!(direction.valid && turn_difference(direction.direction, 2.5, TAU / 4.0).abs() < 1e-9);

        let first = run.receive(COMMON, &common(&truth));
        assert_eq!(first.len(), 1);
        assert_eq!(first[0].method, "tags");
        assert!(run.receive(COMMON, &common(&truth)).is_empty(), "nothing has changed");

        let second = run.receive(SEGMENTS, &segments("robot2", 0.0));
        assert_eq!(second.len(), 1);
        assert_eq!((second[0].method.as_str(), second[0].accepted), ("tags+directions", true));
        assert_eq!((second[0].a.as_str(), second[0].b.as_str()), ("robot1", "robot2"));
        assert_eq!(second[0].header.frame_id, "robot1/map");
        assert_eq!(second[0].score, 0.9);
        let error = second[0].transform_a_b() * truth.inverse();
        assert!(error.translation.vector.norm() < 1e-6 && error.rotation.angle().abs() < 1e-9);
        assert!(second[0].covariance.iter().all(|value| value.is_finite()) && second[0].covariance[8] > 0.0);

        assert_eq!(run.receive(SEGMENTS, &segments("robot2", 0.0)), second, "the refiner works on the map");
        assert!(run.receive(SEGMENTS, &segments("robot3", 0.0)).is_empty(), "it is in no pair");
        assert_eq!(run.receive(COMMON, &common(&pose(4.0, -1.9, 2.5))).len(), 1);
        assert_eq!(run.stage.report().unwrap()["directions"]["robot2"]["valid"], true);
    }

    #[test]
    fn refused_tags_are_passed_on_with_their_reason() {
        let mut run = Run::new();
        let refused = CommonTags { accepted: false, reason: "two tags only".into(), ..common(&pose(0.0, 0.0, 0.0)) };
        let sent = run.receive(COMMON, &refused);
        assert_eq!((sent[0].accepted, sent[0].reason.as_str()), (false, "two tags only"));
        assert!(run.receive(COMMON, &refused).is_empty());
        let together = CommonTags { tags: vec![refused.tags[0].clone(); 3], accepted: true, ..refused };
        let sent = run.receive(COMMON, &together);
        assert!(!sent[0].accepted && sent[0].reason.contains("do not tell the rotation"), "{}", sent[0].reason);
    }

    #[test]
    fn walls_may_be_left_unwired_where_the_tags_alone_tell_the_rotation() {
        let context = Context { input_types: vec!["gridweave_msgs/msg/CommonTags".into()], ..Default::default() };
        let make = |parameters: &str| kind().make(parameters.parse().unwrap(), &context).err();
        assert!(make("rotation = \"tags\"").is_none());
        for rotation in ["directions", "both"] {
            let error = make(&format!("rotation = \"{rotation}\"")).unwrap().to_string();
            assert!(error.contains("`segments` is not wired"), "{error}");
        }
    }

    #[test]
    fn two_tags_wait_for_both_maps_and_stay_provisional() {
        let mut run = Run::new();
        let truth = pose(4.0, -2.0, 2.5);
        let all = common(&truth);
        let two = CommonTags { tags: all.tags[..2].to_vec(), provisional: true, ..all.clone() };
        run.receive(SEGMENTS, &segments("robot1", 2.5));
        let sent = run.receive(COMMON, &two);
        assert!(!sent[0].accepted && sent[0].reason.contains("a map has not come yet"), "{}", sent[0].reason);
        let sent = run.receive(SEGMENTS, &segments("robot2", 0.0));
        assert_eq!((sent[0].accepted, sent[0].provisional), (true, true));
        assert_eq!(sent[0].method, "few tags+directions");
        assert!(sent[0].reason.starts_with("2 common tags only"), "{}", sent[0].reason);
        let error = sent[0].transform_a_b() * truth.inverse();
        assert!(error.translation.vector.norm() < 1e-6 && error.rotation.angle().abs() < 1e-9);
        let sent = run.receive(COMMON, &all);
        assert_eq!((sent[0].accepted, sent[0].provisional), (true, false), "the third tag suffices");
        let sent = run.receive(SEGMENTS, &segments("robot2", 0.3));
        assert!(sent[0].accepted, "directions that contradict three tags are left out");
        let sent = run.receive(COMMON, &two);
        assert!(!sent[0].accepted && sent[0].reason.contains("must confirm"), "{}", sent[0].reason);
    }

    #[test]
    fn a_single_tag_proposes_every_quarter_turn_if_it_may() {
        let truth = pose(4.0, -2.0, 2.5);
        let all = common(&truth);
        let one = CommonTags { tags: all.tags[..1].to_vec(), accepted: false, reason: "one tag".into(), ..all };
        let mut run = Run::new();
        run.receive(SEGMENTS, &segments("robot1", 2.5));
        run.receive(SEGMENTS, &segments("robot2", 0.0));
        assert_eq!(run.receive(COMMON, &one)[0].reason, "one tag", "it is not asked for");
        let parameters = "single_tag = true".parse().unwrap();
        let Node::Stage(stage) = kind().make(parameters, &Context::default()).unwrap() else { panic!("a stage") };
        run.stage = stage;
        run.receive(SEGMENTS, &segments("robot1", 2.5));
        run.receive(SEGMENTS, &segments("robot2", 0.0));
        let sent = run.receive(COMMON, &one);
        let ranks: Vec<(u32, u32, bool, bool)> =
            sent.iter().map(|one| (one.rank, one.hypotheses, one.accepted, one.provisional)).collect();
        assert_eq!(ranks, [(0, 4, true, true), (1, 4, true, true), (2, 4, true, true), (3, 4, true, true)]);
        assert!(sent.iter().all(|one| one.method == "one tag+directions" && one.source() == "tag"));
        assert!(run.receive(COMMON, &one).is_empty(), "nothing has changed");
        let vague = CommonTags { tags: vec![CommonTag { certainty_a: 0.8, ..one.tags[0].clone() }], ..one.clone() };
        assert!(!run.receive(COMMON, &vague)[0].accepted);
    }

    #[test]
    fn what_cannot_be_read_and_a_robot_paired_with_itself_are_left_out_with_a_warning() {
        let mut run = Run::new();
        let broken = Message::from_vec(MessageHeader::default(), vec![0, 1]);
        for port in [SEGMENTS, COMMON] {
            run.stage.receive(port, &broken, &mut run.outputs.output(LogTime(1))).unwrap();
        }
        let own = CommonTags { robot_b: "robot1".into(), ..common(&pose(0.0, 0.0, 0.0)) };
        assert!(run.receive(COMMON, &own).is_empty());
        assert_eq!(run.outputs.warnings().len(), 3);
    }
}
