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
//! - **with odometry only**, scans are first registered on the map so far, one for each step of the drive, by
//!   [ICP](crate::registration::icp_refiner) from several rotations about the pose by odometry. There is no loop
//!   closure: the map drifts, and is deformed as a whole. A SLAM does better, and where there is one its map is the one
//!   to log.
//!
//! - [`ScanBeams`]: the beams of a scan from the base of the robot, within the lidar's limits.
//! - [`ScanMap`]: the growing map.
//! - [`match_scan`]: registration of a scan on the map so far.

mod beams;
mod matching;
mod parameters;
mod robot;
mod scan_map;
mod stage;
#[cfg(test)]
mod tests;

pub use beams::{BaseBeam, ScanBeams};
pub use matching::{Motion, match_scan};
pub use parameters::ScanMapperParameters;
pub use scan_map::{ScanMap, TooLarge};
pub use stage::kind;
