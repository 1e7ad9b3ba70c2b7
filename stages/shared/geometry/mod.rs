//! Poses and grids: the geometry that all algorithms share.
//!
//! A rigid transform is written `T_a_b` in text and `transform_a_b` in code: it takes a point in frame b to frame a.

mod cell_box;
mod grid;
mod moving_lookup;
mod point_index;
mod pose;
pub mod relative_pose;
mod rigid_fit;

pub use cell_box::CellBox;
pub use grid::{Cell, Grid, GridGeometry, most_cells_over};
pub use gridweave_runtime::ros::cell::{UNKNOWN, is_free, is_known, is_occupied};
pub use moving_lookup::MovingLookup;
pub use point_index::{Buckets, Neighbour, PointIndex};
pub use pose::{Point2, Pose2, pose, quarter_turn, row_by_row, turn_difference, wrap_angle};
pub use rigid_fit::{PointPair, RigidFit, covariance_about, fit_rigid, point_jacobian};
