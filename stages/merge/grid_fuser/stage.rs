//! The grid fuser as a stage.

use super::agreement::CellCounts;
use super::evidence::EvidenceTable;
use super::layout::{CellLattice, layout_of};
use super::{Fused, GridFuserParameters, KnownArea, PlacedGrid, Warp, forward, inverse};
use crate::shared::geometry::Point2;
use crate::shared::placement::Placement;
use crate::shared::robot_maps::RobotMaps;
use gridweave_runtime::ros::{Header, MapAgreement, MapDeformation, OccupancyGrid, RobotFrame, RobotFrames};
use gridweave_runtime::stage::{Context, Out, Output, OutputPorts, Outputs, Received, StageError, StageKind};

/// The kind `grid_fuser`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "grid_fuser",
        "Fuses the maps of all placed robots in log-odds: unknown says nothing, evidence adds. The map is sent when the \
         frames change by more than `min_move` or `min_turn` or deformations change, when a robot that is placed has another map, and at the \
         end if anything has changed since. Where maps contradict each other, and the area of that, is sent beside it.",
        |parameters, _: &Context| Ok(GridFuser::new(parameters)),
    )
    .input("map", "the robots' maps, or their coverage fields", GridFuser::receive_map)
    .optional_input("deformation", "the deformations of the maps", GridFuser::receive_deformation)
    .input("frames", "the poses of the maps", GridFuser::receive_frames)
    .finish(GridFuser::finish)
    .build()
}

/// The fused map, its conflicts, and their areas.
struct FusedMap {
    map: Out<OccupancyGrid<'static>>,
    conflicts: Out<OccupancyGrid<'static>>,
    agreement: Out<MapAgreement>,
}

impl Outputs for FusedMap {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            map: ports.output_on("/map", "map", "the fused map, in the frame `world`"),
            conflicts: ports.output_on(
                "/map_conflicts",
                "conflicts",
                "sent with the fused map, on the same cells: how far the maps contradict each other. -1 where fewer than two \
                 maps know the cell, 0 where all say the same; otherwise the log-odds for occupied and those for free, as \
                 shares of the most that one map can say for each, the smaller of them, in percent",
            ),
            agreement: ports.output_on(
                "/map_agreement",
                "agreement",
                "sent with the fused map: the areas that one map knows, that several know, and on which these contradict \
                 each other",
            ),
        }
    }
}

struct GridFuser {
    table: EvidenceTable,
    parameters: GridFuserParameters,
    maps: RobotMaps<KnownArea>,
    placement: Placement,
    /// Whether a deformation has arrived that is in no fused map.
    has_new_deformations: bool,
    /// Frames of the fused map sent last.
    fused: Option<RobotFrames>,
}

impl GridFuser {
    fn new(parameters: GridFuserParameters) -> Self {
        let table = EvidenceTable::new(parameters.min_probability, parameters.max_probability);
        Self {
            table,
            parameters,
            maps: RobotMaps::default(),
            placement: Placement::default(),
            has_new_deformations: false,
            fused: None,
        }
    }

    /// A map of a robot without a pose waits for its frame, which usually follows at the same log time.
    fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<FusedMap>,
    ) -> Result<(), StageError> {
        if !self.maps.keep(&map, output, KnownArea::of) {
            return Ok(());
        }
        let is_placed = self.placement.frames.frames.iter().any(|frame| frame.robot == map.robot());
        if is_placed { self.fuse(output) } else { Ok(()) }
    }

    /// A deformation waits for the frames that belong to it, which follow at the same log time, or for the end.
    /// Deformations of several maps belong together: all change at once.
    fn receive_deformation(
        &mut self,
        deformation: Received<'_, MapDeformation>,
        output: &Output<FusedMap>,
    ) -> Result<(), StageError> {
        self.has_new_deformations |= self.placement.keep_deformation(&deformation, output);
        Ok(())
    }

    /// Frames that differ from those of the fused map by no more than the parameters allow wait for the end.
    fn receive_frames(
        &mut self,
        frames: Received<'_, RobotFrames>,
        output: &Output<FusedMap>,
    ) -> Result<(), StageError> {
        self.placement.frames = frames.into_content();
        let is_near = self.fused.as_ref().is_some_and(|fused| self.is_near(fused));
        if is_near && !self.has_new_deformations { Ok(()) } else { self.fuse(output) }
    }

    fn finish(&mut self, output: &Output<FusedMap>) -> Result<(), StageError> {
        let is_sent = self.fused.as_ref().is_some_and(|fused| {
            (&fused.reference, self.placed(fused))
                == (&self.placement.frames.reference, self.placed(&self.placement.frames))
        });
        if is_sent && !self.has_new_deformations { Ok(()) } else { self.fuse(output) }
    }

    /// Whether the robots are within the parameters' tolerances of the frames that were fused.
    fn is_near(&self, fused: &RobotFrames) -> bool {
        let GridFuserParameters { min_move, min_turn, .. } = self.parameters;
        let is_near = |(one, next): (&RobotFrame, &RobotFrame)| one.is_near(next, min_move, min_turn);
        let (before, after) = (self.placed(fused), self.placed(&self.placement.frames));
        fused.reference == self.placement.frames.reference
            && before.len() == after.len()
            && before.into_iter().zip(after).all(is_near)
    }

    /// Frames of robots that have sent a map, the reference first and then by name.
    fn placed<'a>(&self, frames: &'a RobotFrames) -> Vec<&'a RobotFrame> {
        let mut placed: Vec<&RobotFrame> =
            frames.frames.iter().filter(|frame| self.maps.get(&frame.robot).is_some()).collect();
        placed.sort_by_key(|frame| (frame.robot != frames.reference, frame.robot.as_str()));
        placed
    }

    fn fuse(&mut self, output: &Output<FusedMap>) -> Result<(), StageError> {
        self.fused = Some(self.placement.frames.clone());
        self.has_new_deformations = false;
        if !output.map.is_read() && !output.conflicts.is_read() && !output.agreement.is_read() {
            return Ok(());
        }
        let placed = self.placed(&self.placement.frames);
        let mut maps = Vec::with_capacity(placed.len());
        for frame in &placed {
            let Some(map) = self.maps.get(&frame.robot) else { continue };
            let deformation = self.placement.deformation(&frame.robot);
            let placed = PlacedGrid { deformation, ..PlacedGrid::rigid(map.grid(), frame.transform_reference_robot()) };
            maps.push((placed, &map.own));
        }

        let finest = maps.iter().map(|(map, _)| map.grid.geometry.resolution).min_by(f64::total_cmp);
        let Some(resolution) = self.parameters.resolution.or(finest) else { return Ok(()) };
        let lattice = CellLattice {
            anchor: anchor(&maps),
            resolution,
            max_extent: self.parameters.max_extent,
            max_cells: self.parameters.max_cells,
        };
        let layout = layout_of(&maps, &lattice);
        for (frame, takes_part) in placed.iter().zip(&layout.takes_part) {
            if let Err(reason) = takes_part {
                output.warn(format!("the map of {} is not in the fused one: {reason}", frame.robot));
            }
        }
        let mut takes_part = layout.takes_part.iter();
        maps.retain(|_| takes_part.next().is_some_and(Result::is_ok));
        let Some(geometry) = layout.geometry else { return Ok(()) };
        let header = Header::new(output.log_time(), RobotFrames::WORLD);
        let prefix = geometry.prefix(header.clone());
        let mut conflicts = vec![0; geometry.cell_count()];
        let mut agreement = None;
        let mut fuse = |cells: &mut [i8]| {
            let fused = Fused { cells, conflicts: &mut conflicts };
            match self.parameters.warp {
                Warp::Inverse => inverse::fuse(&maps, &geometry, &self.table, fused),
                Warp::Forward => forward::fuse(&maps, &geometry, &self.table, fused),
            }
            agreement = output.agreement.is_read().then(|| CellCounts::of(cells, &conflicts));
        };
        match output.map.is_read() {
            true => output.map.send_grid("", &prefix, |blank| {
                let mut filled = blank.fill_with(0);
                fuse(filled.cells_mut());
                Ok(filled)
            })?,
            false => fuse(&mut vec![0; geometry.cell_count()]),
        }
        if output.conflicts.is_read() {
            output.conflicts.send_grid("", &prefix, |blank| blank.copy_cells(&conflicts))?;
        }
        match agreement {
            Some(agreement) => output.agreement.send("", &agreement.message(header, geometry.resolution.powi(2))),
            None => Ok(()),
        }
    }
}

/// Corner of the first map that has known cells: the reference robot's, if it has any.
fn anchor(maps: &[(PlacedGrid<'_>, &KnownArea)]) -> Point2 {
    let corners = maps.iter().filter(|(_, area)| !area.is_empty()).map(|(map, _)| map.transform_world_grid());
    let mut finite = corners.filter(|corner| corner.translation.vector.iter().all(|value| value.is_finite()));
    finite.next().map_or(Point2::origin(), |corner| Point2::from(corner.translation.vector))
}
