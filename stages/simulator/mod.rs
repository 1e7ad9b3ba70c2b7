//! Simulated worlds: buildings, robots that drive and map them, and the truth for the evaluation of a merge.
//!
//! [`simulate`] creates all of it from [`SimulatorParameters`] and a seed, in the order of the files here: a
//! [`FloorPlan`] with rooms, doors and furniture; a route and a drive for every robot; lidar scans of the true world;
//! poses with the drift of a SLAM system, and by the odometry of wheels; a growing occupancy grid per robot, in its own
//! map frame; and range readings of radio tags on the walls. The same parameters and seed give the same simulation, bit
//! by bit, on any number of threads: every random quantity has its own stream of random numbers.
//!
//! The source `simulator` sends the simulation as the messages of a log: `/robotN/map`, `/robotN/pose`,
//! `/robotN/tag_ranges` and `/tf`, `/robotN/scan` and `/robotN/odom` where they are asked for; and the truth on `/truth`.
//!
//! [`draw_map`] creates a single map of a building with an exactly known direction, without a drive.
//!
//! Nothing moves in these worlds but the robots, which do not see each other; floors are flat, and there is no glass.

mod clearances;
mod drawn_map;
mod drift;
mod drive;
mod floor_plan;
mod furniture;
mod lidar;
mod mapper;
mod parameters;
mod planner;
mod ray_caster;
mod robot;
mod room;
mod route;
mod scanned_map;
mod shape;
mod simulation;
mod stage;
mod tags;
mod wheel_odometry;
mod world;

pub use drawn_map::{DrawnMapSettings, WallStyle, draw_map};
pub use drive::TICK_SECONDS;
pub use floor_plan::{FloorPlan, Layout};
pub use parameters::SimulatorParameters;
pub use robot::RobotLog;
pub use room::{Door, Room};
pub use scanned_map::ScanSettings;
pub use shape::{Rectangle, Solid};
pub use simulation::{Simulation, simulate};
pub use stage::kind;
pub use tags::{SimulatedReading, Tag};
pub use world::SimulationError;

pub use crate::shared::scan_grid::SnapshotMap;
