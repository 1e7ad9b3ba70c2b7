//! Positions of radio tags in a robot's map from ranges only (Tsardoulias et al., section 3), and of visual tags from
//! positions or bearings.
//!
//! Every range puts the tag on a ring around the robot. The rings of all readings of one tag are multiplied on a
//! grid; after a while one spot remains or, after a straight drive, two that mirror each other. The share of the
//! probability in a small window is the **certainty**: near 1 for one spot, about one half for two.
//!
//! - [`ReadingGroups`] averages the readings at one position to one ring, as they share the error of the pose.
//! - [`SightingGroups`] does the same with positions at which a camera has seen the tag: rings of radius 0.
//! - [`BearingGroups`] does the same with bearings of a tag: rays.
//! - [`Likelihood`] is the product of all of them.
//! - [`RingProduct`] is the product of the rings, in logarithms: 300 factors underflow.
//! - [`Posterior`] is the product on the grid, computed from coarse to fine without negligible cells.
//! - [`read_out`] finds the window, and the mode around it.
//! - `far_tags` locates tags that are read from beyond `reach`, together with the calibration of the radio: on no grid
//!   of fine cells, as that of a large area would be.
//! - `landmark_slam` estimates the drive with the tags, where poses by odometry drift.
//! - [`PoseTrack`] interpolates the pose of the robot at the time of a reading, with its covariance.

mod bearing_groups;
mod far_tags;
mod landmark_slam;
mod likelihood;
mod localizer;
mod measured;
mod noise;
mod parameters;
mod pose_covariance;
mod pose_track;
mod position_groups;
mod posterior;
mod ray_product;
mod read_out;
mod reading_groups;
mod ring_product;
mod sighting_groups;
mod stage;
#[cfg(test)]
mod stage_tests;
mod tag;

pub use bearing_groups::{Bearing, BearingGroups};
pub use likelihood::Likelihood;
pub use localizer::{ReadingProblem, TagLocalizer, sighting_deviation};
pub use parameters::{Readout, TagLocalizerParameters};
pub use pose_covariance::{CovarianceProblem, heading_variance, largest_variance, position_covariance};
pub use pose_track::{NoPose, PoseTrack, Position};
pub use posterior::{GridSize, Leaf, Posterior};
pub use ray_product::{Ray, RayProduct};
pub use read_out::{TagMode, read_out};
pub use reading_groups::{Reading, ReadingGroups};
pub use ring_product::{Ring, RingProduct};
pub use sighting_groups::{Sighting, SightingGroups};
pub use stage::kind;
