//! The frame solver as a stage.

use super::FrameSolverParameters;
use super::known_maps::KnownMaps;
use super::messages::{hold, is_same, prefixed, robot_frames, verdicts};
use super::reasons;
use super::solution::{Alignments, Solution, by_name};
use super::solve::solve;
use super::tree::Tree;
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::ros::{
    Alignment, Header, OccupancyGrid, RobotFrames, TFMessage, TagEstimates, UnmergedRobot, Verdict, Verdicts,
};
use gridweave_runtime::stage::{
    Context, InitialPoses, Out, Output, OutputPorts, Outputs, Received, StageError, StageKind,
};
use std::collections::{BTreeMap, BTreeSet};

/// Up to so many verdicts, each change is sent. Of more, a message is sent once at least one in [`FEW_CHANGED`] of the
/// alignments has changed: else hundreds of robots would send the verdicts on all pairs hundreds of times.
const FEW_VERDICTS: usize = 1000;
const FEW_CHANGED: usize = 10;

/// The kind `frame_solver`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "frame_solver",
        "Estimates the pose of every robot's map in the reference robot's map, from alignments of pairs. Alignments that \
         contradict others along a cycle are left out; robots that cannot be placed with confidence are not merged, and \
         the reason is given. If the pipeline names no reference, it is the first robot by name, of those with a usable \
         map that are known when the first two are merged, and stays so.",
        |parameters, context| Ok(FrameSolver::new(parameters, context)),
    )
    .optional_input(
        "map",
        "the robots' maps, for the names of robots and of their map frames; without it the robots are those that \
         alignments name",
        FrameSolver::receive_map,
    )
    .optional_input(
        "tags",
        "positions of tags in the robots' frames, for the names of the frames of robots without maps",
        FrameSolver::receive_tags,
    )
    .optional_inputs("lost", "robots that have no map, with the reason", FrameSolver::receive_lost)
    .input("alignment", "alignments of pairs, accepted and refused ones", FrameSolver::receive_alignment)
    .finish(FrameSolver::finish)
    .build()
}

/// Poses of the robots' maps, and the verdicts on the alignments.
struct Placement {
    frames: Out<RobotFrames>,
    tf: Out<TFMessage>,
    verdicts: Out<Verdicts>,
}

impl Outputs for Placement {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            frames: ports.output_on(
                "/robot_frames",
                "frames",
                "the pose of every robot's map, why the others have none, and the poses of those of them that are connected \
                 with each other; sent when something changes. Robots are moved only if that improves the fit by more than \
                 `min_improvement`, and at the end",
            ),
            tf: ports.output_on(
                "/tf_static",
                "tf",
                "the same poses as static transforms from `world`, once it is certain which robot is the reference; before \
                 that only from `world` to `world_origin`, so that viewers know the frame; at the end also those of robots connected with each other only, from a frame of their own, `world/ROBOT`, with \
                 the name of the robot in whose map frame they are placed. No frame ever changes its parent",
            ),
            verdicts: ports.output_on(
                "/verdicts",
                "verdicts",
                "the last alignment of every pair, whether it is used, and whether others confirm it; sent after the \
                 frames, and at the end, if it has changed; with more than 1000 pairs, if a tenth of the alignments has, and at \
                 the end",
            ),
        }
    }
}

struct FrameSolver {
    parameters: FrameSolverParameters,
    /// The reference that the pipeline names.
    wanted: Option<String>,
    initial_poses: InitialPoses,
    /// All known robots, and the names of their map frames in the merged tree of frames.
    robots: BTreeSet<String>,
    maps: KnownMaps,
    frame_ids: BTreeMap<String, String>,
    alignments: Alignments,
    reference: Option<String>,
    /// Whether the reference stays, as robots have been placed in its frame.
    reference_is_fixed: bool,
    solution: Solution,
    sent: Option<RobotFrames>,
    tree: Tree,
    sent_verdicts: Vec<Verdict>,
    /// How many alignments have changed since verdicts were sent.
    changed_alignments: usize,
}

impl FrameSolver {
    fn new(parameters: FrameSolverParameters, context: &Context) -> Self {
        Self {
            parameters,
            wanted: context.reference.clone(),
            initial_poses: context.initial_poses.clone(),
            robots: BTreeSet::new(),
            // Where the tags give the frames of robots, robots need no maps.
            maps: KnownMaps::new(context.is_wired("map") && !context.is_wired("tags")),
            frame_ids: BTreeMap::new(),
            alignments: BTreeMap::new(),
            reference: None,
            reference_is_fixed: false,
            solution: Solution::default(),
            sent: None,
            tree: Tree::default(),
            sent_verdicts: Vec::new(),
            changed_alignments: 0,
        }
    }

    /// A map changes the solution if its robot, the name of its frame, or that it can be used is new.
    fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<Placement>,
    ) -> Result<(), StageError> {
        let robot = map.robot();
        if robot.is_empty() {
            output.warn("a map that belongs to no robot was left out");
            return Ok(());
        }
        let frame_id = prefixed(robot, &map.header.frame_id);
        let is_new = self.robots.insert(robot.to_owned());
        let is_renamed = self.frame_ids.get(robot) != Some(&frame_id);
        self.frame_ids.insert(robot.to_owned(), frame_id);
        let has_changed = self.maps.receive(robot, map.check());
        if is_new || is_renamed || has_changed { self.solve_and_send(output) } else { Ok(()) }
    }

    /// A robot without a map is in the frame of its tags, which is that of its poses.
    fn receive_tags(&mut self, tags: Received<'_, TagEstimates>, output: &Output<Placement>) -> Result<(), StageError> {
        let TagEstimates { robot, header, .. } = tags.into_content();
        if self.maps.has_sent(&robot) || header.frame_id.is_empty() {
            return Ok(());
        }
        let frame_id = prefixed(&robot, &header.frame_id);
        let before = self.frame_ids.insert(robot.clone(), frame_id.clone());
        let is_placed = before.as_ref() != Some(&frame_id) && self.robots.contains(&robot);
        if is_placed { self.solve_and_send(output) } else { Ok(()) }
    }

    /// A robot without a map is known, and is not merged.
    fn receive_lost(
        &mut self,
        lost: Received<'_, UnmergedRobot>,
        output: &Output<Placement>,
    ) -> Result<(), StageError> {
        let UnmergedRobot { robot, reason } = lost.into_content();
        if self.maps.set_without_map(robot, reason) { self.solve_and_send(output) } else { Ok(()) }
    }

    /// An alignment changes the solution if it differs from the last one of its pair.
    fn receive_alignment(
        &mut self,
        alignment: Received<'_, Alignment>,
        output: &Output<Placement>,
    ) -> Result<(), StageError> {
        let Some((pair, mut alignment)) = by_name(alignment.into_content()) else {
            output.warn("an alignment that is not of two robots was left out");
            return Ok(());
        };
        alignment.header = Header::default();
        let are_known = pair.robots().iter().all(|robot| self.robots.contains(*robot));
        self.robots.extend(pair.robots().map(str::to_owned));
        let is_refused = !alignment.accepted;
        let before = self.alignments.insert(pair.clone(), alignment);
        if before.as_ref() == self.alignments.get(&pair) {
            return Ok(());
        }
        self.changed_alignments += 1;
        match are_known && is_refused && before.is_none_or(|before| !before.accepted) {
            true => self.explain_and_send(&pair, output),
            false => self.solve_and_send(output),
        }
    }

    /// An alignment that is refused, and was not accepted before, moves no robot: only the reasons of its own change.
    fn explain_and_send(&mut self, pair: &RobotPair, output: &Output<Placement>) -> Result<(), StageError> {
        if self.reference.is_none() {
            return self.solve_and_send(output);
        }
        let reasons = reasons::of_pair(pair, &self.robots, &self.solution, &self.alignments);
        self.solution.unmerged.extend(self.maps.explain(reasons, &self.alignments));
        self.send_all(output)
    }

    fn finish(&mut self, output: &Output<Placement>) -> Result<(), StageError> {
        if let Some(wanted) = &self.wanted
            && !self.robots.contains(wanted)
        {
            let cause = match self.robots.is_empty() {
                true => "neither it nor any other robot sent a map".to_owned(),
                false => format!("it sent no map; the robots seen are {}", list_in_words(&self.robots)),
            };
            return Err(StageError::new(format!("place the maps in the frame of the reference `{wanted}`"), cause)
                .with_help("set `reference` in [pipeline] to one of the robots, or check the topics in [robots]"));
        }
        for robot in self.initial_poses.keys().filter(|robot| !self.robots.contains(*robot)) {
            output.warn(format!(
                "the initial pose of `{robot}` is not used, as there is no such robot; the robots seen are {}",
                list_in_words(&self.robots)
            ));
        }
        if self.maps.input_ended() {
            let reasons = std::mem::take(&mut self.solution.unmerged);
            self.solution.unmerged = self.maps.explain(reasons, &self.alignments);
        }
        self.send(output, true)?;
        self.send_verdicts(output)
    }

    fn solve_and_send(&mut self, output: &Output<Placement>) -> Result<(), StageError> {
        // Once robots are placed in its frame, the reference stays, even if a robot with an earlier name appears.
        self.reference_is_fixed |= self.solution.frames.len() > 1;
        let robots = self.maps.mergeable(&self.robots, &self.alignments);
        self.reference = match &self.wanted {
            Some(wanted) => robots.get(wanted).cloned(),
            None if self.reference_is_fixed => self.reference.take(),
            None => {
                let mut with_maps = robots.iter().filter(|robot| !self.maps.is_unusable(robot));
                with_maps.next().or_else(|| robots.first()).cloned()
            }
        };
        if let Some(reference) = &self.reference {
            self.solution = solve(&robots, &self.alignments, reference, &self.parameters, &self.solution);
            // A robot that had a map before it lost its way keeps its place.
            self.solution.unmerged.extend(self.maps.without_map().filter(|(robot, _)| !robots.contains(robot)));
            let reasons = std::mem::take(&mut self.solution.unmerged);
            self.solution.unmerged = self.maps.explain(reasons, &self.alignments);
        }
        self.send_all(output)
    }

    fn send_all(&mut self, output: &Output<Placement>) -> Result<(), StageError> {
        let is_due = |changed, all| all <= FEW_VERDICTS || FEW_CHANGED * changed >= all;
        match self.send(output, false)? && is_due(self.changed_alignments, self.alignments.len()) {
            true => self.send_verdicts(output),
            false => Ok(()),
        }
    }

    /// Sends the frames and transforms if they differ from those sent last: the `last` ones as they are solved,
    /// others with the robots that were sent left in place as long as the parameters allow. Without a reference there
    /// is nothing to send. Returns whether something was sent.
    fn send(&mut self, output: &Output<Placement>, last: bool) -> Result<bool, StageError> {
        let Some(reference) = self.reference.clone() else { return Ok(false) };
        let header = Header::new(output.log_time(), RobotFrames::WORLD);
        let solved = robot_frames(&self.solution, header, reference, &self.frame_ids);
        let message = match &self.sent {
            Some(sent) if !last => self.held(sent, solved),
            _ => solved,
        };
        if self.sent.as_ref().is_some_and(|sent| match last {
            true => RobotFrames { header: sent.header.clone(), ..message.clone() } == *sent,
            false => is_same(sent, &message),
        }) {
            if last {
                self.send_transforms(&message, last, output)?;
            }
            return Ok(false);
        }
        output.frames.send("", &message)?;
        self.send_transforms(&message, last, output)?;
        self.sent = Some(message);
        Ok(true)
    }

    /// As long as the reference may change, no transform to the world is certain, and only the world itself is sent:
    /// viewers show nothing in a frame that no transform names.
    fn send_transforms(
        &mut self,
        frames: &RobotFrames,
        last: bool,
        output: &Output<Placement>,
    ) -> Result<(), StageError> {
        let is_certain = self.wanted.is_some() || self.reference_is_fixed || frames.frames.len() > 1;
        let transforms = match last || is_certain {
            true => self.tree.update(frames, last),
            false => self.tree.open(&frames.header),
        };
        match transforms {
            Some(transforms) => output.tf.send("", &transforms),
            None => Ok(()),
        }
    }

    /// Sends the verdicts if they differ from those sent last.
    fn send_verdicts(&mut self, output: &Output<Placement>) -> Result<(), StageError> {
        if self.reference.is_none() || !output.verdicts.is_read() {
            return Ok(());
        }
        let mut verdicts = verdicts(&self.solution, &self.alignments);
        self.maps.explain_pairs(&mut verdicts);
        if verdicts != self.sent_verdicts {
            let header = Header::new(output.log_time(), RobotFrames::WORLD);
            let message = Verdicts { header, verdicts };
            output.verdicts.send("", &message)?;
            self.sent_verdicts = message.verdicts;
            self.changed_alignments = 0;
        }
        Ok(())
    }

    /// The solution, with the robots that were `sent` in the same frame left in their places, unless the alignments
    /// fit the solution better by more than `min_improvement`.
    fn held(&self, sent: &RobotFrames, solved: RobotFrames) -> RobotFrames {
        let mut held = solved.clone();
        if held.reference == sent.reference {
            hold(&mut held.frames, &sent.frames);
        }
        for group in &mut held.groups {
            if let Some(sent) = sent.groups.iter().find(|sent| sent.reference == group.reference) {
                hold(&mut group.frames, &sent.frames);
            }
        }
        let cost = |message: &RobotFrames| {
            let grouped = message.groups.iter().flat_map(|group| &group.frames);
            let frames = message.frames.iter().chain(grouped);
            let poses = frames.map(|frame| (frame.robot.as_str(), frame.transform_reference_robot())).collect();
            self.solution.squared_deviations(&poses)
        };
        let improvement = cost(&held) - cost(&solved);
        if improvement <= self.parameters.min_improvement { held } else { solved }
    }
}
