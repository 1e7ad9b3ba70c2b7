//! SLAM of robots from the scans of their lidars and their odometry.
//!
//! Each scan is registered on the [`LocalMap`] of those around it: a correlative search over the uncertainty of
//! odometry finds the basin (Olson 2009), and point-to-line registration the pose (Censi 2008). Scans are gathered in
//! submaps of some metres. A finished submap is searched in each earlier one that may be at the same place, by branch
//! and bound on a likelihood field; what fits, and fits nowhere else, becomes a loop closure. After a long way, when a
//! pose is less certain than places that look alike are apart, the last metres are searched in all that may be there at
//! once, and a place at which beams pass through walls is another one. Scans are the nodes of a pose graph: each is measured
//! against the one before it, and its yaw against the middle of the local map, too. The most likely poses are solved for
//! after each closure, with a robust weight for closures, and their covariances show where closures may be. At the end each scan is registered
//! on what was seen at its place at other times, by any of the robots whose relative poses are known ([`joint_poses`]),
//! or on a [recorded map](recorded_map). Tags that are seen are landmarks of the graph.
//!
//! The division into a local registration and submaps that are searched for loop closures by branch and bound is that
//! of Cartographer (Hess et al. 2016, "Real-time loop closure in 2D LIDAR SLAM"); a local map of the last scans, and a
//! graph with one node for each, that of Karto and slam_toolbox (Konolige et al. 2010; Macenski and Jambrecic 2021).
//! The noise of odometry is estimated on the way ([`OdometryNoise`]), and is not a parameter to be tuned for each
//! robot.

mod contradictions;
mod correlative_search;
mod joint_trajectories;
mod likelihood_field;
mod local_map;
mod located_scan;
mod loop_closure;
mod odometry_noise;
mod point_to_line;
mod pose_graph;
mod recorded_map;
mod relocalization;
mod revisits;
mod scan_points;
mod scan_registration;
mod seen_tags;
#[cfg(test)]
mod tests;
mod trajectory;

pub use contradictions::{Contradictions, MAX_CONTRADICTING};
pub use joint_trajectories::{FramedTrajectory, joint_contradictions, joint_poses};
pub use local_map::LocalMap;
pub use located_scan::LocatedScan;
pub use odometry_noise::{MOST_SCALE_ERROR, OdometryCorrection, OdometryNoise};
pub use pose_graph::{Constraint, PoseGraph};
pub use recorded_map::recorded_map;
pub use scan_points::{ScanPoint, scan_points};
pub use trajectory::{Trajectory, YAW_OF_MAP_SHARE};
