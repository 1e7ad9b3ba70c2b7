//! The stage: keeps each robot's last map, and fuses those of placed robots.

use super::{EntropyFuserParameters, common_grid, fuse};
use crate::log_odds::LogOdds;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{Header, OccupancyGrid, RobotFrames};
use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError};
use gridweave_stages::shared::geometry::Grid;
use gridweave_stages::shared::robot_maps::RobotMaps;

/// Outputs of the stage.
pub(super) struct FusedMap {
    map: Out<OccupancyGrid<'static>>,
}

impl Outputs for FusedMap {
    fn declare(ports: &mut OutputPorts) -> Self {
        let summary = "The fused map, in the frame of its inputs. It is sent when the frames have come that follow maps of the same time, \
                       or something later, or the end.";
        Self { map: ports.output_on("/map", "map", summary) }
    }
}

/// Fuses the maps of robots.
pub(super) struct EntropyFuser {
    table: LogOdds,
    max_cells: u64,
    maps: RobotMaps<()>,
    frames: RobotFrames,
    /// Time of a map or frames that are in no fused map.
    changed: Option<LogTime>,
}

impl EntropyFuser {
    pub(super) fn new(parameters: EntropyFuserParameters) -> Self {
        Self {
            table: LogOdds::new(parameters.min_probability, parameters.max_probability),
            max_cells: parameters.max_cells,
            maps: RobotMaps::default(),
            frames: RobotFrames::default(),
            changed: None,
        }
    }

    /// Maps of one time belong together: new frames move them all, and follow at the same time.
    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<FusedMap>,
    ) -> Result<(), StageError> {
        if self.changed.is_some_and(|changed| changed < output.log_time()) {
            self.fuse(output)?;
        }
        if self.maps.keep(&map, output, |_| ()) {
            self.changed = Some(output.log_time());
        }
        Ok(())
    }

    pub(super) fn receive_frames(
        &mut self,
        frames: Received<'_, RobotFrames>,
        output: &Output<FusedMap>,
    ) -> Result<(), StageError> {
        let before = self.placed();
        self.frames = frames.into_content();
        if self.changed.is_some() || before != self.placed() { self.fuse(output) } else { Ok(()) }
    }

    pub(super) fn finish(&mut self, output: &Output<FusedMap>) -> Result<(), StageError> {
        if self.changed.is_some() { self.fuse(output) } else { Ok(()) }
    }

    /// The placed robots that have sent a map, the reference first and then by name.
    fn placed(&self) -> Vec<String> {
        let frames = self.frames.frames.iter().filter(|frame| self.maps.get(&frame.robot).is_some());
        let mut placed: Vec<String> = frames.map(|frame| frame.robot.clone()).collect();
        placed.sort_by_key(|robot| (*robot != self.frames.reference, robot.clone()));
        placed
    }

    fn fuse(&mut self, output: &Output<FusedMap>) -> Result<(), StageError> {
        self.changed = None;
        let placed = self.placed();
        let maps: Vec<_> = placed.iter().filter_map(|robot| self.maps.get(robot)).collect();
        let grids: Vec<Grid<'_>> = maps.iter().map(|map| map.grid()).collect();
        let (over, takes_part) = common_grid(&grids, self.max_cells);
        for (robot, takes_part) in placed.iter().zip(&takes_part) {
            if let Err(reason) = takes_part {
                output.warn(format!("the map of {robot} is not in the fused one: {reason}"));
            }
        }
        let (Some(geometry), Some(first)) = (over, maps.first()) else { return Ok(()) };
        let grids: Vec<Grid<'_>> = grids
            .into_iter()
            .zip(&takes_part)
            .filter(|(_, takes_part)| takes_part.is_ok())
            .map(|(grid, _)| grid)
            .collect();
        let header = Header::new(output.log_time(), first.frame_id.clone());
        let prefix = geometry.prefix(header);
        output.map.send_grid("", &prefix, |blank| {
            let mut filled = blank.fill_with(0);
            fuse(&grids, &geometry, &self.table, filled.cells_mut());
            Ok(filled)
        })
    }
}
