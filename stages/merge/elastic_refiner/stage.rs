//! The stage: keeps each robot's map and the frames, and deforms the maps of the placed robots when any of them has
//! changed.

use super::ElasticRefinerParameters;
use crate::registration::non_rigid::{Body, RefinedMap, Shape, anchor, refine, sharpness};
use crate::shared::deformation::{Deformation, Lattice};
use crate::shared::geometry::row_by_row;
use crate::shared::robot_maps::{RobotMap, RobotMaps};
use crate::shared::walls::{NORMAL_RADIUS, WallsOnDemand};
use gridweave_runtime::ros::{
    DeformationNode, Header, MapDeformation, OccupancyGrid, RobotFrame, RobotFrames, Sharpness,
};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Outputs of the stage.
pub(super) struct Deformations {
    deformation: Out<MapDeformation>,
    frames: Out<RobotFrames>,
}

impl Outputs for Deformations {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            deformation: ports.output("deformation", "The deformation of the map of each placed robot."),
            frames: ports.side_output(
                "frames",
                "The frames as received, sent after the deformations that belong to them: for stages that need both.",
            ),
        }
    }
}

/// Deforms the maps of placed robots.
pub(super) struct ElasticRefiner {
    parameters: ElasticRefinerParameters,
    maps: RobotMaps<WallsOnDemand>,
    frames: RobotFrames,
    /// Frames at the latest refinement.
    deformed_frames: RobotFrames,
    /// Maps of the latest refinement, by robot.
    deformed_maps: BTreeMap<String, DeformedMap>,
    /// Shapes of these maps, with their numbers.
    shapes: BTreeMap<String, (u64, Arc<Shape>)>,
    /// Nodes of the maps that were aligned with the others since all were last estimated together.
    aligned_alone: usize,
    /// Whether the latest refinement started from that before it.
    started_from_known: bool,
    /// Whether any deformation was sent.
    has_sent: bool,
}

/// A map when its deformation was estimated.
#[derive(Clone, Debug)]
struct DeformedMap {
    /// Number of the map among those of its robot.
    number: u64,
    /// Its frame.
    frame: RobotFrame,
    /// Number of nodes of its lattice.
    nodes: usize,
    /// Its deformation; none if it was not estimated.
    deformation: Option<Deformation>,
}

impl ElasticRefiner {
    pub(super) fn new(parameters: ElasticRefinerParameters) -> Self {
        Self {
            parameters,
            maps: RobotMaps::default(),
            frames: RobotFrames::default(),
            deformed_frames: RobotFrames::default(),
            deformed_maps: BTreeMap::new(),
            shapes: BTreeMap::new(),
            aligned_alone: 0,
            started_from_known: false,
            has_sent: false,
        }
    }

    /// Maps wait for frames, or for the end: until then the latest deformation holds for a map that has grown a
    /// little.
    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<Deformations>,
    ) -> Result<(), StageError> {
        self.maps.keep(&map, output, |_| WallsOnDemand::new());
        Ok(())
    }

    pub(super) fn receive_frames(
        &mut self,
        frames: Received<'_, RobotFrames>,
        output: &Output<Deformations>,
    ) -> Result<(), StageError> {
        self.frames = frames.into_content();
        // Small changes wait for the end: deformations are in the map's own frame, and hold for a frame nearby.
        if self.is_near() { output.frames.send("", &self.frames) } else { self.deform(true, output) }
    }

    /// The last deformations depend on the last maps and frames only, and not on those before.
    pub(super) fn finish(&mut self, output: &Output<Deformations>) -> Result<(), StageError> {
        let numbers = self.deformed_maps.iter().map(|(robot, map)| (robot, map.number));
        let is_deformed = self.frames.frames == self.deformed_frames.frames
            && self.placed().map(|(robot, map)| (robot, map.number)).eq(numbers);
        if is_deformed && !self.started_from_known { Ok(()) } else { self.deform(false, output) }
    }

    /// Whether the robots are near the frames at which they were deformed, and their maps have grown little.
    fn is_near(&self) -> bool {
        let (before, after) = (&self.deformed_frames, &self.frames);
        let has_moved = |frame: &RobotFrame| {
            self.deformed_maps.get(&frame.robot).is_some_and(|before| !self.is_near_to(&before.frame, frame))
        };
        before.reference == after.reference
            && before.frames.len() == after.frames.len()
            && self.placed().map(|(robot, _)| robot).eq(self.deformed_maps.keys())
            && !after.frames.iter().any(has_moved)
            && self.placed().zip(self.deformed_maps.values()).all(|((_, map), before)| !self.has_grown(before, map))
    }

    fn is_near_to(&self, before: &RobotFrame, frame: &RobotFrame) -> bool {
        before.is_near(frame, self.parameters.min_move, self.parameters.min_turn)
    }

    /// Whether a map has grown so much since its latest refinement that it is to be refined again.
    fn has_grown(&self, before: &DeformedMap, map: &RobotMap<WallsOnDemand>) -> bool {
        let most = before.nodes as f64 * (1.0 + self.parameters.min_growth);
        self.nodes(&before.frame.robot, map) as f64 > most
    }

    /// Number of nodes of the lattice of a robot's map.
    fn nodes(&self, robot: &str, map: &RobotMap<WallsOnDemand>) -> usize {
        let before = self.deformed_maps.get(robot).filter(|before| before.number == map.number);
        before.map_or_else(|| Lattice::over(&map.grid(), self.parameters.spacing).len(), |before| before.nodes)
    }

    /// The maps of the placed robots, by name.
    fn placed(&self) -> impl Iterator<Item = (&String, &RobotMap<WallsOnDemand>)> {
        let placed: BTreeMap<&String, &RobotMap<WallsOnDemand>> =
            self.frames.frames.iter().filter_map(|frame| Some((&frame.robot, self.maps.get(&frame.robot)?))).collect();
        placed.into_iter()
    }

    /// The deformation of a map as it was estimated before, if the map is the same and its frame nearly so.
    fn known(&self, frame: &RobotFrame, map: &RobotMap<WallsOnDemand>) -> Option<Deformation> {
        let before = self.deformed_maps.get(&frame.robot).filter(|before| before.number == map.number)?;
        let is_near = self.deformed_frames.reference == self.frames.reference && self.is_near_to(&before.frame, frame);
        before.deformation.clone().filter(|_| is_near)
    }

    /// Estimates the deformations of all placed maps; if `from_known`, those of new maps first, if they are few, and
    /// alone, if they are very few.
    fn deform(&mut self, from_known: bool, output: &Output<Deformations>) -> Result<(), StageError> {
        let frames = self.frames.frames.iter();
        let placed: Vec<_> = frames.filter_map(|frame| Some((frame, self.maps.get(&frame.robot)?))).collect();
        let deformation = self.parameters.deformation();
        let spacing = deformation.spacing;
        let known: Vec<Option<Deformation>> =
            placed.iter().map(|(frame, map)| self.known(frame, map).filter(|_| from_known)).collect();
        let (mut deformed_maps, mut all, mut alone) = (BTreeMap::new(), 0, self.aligned_alone);
        for ((frame, map), known) in placed.iter().zip(&known) {
            let nodes = self.nodes(&frame.robot, map);
            all += nodes;
            alone += if known.is_none() { nodes } else { 0 };
            let deformed = DeformedMap { number: map.number, frame: (*frame).clone(), nodes, deformation: None };
            deformed_maps.insert(frame.robot.clone(), deformed);
        }
        let are_held = from_known && alone as f64 <= self.parameters.min_growth * all as f64;
        let mut started_from_known = false;
        // A single map is not deformed; that is sent if it was deformed before.
        let has_news = placed.len() > 1 || self.has_sent;
        if self.parameters.enabled && has_news {
            self.has_sent = true;
            let shape = |(frame, map): &(&RobotFrame, &RobotMap<WallsOnDemand>)| {
                let known = self.shapes.get(&frame.robot).filter(|(number, _)| *number == map.number);
                let shape = || (map.number, Arc::new(Shape::new(&map.grid(), map.walls(NORMAL_RADIUS), spacing)));
                (frame.robot.clone(), known.cloned().unwrap_or_else(shape))
            };
            self.shapes = placed.iter().map(shape).collect();
            let kept = self.parameters.keep_reference.then_some(&*self.frames.reference);
            let bodies = bodies(&placed, known, &self.shapes, are_held, kept);
            match refine(&bodies, &deformation) {
                Some(refinement) => {
                    started_from_known = refinement.started_from_known;
                    let mut refined = refinement.if_supported();
                    let reference = placed.iter().position(|(frame, _)| frame.robot == self.frames.reference);
                    // Maps that are held fix what is common to all.
                    let reference = reference.filter(|_| !refined.iter().any(|map| map.is_held));
                    reference.into_iter().for_each(|reference| anchor(&mut refined, &bodies, reference));
                    let sharpness = sharpness(&bodies, &refined, &deformation);
                    for (((frame, map), refined), sharpness) in placed.iter().zip(&refined).zip(sharpness) {
                        let Some(deformed) = deformed_maps.get_mut(&frame.robot) else { continue };
                        if let Some(before) = self.deformed_maps.get(&frame.robot).filter(|_| refined.is_held) {
                            *deformed = before.clone();
                            continue;
                        }
                        deformed.deformation = Some(refined.deformation.clone());
                        let header = Header::new(output.log_time(), map.frame_id.clone());
                        output.deformation.send(&frame.robot, &message(header, &frame.robot, refined, sharpness))?;
                    }
                }
                None => output.warn(
                    "the maps were not deformed: a frame is too far from the origin for the equations to be solved",
                ),
            }
        }
        self.started_from_known = started_from_known;
        self.aligned_alone = if are_held { alone } else { 0 };
        self.deformed_frames = self.frames.clone();
        self.deformed_maps = deformed_maps;
        output.frames.send("", &self.frames)
    }
}

/// The bodies of the placed maps, deformed as it is known of them. Known deformations stay if they `are_held`; the map of
/// the robot `kept` is not deformed.
fn bodies<'a>(
    placed: &[(&RobotFrame, &'a RobotMap<WallsOnDemand>)],
    known: Vec<Option<Deformation>>,
    shapes: &BTreeMap<String, (u64, Arc<Shape>)>,
    are_held: bool,
    kept: Option<&str>,
) -> Vec<Body<'a>> {
    let body = |((frame, map), known): (&(&RobotFrame, &'a RobotMap<WallsOnDemand>), Option<Deformation>)| {
        let shape = Arc::clone(&shapes[&frame.robot].1);
        let body = Body::of(shape, map.walls(NORMAL_RADIUS), frame.transform_reference_robot());
        match known {
            _ if kept == Some(&*frame.robot) => body.kept(),
            Some(known) if are_held => body.held(known),
            Some(known) => body.deformed(known),
            None => body,
        }
    };
    placed.iter().zip(known).map(body).collect()
}

fn message(
    header: Header,
    robot: &str,
    refined: &RefinedMap,
    [sharpness_rigid, sharpness]: [Sharpness; 2],
) -> MapDeformation {
    let nodes = refined.deformation.moves.iter().zip(&refined.covariances).enumerate();
    let node = |(number, (by, covariance)): (usize, (&nalgebra::Vector3<f64>, _))| {
        let at = refined.deformation.lattice.position(number);
        DeformationNode { x: at.x, y: at.y, dx: by.x, dy: by.y, dyaw: by.z, covariance: row_by_row(covariance) }
    };
    MapDeformation {
        header,
        robot: robot.to_owned(),
        spacing: refined.deformation.lattice.spacing(),
        nodes: nodes.map(node).collect(),
        wall_matched: refined.wall_matched,
        sharpness_rigid,
        sharpness,
        bend: refined.drift.map_or(0.0, |drift| drift.displacement),
        turn: refined.drift.map_or(0.0, |drift| drift.turn),
    }
}
