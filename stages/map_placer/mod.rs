//! Draws each placed robot's map where it lies in the merged one: through its bend and its frame, alone.
//!
//! What the [grid fuser](crate::grid_fuser) adds up, robot by robot, for those who want to see who saw what: pictures, and
//! layers in a viewer. Nothing of it is in any other result.

mod stage;

pub use stage::kind;
