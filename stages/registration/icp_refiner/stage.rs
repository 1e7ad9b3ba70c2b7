//! The stage: keeps each robot's map with its walls, and refines the first guesses of a pair when a map or the
//! guesses change.

use crate::registration::hypotheses::{HypothesisGatherer, Origin, has_covariance_of_fit};
use crate::registration::icp::{IcpParameters, IcpRefusal, InitialGuess, RefinedAlignment, refine};
use crate::shared::geometry::{row_by_row, wrap_angle};
use crate::shared::robot_maps::RobotMaps;
use crate::shared::walls::WallsOnDemand;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Alignment, Header, IcpErrors, OccupancyGrid};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use nalgebra::Matrix3;
use std::collections::BTreeMap;

/// Outputs of the stage.
pub(super) struct RefinedAlignments {
    alignment: Out<Alignment>,
    errors: Out<IcpErrors>,
}

impl Outputs for RefinedAlignments {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "The refined alignments, ranked as before, each accepted or refused.";
        Self {
            alignment: ports.output("alignment", summary),
            errors: ports.output("errors", "The residual of the walls in each iteration of each registration."),
        }
    }
}

/// Refines the alignments of pairs of robots.
pub(super) struct IcpRefiner {
    parameters: IcpParameters,
    maps: RobotMaps<WallsOnDemand>,
    gatherer: HypothesisGatherer,
    guesses: BTreeMap<Origin, Guesses>,
}

/// The latest first guesses of one source for one pair of robots, by rank, and their refinements.
#[derive(Default)]
struct Guesses {
    /// The robot of the message's topic; usually empty.
    robot: String,
    first: Vec<Alignment>,
    refined: Vec<Refined>,
    sent: Vec<Alignment>,
}

/// A refinement, and what it was computed from.
struct Refined {
    /// Numbers of the two maps.
    maps: (u64, u64),
    first_guess: Alignment,
    refinement: RefinedAlignment,
}

impl IcpRefiner {
    pub(super) fn new(parameters: IcpParameters) -> Self {
        Self {
            parameters,
            maps: RobotMaps::default(),
            gatherer: HypothesisGatherer::default(),
            guesses: BTreeMap::new(),
        }
    }

    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<RefinedAlignments>,
    ) -> Result<(), StageError> {
        if !self.maps.keep(&map, output, |_| WallsOnDemand::new()) {
            return Ok(());
        }
        let concerned = self.guesses.keys().filter(|origin| origin.pair.concerns(map.robot()));
        let origins: Vec<Origin> = concerned.cloned().collect();
        origins.iter().try_for_each(|origin| self.update(origin, output))
    }

    pub(super) fn receive_alignment(
        &mut self,
        first_guess: Received<'_, Alignment>,
        output: &Output<RefinedAlignments>,
    ) -> Result<(), StageError> {
        if !(first_guess.x.is_finite() && first_guess.y.is_finite() && first_guess.yaw.is_finite()) {
            output.warn("a first guess was left out: a value of it is not finite");
            return Ok(());
        }
        let robot = first_guess.robot();
        match self.gatherer.add(first_guess.into_content()) {
            Ok(None) => Ok(()),
            Ok(Some((origin, first))) => {
                let guesses = self.guesses.entry(origin.clone()).or_default();
                guesses.robot = robot.to_owned();
                guesses.first = first;
                self.update(&origin, output)
            }
            Err(missing) => {
                output.warn(missing.to_string());
                Ok(())
            }
        }
    }

    /// Refines the guesses of an origin, and sends the result if it has changed.
    fn update(&mut self, origin: &Origin, output: &Output<RefinedAlignments>) -> Result<(), StageError> {
        let Some(guesses) = self.guesses.get_mut(origin) else { return Ok(()) };
        let maps = self.maps.pair(&origin.pair);
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
            let maps = (a.number, b.number);
            let reusable =
                before.next().filter(|refined| refined.maps == maps && refined.holds_for(guess, &self.parameters));
            let refined = match reusable {
                Some(refined) => refined,
                None => {
                    output.count("registrations", 1);
                    let [a, b] = [a, b].map(|map| map.walls(self.parameters.normal_radius));
                    let covariance = Matrix3::from_row_slice(&guess.covariance);
                    let start = InitialGuess::new(guess.transform_a_b(), covariance, &self.parameters);
                    let mut refinement = refine(a, b, &start, &self.parameters);
                    if refinement.refusal.is_none() && has_covariance_of_fit(guess) {
                        refinement.refusal = IcpRefusal::of_search(&start, &refinement.registration, &self.parameters);
                    }
                    let refined = Refined { maps, first_guess: guess.clone(), refinement };
                    output.errors.send(&guesses.robot, &refined.errors(output.log_time()))?;
                    refined
                }
            };
            alignments.push(refined.alignment(guess, output.log_time()));
            guesses.refined.push(refined);
        }
        guesses.send(alignments, output)
    }

    /// Refuses guesses that still wait for a map at the end, so that they are reported.
    pub(super) fn finish(&mut self, output: &Output<RefinedAlignments>) -> Result<(), StageError> {
        for (origin, guesses) in &mut self.guesses {
            let Some(missing) = self.maps.missing(&origin.pair) else { continue };
            if guesses.first.iter().all(|guess| !guess.accepted) {
                continue;
            }
            let reason = format!("{missing}, so the alignment cannot be refined");
            let refused = |guess: &Alignment| Alignment { accepted: false, reason: reason.clone(), ..guess.clone() };
            guesses.send(guesses.first.iter().map(refused).collect(), output)?;
        }
        Ok(())
    }
}

impl Guesses {
    /// Sends alignments, unless they equal those sent last. They are sent together, as they are judged together.
    fn send(&mut self, alignments: Vec<Alignment>, output: &Output<RefinedAlignments>) -> Result<(), StageError> {
        let is_same = |(sent, alignment): (&Alignment, &Alignment)| {
            *sent == Alignment { header: sent.header.clone(), ..alignment.clone() }
        };
        if self.sent.len() == alignments.len() && self.sent.iter().zip(&alignments).all(is_same) {
            return Ok(());
        }
        for alignment in &alignments {
            output.alignment.send(&self.robot, alignment)?;
        }
        self.sent = alignments;
        Ok(())
    }
}

impl Refined {
    /// Whether the refinement is valid for another first guess.
    ///
    /// An accepted one is valid for every first guess nearby. A refused one might have failed because of its first
    /// guess, and is valid for that only.
    fn holds_for(&self, first_guess: &Alignment, parameters: &IcpParameters) -> bool {
        let before = &self.first_guess;
        if self.refinement.refusal.is_some() {
            return (before.x, before.y, before.yaw, before.covariance)
                == (first_guess.x, first_guess.y, first_guess.yaw, first_guess.covariance);
        }
        // At the centroid of the common section: at the frame's origin a turn far away looks like a shift.
        let centre_b = self.refinement.registration.transform_a_b.inverse() * self.refinement.registration.centre;
        let shift = before.transform_a_b() * centre_b - first_guess.transform_a_b() * centre_b;
        shift.norm() <= parameters.reuse_within
            && wrap_angle(before.yaw - first_guess.yaw).abs() <= parameters.reuse_within_yaw
    }

    /// The message with the error of each iteration.
    fn errors(&self, log_time: LogTime) -> IcpErrors {
        let guess = &self.first_guess;
        IcpErrors {
            header: Header::new(log_time, guess.header.frame_id.clone()),
            a: guess.a.clone(),
            b: guess.b.clone(),
            source: guess.source.clone(),
            rank: guess.rank,
            accepted: self.refinement.refusal.is_none(),
            errors: self.refinement.registration.errors.clone(),
        }
    }

    /// The message with the refined alignment. The reason of the first guess is part of its reason.
    fn alignment(&self, first_guess: &Alignment, log_time: LogTime) -> Alignment {
        let RefinedAlignment { registration, refusal } = &self.refinement;
        let mut alignment = Alignment {
            header: Header::new(log_time, first_guess.header.frame_id.clone()),
            covariance: row_by_row(&registration.covariance),
            method: format!("{}+icp", first_guess.method),
            accepted: refusal.is_none(),
            reason: match refusal {
                None => format!("{}; {}", first_guess.reason, self.refinement.reason()),
                // The refusal comes first, and after an empty line the reason of the first guess.
                Some(_) => format!("{}\n\n{}", self.refinement.reason(), first_guess.reason),
            },
            ..first_guess.clone()
        };
        alignment.set_transform_a_b(&registration.transform_a_b);
        alignment
    }
}
