//! Stages: their definition, their context, and their inputs and outputs.
//!
//! A stage is a struct, its outputs, and a method for each of its inputs. A complete example:
//!
//! ```
//! use gridweave_runtime::ros::{OccupancyGrid, PoseStamped};
//! use gridweave_runtime::stage::{Out, Output, OutputPorts, Outputs, Received, StageError, StageKind};
//!
//! /// Sends the pose of each map's corner.
//! struct MapCorner;
//!
//! struct Corners(Out<PoseStamped>);
//!
//! impl Outputs for Corners {
//!     fn declare(ports: &mut OutputPorts) -> Self {
//!         Self(ports.output("corner", "the pose of the outer corner of cell (0, 0)"))
//!     }
//! }
//!
//! impl MapCorner {
//!     fn receive(&mut self, map: Received<'_, OccupancyGrid<'_>>, output: &Output<Corners>) -> Result<(), StageError> {
//!         output.0.send(map.robot(), &PoseStamped { header: map.header.clone(), pose: map.info.origin })
//!     }
//! }
//!
//! fn kind() -> StageKind {
//!     let make = |(): (), _: &_| Ok(MapCorner);
//!     StageKind::stage("map_corner", "Sends the pose of each map's corner", make)
//!         .input("map", "the robots' maps", MapCorner::receive)
//!         .build()
//! }
//! # use gridweave_runtime::{message::LogTime, ros::{MapMetaData, Pose}, stage::StageHarness};
//! # let mut stage = StageHarness::new(&kind(), "").unwrap();
//! # let mut info = MapMetaData::default();
//! # info.origin.position.x = 4.5;
//! # stage.give::<OccupancyGrid<'_>>("map", "robot1", LogTime(7), &OccupancyGrid { info, ..Default::default() }).unwrap();
//! # let sent: Vec<PoseStamped> = stage.take("corner").unwrap();
//! # assert_eq!(sent[0].pose.position.x, 4.5);
//! ```
//!
//! A stage has no state outside of its struct and uses nothing else: no clock, no global, and no randomness except what
//! is seeded from [`Context::seed`]. A message that it sends carries the log time of the message that caused it.
//! Therefore the same inputs give the same outputs on every engine.

pub mod bridge_counts;
mod builder;
mod context;
mod error;
mod initial_poses;
mod json_schema;
mod kind;
mod node;
mod output;
mod parameters;
mod ports;
pub(crate) mod range;
mod received;
mod registry;
mod run_links;
mod stage_harness;
mod statistics;
mod tag_fields;

pub use builder::StageBuilder;
pub use context::{Context, InputWire, RobotTopics, TfFrames, frame_of_robot, match_robot};
pub use error::StageError;
pub use initial_poses::{InitialPose, InitialPoses};
pub(crate) use kind::RESERVED_KEYS;
pub use kind::{ResolvedStage, Source, StageKind};
pub use node::Node;
pub use output::{AnyMessage, Out, Output, OutputEnd, OutputPorts, OutputSink, Outputs};
pub use parameters::{ParameterError, Parameters};
pub use ports::{InputPort, OutputPort, PortType};
pub use received::Received;
pub use registry::Registry;
pub use run_links::{LinkView, RunLink, RunLinks};
pub use stage_harness::StageHarness;
pub use statistics::{RunStatistics, StageStatistics};
pub use tag_fields::{PathLoss, TagFields};
