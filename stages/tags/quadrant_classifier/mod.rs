//! The direction of a map's walls, and from it and common tags a first guess of the relative pose of two maps.
//!
//! After Tsardoulias et al., sections 4.1.2 to 4.2. Walls are at right angles, so the directions of two maps
//! determine their rotation up to quarter turns, and more precisely than tags do; the tags determine the quarter turn
//! and the translation. Where a map has no direction, or it contradicts the tags, the rotation is that of the tags.
//! Tags that do not suffice alone, such as two, are refused there.
//!
//! Not for buildings without right angles: there every rotation is that of the tags.

mod circular_mean;
mod direction;
mod first_guess;
mod grouping;
mod parameters;
mod provisional;
mod quadrant;
mod rotation_by_directions;
mod single_tag;
mod stage;
#[cfg(test)]
mod stage_tests;
mod tag_rotation;
mod translation;
mod walls;

pub use direction::{Direction, map_direction};
pub use first_guess::{FirstGuess, GuessError, first_guess};
pub use grouping::{WallGroup, classify};
pub use parameters::{Mean, QuadrantClassifierParameters, RotationFrom, TagRotationFrom, TranslationFrom, Weighting};
pub use provisional::provisional_guess;
pub use quadrant::quadrant;
pub use rotation_by_directions::MissingDirection;
pub use single_tag::single_tag_guesses;
pub use stage::kind;
