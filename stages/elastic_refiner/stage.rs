//! The stage: keeps each robot's map and the frames, and bends the maps of the placed robots when any of it has changed.

use super::{Bend, Body, ElasticRefinerParameters, refine, sharpness};
use crate::geometry::row_by_row;
use crate::robot_maps::RobotMaps;
use crate::walls::{NORMAL_RADIUS, WallsOnDemand};
use gridweave_runtime::ros::{DeformationNode, Header, MapDeformation, OccupancyGrid, RobotFrames, Sharpness};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use std::collections::BTreeMap;

/// What the stage sends.
pub(super) struct Bends {
    deformation: Out<MapDeformation>,
    frames: Out<RobotFrames>,
}

impl Outputs for Bends {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            deformation: ports.output("deformation", "How the map of each placed robot is bent."),
            frames: ports.side_output(
                "frames",
                "The frames as they came, sent after the bends that belong to them: for stages that need both.",
            ),
        }
    }
}

/// Bends the maps of placed robots.
pub(super) struct ElasticRefiner {
    parameters: ElasticRefinerParameters,
    maps: RobotMaps<WallsOnDemand>,
    frames: RobotFrames,
    /// The frames in which the maps were bent last, and the numbers of these maps.
    bent: (RobotFrames, BTreeMap<String, u64>),
    /// Whether any bend was sent.
    has_sent: bool,
}

impl ElasticRefiner {
    pub(super) fn new(parameters: ElasticRefinerParameters) -> Self {
        Self {
            parameters,
            maps: RobotMaps::default(),
            frames: RobotFrames::default(),
            bent: Default::default(),
            has_sent: false,
        }
    }

    /// Maps wait for frames, or for the end: a map that has grown is bent as the last one was until then.
    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<Bends>,
    ) -> Result<(), StageError> {
        self.maps.keep(&map, output, |_| WallsOnDemand::new());
        Ok(())
    }

    pub(super) fn receive_frames(
        &mut self,
        frames: Received<'_, RobotFrames>,
        output: &Output<Bends>,
    ) -> Result<(), StageError> {
        self.frames = frames.into_content();
        // What changes little waits for the end: bends are told in the map's own frame, and hold in a frame that lies beside.
        if self.is_near() { output.frames.send("", &self.frames) } else { self.bend(output) }
    }

    pub(super) fn finish(&mut self, output: &Output<Bends>) -> Result<(), StageError> {
        let is_bent = (&self.frames.frames, &self.numbers()) == (&self.bent.0.frames, &self.bent.1);
        if is_bent { Ok(()) } else { self.bend(output) }
    }

    /// Whether the robots are about where they were when their maps were bent.
    fn is_near(&self) -> bool {
        let (before, after) = (&self.bent.0, &self.frames);
        let ElasticRefinerParameters { min_move, min_turn, .. } = self.parameters;
        let mut pairs = before.frames.iter().zip(&after.frames);
        let robots = self.numbers();
        before.reference == after.reference
            && before.frames.len() == after.frames.len()
            && robots.keys().eq(self.bent.1.keys())
            && pairs.all(|(one, next)| one.is_near(next, min_move, min_turn))
    }

    /// The maps of the placed robots, by their numbers.
    fn numbers(&self) -> BTreeMap<String, u64> {
        let placed = self.frames.frames.iter().map(|frame| &frame.robot);
        placed.filter_map(|robot| Some((robot.clone(), self.maps.get(robot)?.number))).collect()
    }

    fn bend(&mut self, output: &Output<Bends>) -> Result<(), StageError> {
        self.bent = (self.frames.clone(), self.numbers());
        let frames = self.frames.frames.iter();
        let placed: Vec<_> = frames.filter_map(|frame| Some((frame, self.maps.get(&frame.robot)?))).collect();
        // What is alone is not bent, which is news if it was.
        let has_news = placed.len() > 1 || self.has_sent;
        if self.parameters.enabled && has_news {
            self.has_sent = true;
            let bodies: Vec<Body<'_>> = placed
                .iter()
                .map(|(frame, map)| {
                    let (grid, walls) = (map.grid(), map.walls(NORMAL_RADIUS));
                    let body = Body::new(&grid, walls, frame.transform_reference_robot(), self.parameters.spacing);
                    let is_kept = self.parameters.keep_reference && frame.robot == self.frames.reference;
                    if is_kept { body.kept() } else { body }
                })
                .collect();
            match refine(&bodies, &self.parameters) {
                Some(bends) => {
                    let sharpness = sharpness(&bodies, &bends, &self.parameters);
                    for (((frame, map), bend), sharpness) in placed.iter().zip(&bends).zip(sharpness) {
                        let header = Header::new(output.log_time(), map.frame_id.clone());
                        output.deformation.send(&frame.robot, &message(header, &frame.robot, bend, sharpness))?;
                    }
                }
                None => output.warn("the maps cannot be bent onto each other: a frame lies too far away for numbers"),
            }
        }
        output.frames.send("", &self.frames)
    }
}

fn message(header: Header, robot: &str, bend: &Bend, [sharpness_rigid, sharpness]: [Sharpness; 2]) -> MapDeformation {
    let nodes = bend.deformation.moves.iter().zip(&bend.covariances).enumerate();
    let node = |(number, (by, covariance)): (usize, (&nalgebra::Vector3<f64>, _))| {
        let at = bend.deformation.lattice.position(number);
        DeformationNode { x: at.x, y: at.y, dx: by.x, dy: by.y, dyaw: by.z, covariance: row_by_row(covariance) }
    };
    MapDeformation {
        header,
        robot: robot.to_owned(),
        spacing: bend.deformation.lattice.spacing(),
        nodes: nodes.map(node).collect(),
        wall_matched: bend.wall_matched,
        sharpness_rigid,
        sharpness,
        bend: bend.drift.map_or(0.0, |drift| drift.bend),
        turn: bend.drift.map_or(0.0, |drift| drift.turn),
    }
}
