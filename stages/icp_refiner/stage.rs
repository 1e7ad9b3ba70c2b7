//! The stage: keeps each robot's map with its walls, and refines the first guesses for a pair when one of the maps or the
//! guesses change.

use super::{FirstGuess, IcpParameters, Refinement, WallMap, refine};
use crate::geometry::{read_map, row_by_row, wrap_angle};
use crate::hypotheses::{HypothesisGatherer, Origin};
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{Alignment, Header};
use gridweave_runtime::stage::{Output, Stage, StageError};
use nalgebra::Matrix3;
use std::cell::OnceCell;
use std::collections::BTreeMap;

/// The input port of the maps; the other is that of the first guesses.
const MAP_INPUT: usize = 0;
/// The output port of the refined alignments.
const ALIGNMENT_OUTPUT: usize = 0;

/// Refines the alignments of pairs of robots.
pub(super) struct IcpRefiner {
    parameters: IcpParameters,
    maps: BTreeMap<String, RobotMap>,
    gatherer: HypothesisGatherer,
    guesses: BTreeMap<Origin, Guesses>,
    /// Registrations made, for the report.
    registrations: u64,
}

/// A robot's last map. The message is kept as it came; the walls are made when they are first asked for.
struct RobotMap {
    message: Message,
    /// How many usable maps of the robot came before it.
    number: u64,
    walls: OnceCell<WallMap>,
}

/// The last first guesses of one stage for one pair of robots, by rank, and what was made of them.
#[derive(Default)]
struct Guesses {
    /// The robot that the message was about; empty as a rule.
    robot: String,
    first: Vec<Alignment>,
    refined: Vec<Refined>,
    sent: Vec<Alignment>,
}

/// A refinement and what it was made from.
struct Refined {
    /// The numbers of the two maps.
    maps: (u64, u64),
    first_guess: Alignment,
    refinement: Refinement,
}

impl IcpRefiner {
    pub(super) fn new(parameters: IcpParameters) -> Self {
        Self {
            parameters,
            maps: BTreeMap::new(),
            gatherer: HypothesisGatherer::default(),
            guesses: BTreeMap::new(),
            registrations: 0,
        }
    }

    fn receive_map(&mut self, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let robot = message.robot();
        if let Err(problem) = read_map(message) {
            output.warn(format!("a map of {robot} was left out: {problem}"));
            return Ok(());
        }
        let number = self.maps.get(robot).map_or(0, |map| map.number + 1);
        let map = RobotMap { message: message.clone(), number, walls: OnceCell::new() };
        self.maps.insert(robot.to_owned(), map);
        let origins: Vec<Origin> = self.guesses.keys().filter(|origin| origin.concerns(robot)).cloned().collect();
        origins.iter().try_for_each(|origin| self.update(origin, output))
    }

    fn receive_alignment(&mut self, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let first_guess: Alignment = match message.decode() {
            Ok(first_guess) => first_guess,
            Err(error) => {
                output.warn(format!("a first guess was left out: {error}"));
                return Ok(());
            }
        };
        if !(first_guess.x.is_finite() && first_guess.y.is_finite() && first_guess.yaw.is_finite()) {
            output.warn("a first guess was left out: it holds a value that is no finite number");
            return Ok(());
        }
        match self.gatherer.add(first_guess) {
            Ok(None) => Ok(()),
            Ok(Some((origin, first))) => {
                let guesses = self.guesses.entry(origin.clone()).or_default();
                guesses.robot = message.robot().to_owned();
                guesses.first = first;
                self.update(&origin, output)
            }
            Err(missing) => {
                output.warn(missing.to_string());
                Ok(())
            }
        }
    }

    /// Sends what is known of some guesses, if it is not what was sent last.
    fn update(&mut self, origin: &Origin, output: &mut Output<'_>) -> Result<(), StageError> {
        let Some(guesses) = self.guesses.get_mut(origin) else { return Ok(()) };
        let maps = self.maps.get(&origin.a).zip(self.maps.get(&origin.b));
        if maps.is_none() && guesses.first.iter().any(|guess| guess.accepted) {
            return Ok(());
        }
        let mut before = std::mem::take(&mut guesses.refined).into_iter();
        let mut alignments = Vec::with_capacity(guesses.first.len());
        for guess in &guesses.first {
            let Some((a, b)) = maps.filter(|_| guess.accepted) else {
                alignments.push(guess.clone());
                continue;
            };
            let reusable = before
                .next()
                .filter(|refined| refined.maps == (a.number, b.number) && refined.holds_for(guess, &self.parameters));
            let refined = match reusable {
                Some(refined) => refined,
                None => {
                    self.registrations += 1;
                    let refinement = refine_pair(a, b, guess, &self.parameters)?;
                    Refined { maps: (a.number, b.number), first_guess: guess.clone(), refinement }
                }
            };
            alignments.push(refined.alignment(guess, output));
            guesses.refined.push(refined);
        }
        guesses.send(alignments, output)
    }
}

impl Stage for IcpRefiner {
    fn receive(&mut self, port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        match port {
            MAP_INPUT => self.receive_map(message, output),
            _ => self.receive_alignment(message, output),
        }
    }

    /// Guesses that wait for a map to the end are refused, so that they do not go missing.
    fn finish(&mut self, output: &mut Output<'_>) -> Result<(), StageError> {
        for (Origin { a, b, .. }, guesses) in &mut self.guesses {
            let missing: Vec<&str> =
                [a, b].into_iter().filter(|robot| !self.maps.contains_key(*robot)).map(String::as_str).collect();
            if missing.is_empty() || guesses.first.iter().all(|guess| !guess.accepted) {
                continue;
            }
            let reason =
                format!("no usable map of {} has come, so the alignment cannot be refined", missing.join(" and "));
            let refused = |guess: &Alignment| Alignment { accepted: false, reason: reason.clone(), ..guess.clone() };
            guesses.send(guesses.first.iter().map(refused).collect(), output)?;
        }
        Ok(())
    }

    fn report(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "registrations": self.registrations }))
    }
}

impl Guesses {
    /// Sends alignments, unless they tell only what was sent last. They are sent together, as they are judged together.
    fn send(&mut self, alignments: Vec<Alignment>, output: &mut Output<'_>) -> Result<(), StageError> {
        let is_same = |(sent, alignment): (&Alignment, &Alignment)| {
            *sent == Alignment { header: sent.header.clone(), ..alignment.clone() }
        };
        if self.sent.len() == alignments.len() && self.sent.iter().zip(&alignments).all(is_same) {
            return Ok(());
        }
        for alignment in &alignments {
            output.send(ALIGNMENT_OUTPUT, &self.robot, alignment)?;
        }
        self.sent = alignments;
        Ok(())
    }
}

impl Refined {
    /// Whether the refinement would come out the same from another first guess.
    ///
    /// One that was accepted holds for every first guess nearby. One that was refused might have failed for its first
    /// guess, and holds for that alone.
    fn holds_for(&self, first_guess: &Alignment, parameters: &IcpParameters) -> bool {
        let before = &self.first_guess;
        if self.refinement.refusal.is_some() {
            return (before.x, before.y, before.yaw, before.covariance)
                == (first_guess.x, first_guess.y, first_guess.yaw, first_guess.covariance);
        }
        // In the middle of the common section: at the frame's origin a turn far away looks like a shift.
        let centre_b = self.refinement.registration.transform_a_b.inverse() * self.refinement.registration.centre;
        let shift = before.transform_a_b() * centre_b - first_guess.transform_a_b() * centre_b;
        shift.norm() <= parameters.reuse_within
            && wrap_angle(before.yaw - first_guess.yaw).abs() <= parameters.reuse_within_yaw
    }

    /// The message that tells of it. What the first guess rests on is part of the reason.
    fn alignment(&self, first_guess: &Alignment, output: &Output<'_>) -> Alignment {
        let Refinement { registration, refusal } = &self.refinement;
        let mut alignment = Alignment {
            header: Header::new(output.log_time(), first_guess.header.frame_id.clone()),
            covariance: row_by_row(&registration.covariance),
            method: format!("{}+icp", first_guess.method),
            accepted: refusal.is_none(),
            reason: format!("{}; {}", first_guess.reason, self.refinement.reason()),
            ..first_guess.clone()
        };
        alignment.set_transform_a_b(&registration.transform_a_b);
        alignment
    }
}

fn refine_pair(
    a: &RobotMap,
    b: &RobotMap,
    first_guess: &Alignment,
    parameters: &IcpParameters,
) -> Result<Refinement, StageError> {
    let doing = || format!("refine the alignment of `{}` and `{}`", first_guess.a, first_guess.b);
    let (_, grid_a) = read_map(&a.message).map_err(|error| StageError::new(doing(), error))?;
    let (_, grid_b) = read_map(&b.message).map_err(|error| StageError::new(doing(), error))?;
    let walls_a = a.walls.get_or_init(|| WallMap::new(&grid_a, parameters.normal_radius));
    let walls_b = b.walls.get_or_init(|| WallMap::new(&grid_b, parameters.normal_radius));
    let covariance = Matrix3::from_row_slice(&first_guess.covariance);
    let first_guess = FirstGuess::new(first_guess.transform_a_b(), covariance, parameters);
    Ok(refine(walls_a, walls_b, &first_guess, parameters))
}
