//! Where each robot drove, in the merged frame: its poses carried through its map's bend and frame.

mod drive;
mod stage;

pub use drive::Drive;
pub use stage::kind;
