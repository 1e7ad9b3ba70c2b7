//! Landmark SLAM: the tags of a robot and its drive, estimated together.
//!
//! Poses by odometry drift. Tags that are read again and again show by how much: their readings, the steps of the
//! odometry and the calibration of the radio are the factors of one graph, whose unknowns are the poses, the positions
//! of the tags and the calibration (Kantor and Singh 2002 for ranges only; Thrun and Montemerlo, "The GraphSLAM
//! algorithm", 2006). How far odometry drifts is not a parameter: of several assumptions that with the greatest
//! evidence is taken (Laplace's approximation), and one of them is that it does not drift at all.
//!
//! - [`Keyframes`] is the odometry by keyframes, with the readings at each; [`step`] is how its error grows between
//!   two.
//! - [`LandmarkGraph`] is an estimate of all unknowns; [`residuals`] has the factors of the readings.
//! - [`estimate`] builds an estimate along the drive, where [`search`] finds new tags, and chooses the drift.
//! - [`LocatedTags`] is the outcome, with the frame in which it is and how certain that is.

mod estimate;
mod graph;
mod keyframes;
mod located_tags;
mod residuals;
mod search;
mod step;
#[cfg(test)]
mod tests;

pub(super) use estimate::locate;
pub(super) use keyframes::Keyframes;
pub(super) use located_tags::LocatedTags;
