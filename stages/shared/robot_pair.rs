//! A pair of robots whose maps are aligned.

use gridweave_runtime::ros::Alignment;

/// The names of two robots.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RobotPair {
    /// The robot whose map is fixed.
    pub a: String,
    /// The robot whose map is moved.
    pub b: String,
}

impl RobotPair {
    /// Robot `b` relative to robot `a`.
    pub fn new(a: impl Into<String>, b: impl Into<String>) -> Self {
        Self { a: a.into(), b: b.into() }
    }

    /// Two robots, the first of them by name as robot a.
    pub fn by_name(one: impl Into<String>, other: impl Into<String>) -> Self {
        let (one, other) = (one.into(), other.into());
        if one < other { Self { a: one, b: other } } else { Self { a: other, b: one } }
    }

    /// The pair of an alignment.
    pub fn of(alignment: &Alignment) -> Self {
        Self::new(&alignment.a, &alignment.b)
    }

    /// Whether a robot is one of the pair.
    pub fn concerns(&self, robot: &str) -> bool {
        self.a == robot || self.b == robot
    }

    /// Both names.
    pub fn robots(&self) -> [&str; 2] {
        [&self.a, &self.b]
    }
}
