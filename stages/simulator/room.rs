//! A room and its doors.

use super::shape::Rectangle;
use crate::shared::geometry::Point2;

/// How thick walls are, metres.
pub(super) const WALL: f64 = 0.15;

/// A gap in a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Door {
    /// The middle of the gap, on the centre line of the wall.
    pub centre: Point2,
    /// Its width, metres.
    pub width: f64,
    /// Whether its wall runs along x.
    pub along_x: bool,
}

impl Door {
    /// The gap, with `depth` metres kept clear on each side of the wall.
    pub fn clearing(&self, depth: f64) -> Rectangle {
        let (along, across) = (self.width + 0.2, WALL + 2.0 * depth);
        let (width, height) = if self.along_x { (along, across) } else { (across, along) };
        Rectangle::round(self.centre, width, height)
    }

    pub(super) fn gap(&self) -> (f64, f64) {
        let middle = if self.along_x { self.centre.x } else { self.centre.y };
        (middle - self.width / 2.0, middle + self.width / 2.0)
    }
}

/// A room.
#[derive(Clone, Debug, PartialEq)]
pub struct Room {
    /// The room between the faces of its walls.
    pub bounds: Rectangle,
    /// Its doors: to the corridor first.
    pub doors: Vec<Door>,
}
