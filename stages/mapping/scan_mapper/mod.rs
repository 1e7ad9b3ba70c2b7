//! Builds the maps of robots from the scans of their lidars: for robots that are localised, or have odometry, and
//! whose maps are neither logged nor sent.
//!
//! A cell's occupancy is kept in log-odds (Moravec and Elfes 1985; Thrun, Burgard and Fox, "Probabilistic Robotics",
//! table 9.1): cells that a beam passes become free, and the cell at its end occupied. Scans are added at the pose of
//! the robot:
//!
//! - **with poses in the map** (of a localizer or a SLAM), every beam from the pose of the lidar at its time,
//!   interpolated between the poses before and after it: a robot that turns at 1 radian per second turns by 6 degrees
//!   during a scan of 0.1 seconds;
//! - **with odometry only**, at the poses of a [SLAM](crate::mapping::slam): scans are registered on those around them,
//!   loops are closed, and the map is drawn anew after each closure, so that each wall is there once;
//! - **with scans only**, likewise, with odometry from the scans themselves.
//!
//! At the end the robots whose maps are accepted as merged are refined [together](crate::mapping::slam::joint_poses), each
//! in its own frame, so that what one robot saw straightens the map of another.
//!
//! A robot whose scans hardly ever lie on each other has lost its way: no map of it is sent. Where nothing shows how a robot
//! with odometry has moved, or after a gap of its scans nothing well enough, a new session begins, whose map is merged with that
//! of the first one at the end. Where that is not possible, and without odometry, its map ends there.
//!
//! - [`ScanBeams`]: the beams of a scan from the base of the robot, within the lidar's limits.
//! - [`ScanMap`]: the growing map.

mod along_odometry;
mod beams;
mod continuous_odometry;
mod joint_refinement;
mod parameters;
mod reasons;
mod robot;
mod scan_map;
mod scan_odometry;
mod scan_usage;
mod sessions;
mod slam_map;
mod stage;
#[cfg(test)]
mod tag_tests;
#[cfg(test)]
mod test_drive;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod trouble_tests;

pub use beams::{BaseBeam, ScanBeams, ScanError};
pub use parameters::{MappingMode, ScanMapperParameters};
pub use scan_map::{ScanMap, TooLarge};
pub use stage::kind;
