//! The grid fuser as a stage.

use super::agreement::Agreement;
use super::evidence::EvidenceTable;
use super::layout::{Lattice, lay_out};
use super::{Fused, GridFuserParameters, KnownArea, PlacedGrid, Warp, forward, inverse};
use crate::geometry::{GridGeometry, Point2, read_map};
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{GridPrefix, Header, MapMetaData, OccupancyGrid, RobotFrame, RobotFrames};
use gridweave_runtime::stage::{Context, InputPort, Output, OutputPort, PortType, Stage, StageError, StageKind};
use serde_json::{Value, json};
use std::collections::BTreeMap;

const MAP: usize = 0;
const FUSED: usize = 0;
const CONFLICTS: usize = 1;

/// The kind `grid_fuser`.
pub fn kind() -> StageKind {
    StageKind::stage(
        "grid_fuser",
        "Fuses the maps of all placed robots in log-odds: unknown says nothing, evidence adds. The map is sent when the \
         frames change by more than `min_move` or `min_turn`, when a robot that is placed has another map, and at the \
         end if anything has changed since. Where maps contradict each other is sent beside it, and the area of that is in \
         the stage's report.",
        vec![
            InputPort::one("map", PortType::of::<OccupancyGrid<'_>>(), "the robots' maps, or their coverage fields"),
            InputPort::one("frames", PortType::of::<RobotFrames>(), "where the maps lie"),
        ],
        vec![
            OutputPort::new("map", PortType::of::<OccupancyGrid<'_>>(), "the fused map, in the frame `world`")
                .on_topic("/map"),
            OutputPort::new(
                "conflicts",
                PortType::of::<OccupancyGrid<'_>>(),
                "sent with the fused map, on the same cells: how far the maps contradict each other. -1 where fewer than two \
                 maps know the cell, 0 where all say the same; otherwise the log-odds for occupied and those for free, as \
                 shares of the most that one map can say for each, the smaller of them, in percent",
            )
            .on_topic("/map_conflicts"),
        ],
        |parameters: GridFuserParameters, _: &Context| Ok(GridFuser::new(parameters)),
    )
}

struct GridFuser {
    table: EvidenceTable,
    parameters: GridFuserParameters,
    maps: BTreeMap<String, StoredMap>,
    frames: RobotFrames,
    /// The frames that the fused map sent last was made with.
    fused: Option<RobotFrames>,
    /// How far the maps agree in the fused map sent last, and the area of a cell in it, square metres.
    agreement: Option<(Agreement, f64)>,
}

/// A robot's latest map, where it came in: its bytes are not copied.
struct StoredMap {
    message: Message,
    area: KnownArea,
}

impl Stage for GridFuser {
    fn receive(&mut self, port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let is_due = match port {
            MAP => self.receive_map(message, output),
            _ => self.receive_frames(message, output),
        };
        if is_due { self.fuse(output) } else { Ok(()) }
    }

    fn finish(&mut self, output: &mut Output<'_>) -> Result<(), StageError> {
        let is_sent = self.fused.as_ref().is_some_and(|fused| {
            (&fused.reference, self.placed(fused)) == (&self.frames.reference, self.placed(&self.frames))
        });
        if is_sent { Ok(()) } else { self.fuse(output) }
    }

    fn report(&self) -> Option<Value> {
        let (agreement, cell_area) = self.agreement?;
        let area = |cells: u64| cells as f64 * cell_area;
        Some(json!({
            "known_to_one_m2": area(agreement.known_to_one),
            "known_to_several_m2": area(agreement.known_to_several),
            "in_conflict_m2": area(agreement.in_conflict),
            "conflict_share": agreement.conflict_share(),
        }))
    }
}

impl GridFuser {
    fn new(parameters: GridFuserParameters) -> Self {
        let table = EvidenceTable::new(parameters.min_probability, parameters.max_probability);
        Self { table, parameters, maps: BTreeMap::new(), frames: RobotFrames::default(), fused: None, agreement: None }
    }

    /// Keeps a robot's map. Whether it belongs in the fused one: a map of a robot that is not placed waits for its
    /// frame, which mostly follows at the same log time.
    fn receive_map(&mut self, message: &Message, output: &mut Output<'_>) -> bool {
        let robot = message.robot();
        match read_map(message) {
            Ok((_, grid)) => {
                let area = KnownArea::of(&grid);
                self.maps.insert(robot.to_owned(), StoredMap { message: message.clone(), area });
                self.frames.frames.iter().any(|frame| frame.robot == robot)
            }
            Err(error) => {
                output.warn(format!("a map of {robot} was left out: {error}"));
                false
            }
        }
    }

    /// Keeps the frames. Whether they differ from those of the fused map by more than the parameters allow.
    fn receive_frames(&mut self, message: &Message, output: &mut Output<'_>) -> bool {
        match message.decode() {
            Ok(frames) => self.frames = frames,
            Err(error) => {
                output.warn(format!("robot frames were left out: {error}"));
                return false;
            }
        }
        let GridFuserParameters { min_move, min_turn, .. } = self.parameters;
        let is_near = |(one, next): (&RobotFrame, &RobotFrame)| one.is_near(next, min_move, min_turn);
        let Some(fused) = &self.fused else { return true };
        let (before, after) = (self.placed(fused), self.placed(&self.frames));
        fused.reference != self.frames.reference
            || before.len() != after.len()
            || !before.into_iter().zip(after).all(is_near)
    }

    /// The frames of robots that have sent a map, the reference first and then by name.
    fn placed<'a>(&self, frames: &'a RobotFrames) -> Vec<&'a RobotFrame> {
        let mut placed: Vec<&RobotFrame> =
            frames.frames.iter().filter(|frame| self.maps.contains_key(&frame.robot)).collect();
        placed.sort_by_key(|frame| (frame.robot != frames.reference, frame.robot.as_str()));
        placed
    }

    fn fuse(&mut self, output: &mut Output<'_>) -> Result<(), StageError> {
        self.fused = Some(self.frames.clone());
        self.agreement = None;
        if !output.is_read(FUSED) && !output.is_read(CONFLICTS) {
            return Ok(());
        }
        let placed = self.placed(&self.frames);
        let mut maps = Vec::with_capacity(placed.len());
        for frame in &placed {
            let Some(map) = self.maps.get(&frame.robot) else { continue };
            let (_, grid) = read_map(&map.message)
                .map_err(|error| StageError::new(format!("read the map of {}", frame.robot), error))?;
            maps.push((PlacedGrid { grid, transform_world_map: frame.transform_reference_robot() }, &map.area));
        }

        let finest = maps.iter().map(|(map, _)| map.grid.geometry.resolution).min_by(f64::total_cmp);
        let Some(resolution) = self.parameters.resolution.or(finest) else { return Ok(()) };
        let lattice = Lattice {
            anchor: anchor(&maps),
            resolution,
            max_extent: self.parameters.max_extent,
            max_cells: self.parameters.max_cells,
        };
        let layout = lay_out(&maps, &lattice);
        for (frame, _) in placed.iter().zip(&layout.takes_part).filter(|(_, takes_part)| !**takes_part) {
            output.warn(format!(
                "the map of {} is not in the fused one: where it lies is no finite number, or the fused map would be \
                 larger than `max_extent` or `max_cells` allow",
                frame.robot
            ));
        }
        let mut takes_part = layout.takes_part.iter();
        maps.retain(|_| takes_part.next().is_some_and(|takes_part| *takes_part));
        let Some(geometry) = layout.geometry else { return Ok(()) };
        let prefix = prefix(&geometry, Header::new(output.log_time(), RobotFrames::WORLD));
        let mut conflicts = vec![0; geometry.cell_count()];
        let mut fuse = |cells: &mut [i8]| {
            let fused = Fused { cells, conflicts: &mut conflicts };
            match self.parameters.warp {
                Warp::Inverse => inverse::fuse(&maps, &geometry, &self.table, fused),
                Warp::Forward => forward::fuse(&maps, &geometry, &self.table, fused),
            }
            Agreement::of(cells, &conflicts)
        };
        let mut agreement = Agreement::default();
        match output.is_read(FUSED) {
            true => output.send_grid(FUSED, "", &prefix, |blank| {
                let mut filled = blank.fill_with(0);
                agreement = fuse(filled.cells_mut());
                Ok(filled)
            })?,
            false => agreement = fuse(&mut vec![0; geometry.cell_count()]),
        }
        if output.is_read(CONFLICTS) {
            output.send_grid(CONFLICTS, "", &prefix, |blank| blank.copy_cells(&conflicts))?;
        }
        self.agreement = Some((agreement, geometry.resolution.powi(2)));
        Ok(())
    }
}

/// The corner of the first map that holds anything: the reference robot's, if it does.
fn anchor(maps: &[(PlacedGrid<'_>, &KnownArea)]) -> Point2 {
    let corners = maps.iter().filter(|(_, area)| !area.is_empty()).map(|(map, _)| map.transform_world_grid());
    let mut finite = corners.filter(|corner| corner.translation.vector.iter().all(|value| value.is_finite()));
    finite.next().map_or(Point2::origin(), |corner| Point2::from(corner.translation.vector))
}

/// All of the fused map but its cells. The layout keeps the size within what the message can say.
fn prefix(geometry: &GridGeometry, header: Header) -> GridPrefix {
    let info = MapMetaData {
        map_load_time: header.stamp,
        resolution: geometry.resolution as f32,
        width: geometry.width as u32,
        height: geometry.height as u32,
        origin: geometry.origin.into(),
    };
    GridPrefix { header, info }
}
