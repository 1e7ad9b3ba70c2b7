//! Code that several modules share: poses, grids and their walls, deformations, the last map of each robot, and
//! buildings for tests.

pub mod deformation;
pub mod geometry;
pub mod log_odds;
pub mod number_text;
pub mod placement;
pub mod robot_clock;
pub mod robot_maps;
pub mod robot_pair;
pub mod scan_grid;
pub(crate) mod sparse;
pub mod test_world;
pub mod walls;
