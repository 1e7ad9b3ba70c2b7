//! Draws the maps of robots from the scans of their lidars: for robots that are localised, or have odometry, and whose
//! maps nobody logs or sends.
//!
//! A cell's occupancy is kept in log-odds (Moravec and Elfes 1985; Thrun, Burgard and Fox, "Probabilistic Robotics", table 9.1):
//! a beam makes free what it passes, and occupied where it ends. What a scan sees is laid where the robot was:
//!
//! - **with poses in the map** (of a localizer or a SLAM), every beam from where the lidar was when it was sent, between the
//!   poses before and after it: a robot that turns at 1 radian a second turns by 6 degrees during a scan of 0.1 seconds;
//! - **with odometry alone**, scans are matched with the map so far first, one for each step of the drive: odometry says about
//!   where, and [ICP](crate::registration::icp_refiner) from several rotations says exactly where. Nothing closes loops: the map drifts, and is
//!   bent as a whole, slowly. A SLAM does better, and where there is one its map is the one to log.
//!
//! - [`ScanBeams`]: the beams of a scan from the base of the robot, within the lidar's limits.
//! - [`DrawnMap`]: the map that grows.
//! - [`match_scan`]: where a scan fits the map so far.

mod beams;
mod drawn_map;
mod matching;
mod parameters;
mod robot;
mod stage;
#[cfg(test)]
mod tests;

pub use beams::{BaseBeam, ScanBeams};
pub use drawn_map::{DrawnMap, TooLarge};
pub use matching::{Motion, match_scan};
pub use parameters::ScanMapperParameters;
pub use stage::kind;
