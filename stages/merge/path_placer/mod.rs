//! Transforms each robot's path into the merged frame, by its map's deformation and frame.

mod drive;
mod stage;

pub use drive::Drive;
pub use stage::kind;
