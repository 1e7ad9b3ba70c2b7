//! The stage: keeps each robot's map with its walls, and refines each pair's first guess when one of the three changes.

use super::{FirstGuess, IcpParameters, MapView, Refinement, WallMap, refine, refine_provisional};
use crate::geometry::{read_map, row_by_row, wrap_angle};
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
    pairs: BTreeMap<(String, String), Pair>,
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

/// A pair of robots: the last first guess, and what was made of it.
#[derive(Default)]
struct Pair {
    /// The robot that the first guess's message was about; empty as a rule.
    robot: String,
    /// The last first guess, refused or not.
    first_guess: Alignment,
    refined: Option<Refined>,
    sent: Option<Alignment>,
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
        Self { parameters, maps: BTreeMap::new(), pairs: BTreeMap::new(), registrations: 0 }
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
        let pairs: Vec<_> = self.pairs.keys().filter(|(a, b)| a == robot || b == robot).cloned().collect();
        pairs.iter().try_for_each(|pair| self.update(pair, output))
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
        let key = (first_guess.a.clone(), first_guess.b.clone());
        let pair = self.pairs.entry(key.clone()).or_default();
        pair.robot = message.robot().to_owned();
        pair.first_guess = first_guess;
        self.update(&key, output)
    }

    /// Sends what is known of a pair, if it is not what was sent last.
    fn update(&mut self, key: &(String, String), output: &mut Output<'_>) -> Result<(), StageError> {
        let Some(pair) = self.pairs.get_mut(key) else { return Ok(()) };
        if !pair.first_guess.accepted {
            return pair.send(pair.first_guess.clone(), output);
        }
        let (Some(a), Some(b)) = (self.maps.get(&key.0), self.maps.get(&key.1)) else { return Ok(()) };
        let reusable = pair.refined.take().filter(|refined| {
            refined.maps == (a.number, b.number) && refined.holds_for(&pair.first_guess, &self.parameters)
        });
        let refined = match reusable {
            Some(refined) => refined,
            None => {
                self.registrations += 1;
                let refinement = refine_pair(a, b, &pair.first_guess, &self.parameters)?;
                Refined { maps: (a.number, b.number), first_guess: pair.first_guess.clone(), refinement }
            }
        };
        let alignment = refined.alignment(&pair.first_guess, output);
        pair.refined = Some(refined);
        pair.send(alignment, output)
    }
}

impl Stage for IcpRefiner {
    fn receive(&mut self, port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        match port {
            MAP_INPUT => self.receive_map(message, output),
            _ => self.receive_alignment(message, output),
        }
    }

    /// A pair that waits for a map to the end is refused, so that it does not go missing.
    fn finish(&mut self, output: &mut Output<'_>) -> Result<(), StageError> {
        for ((a, b), pair) in &mut self.pairs {
            let missing: Vec<&str> =
                [a, b].into_iter().filter(|robot| !self.maps.contains_key(*robot)).map(String::as_str).collect();
            if pair.first_guess.accepted && !missing.is_empty() {
                let mut alignment = pair.first_guess.clone();
                alignment.accepted = false;
                alignment.reason =
                    format!("no usable map of {} has come, so the alignment cannot be verified", missing.join(" and "));
                pair.send(alignment, output)?;
            }
        }
        Ok(())
    }

    fn report(&self) -> Option<serde_json::Value> {
        Some(serde_json::json!({ "registrations": self.registrations }))
    }
}

impl Pair {
    /// Sends an alignment, unless it tells only what was sent last.
    fn send(&mut self, alignment: Alignment, output: &mut Output<'_>) -> Result<(), StageError> {
        if let Some(sent) = &mut self.sent {
            sent.header = alignment.header.clone();
        }
        if self.sent.as_ref() == Some(&alignment) {
            return Ok(());
        }
        output.send(ALIGNMENT_OUTPUT, &self.robot, &alignment)?;
        self.sent = Some(alignment);
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
        if before.provisional != first_guess.provisional {
            return false;
        }
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

    /// What speaks for or against it. A provisional first guess has its own reason in it, for the walls alone are not
    /// what the alignment rests on.
    fn reason(&self, first_guess: &Alignment) -> String {
        let by_walls = self.refinement.reason();
        let Refinement { rival, refusal, agreement, .. } = &self.refinement;
        let before = &first_guess.reason;
        match (first_guess.provisional, refusal, rival) {
            (false, ..) => by_walls,
            (true, Some(_), _) => format!("{before}; the walls do not confirm them: {by_walls}"),
            (true, None, None) => format!("{before}; the walls confirm them: {by_walls}"),
            (true, None, Some(rival)) => format!(
                "{before}; the walls confirm them: {by_walls}; {:.0} % of the walls agree, and {:.0} % at the best of other places",
                100.0 * agreement.wall_agreement(),
                100.0 * rival.agreement.wall_agreement(),
            ),
        }
    }

    /// The message that tells of it.
    fn alignment(&self, first_guess: &Alignment, output: &Output<'_>) -> Alignment {
        let Refinement { registration, agreement, refusal, .. } = &self.refinement;
        let mut alignment = Alignment {
            header: Header::new(output.log_time(), first_guess.header.frame_id.clone()),
            a: first_guess.a.clone(),
            b: first_guess.b.clone(),
            covariance: row_by_row(&registration.covariance),
            score: agreement.wall_agreement(),
            method: format!("{}+icp", first_guess.method),
            accepted: refusal.is_none(),
            reason: self.reason(first_guess),
            ..Alignment::default()
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
    let refine = if first_guess.provisional { refine_provisional } else { refine };
    let first_guess = FirstGuess::new(first_guess.transform_a_b(), covariance, parameters);
    let (a, b) = (MapView { grid: grid_a, walls: walls_a }, MapView { grid: grid_b, walls: walls_b });
    Ok(refine(&a, &b, &first_guess, parameters))
}
