//! What the page is told: the data of its script.

use serde::Serialize;

/// What is known at several moments: each version counts from a moment on until the next does.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Versions<T>(Vec<Version<T>>);

impl<T> Default for Versions<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

#[derive(Debug, PartialEq, Serialize)]
struct Version<T> {
    /// The moment, as its place among the moments of the page.
    from: usize,
    what: T,
}

impl<T: PartialEq> Versions<T> {
    /// Adds what is known from a moment on, if that is anything new.
    pub(super) fn add(&mut self, from: usize, what: T) {
        if self.0.last().is_none_or(|last| last.what != what) {
            self.0.push(Version { from, what });
        }
    }

    /// What is known at the end.
    pub(super) fn last(&self) -> Option<&T> {
        self.0.last().map(|version| &version.what)
    }
}

/// All that the page shows.
#[derive(Debug, Default, Serialize)]
pub(super) struct Report {
    /// The names of the logs.
    pub(super) logs: Vec<String>,
    /// The moments: seconds from the first message on.
    pub(super) times: Vec<f64>,
    pub(super) robots: Vec<Robot>,
    pub(super) merged: Versions<Option<Grid>>,
    pub(super) conflicts: Versions<Option<Grid>>,
    pub(super) hypotheses: Vec<Hypothesis>,
    pub(super) registrations: Vec<Registration>,
    /// Of the last moment.
    pub(super) frames: Vec<Frame>,
    pub(super) unmerged: Vec<(String, String)>,
    pub(super) pairs: Vec<Pair>,
    pub(super) agreement: Option<[f64; 3]>,
    /// What the log says of how it was made: name and text.
    pub(super) metadata: Vec<(String, String)>,
    /// What was wrong with the log.
    pub(super) problems: Vec<String>,
}

/// A map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Grid {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Metres a cell.
    pub(super) resolution: f64,
    /// Of the outer corner of the first cell.
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) yaw: f64,
    /// The cells as a grey PNG in base 64: 0 to 100, or 255 for unknown; the last row first.
    pub(super) png: String,
}

/// A robot; what was found lies where the page shows its map, in metres and radians.
#[derive(Debug, Default, Serialize)]
pub(super) struct Robot {
    pub(super) name: String,
    /// As in `#0072b2`.
    pub(super) colour: String,
    /// Its last map in its own frame.
    pub(super) own: Option<Grid>,
    /// The pose of its map frame at the end: x, y and yaw.
    pub(super) pose: [f64; 3],
    pub(super) map: Versions<Option<Grid>>,
    pub(super) findings: Versions<Findings>,
}

/// What was found in a robot's map.
#[derive(Debug, Default, PartialEq, Serialize)]
pub(super) struct Findings {
    /// Walls: both ends, reliability, inliers.
    pub(super) segments: Vec<[f64; 6]>,
    /// Where the map frame lies, the direction of the walls, its deviation, the agreement.
    pub(super) direction: Option<[f64; 5]>,
    pub(super) tags: Vec<Tag>,
    /// The drive.
    pub(super) path: Vec<[f64; 2]>,
    /// Where nodes stand, and by how much each is displaced and turned.
    pub(super) bends: Vec<[f64; 5]>,
    /// Places: where, and what they are.
    pub(super) places: Vec<(f64, f64, String)>,
    pub(super) ways: Vec<Vec<[f64; 2]>>,
}

#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Tag {
    pub(super) id: String,
    pub(super) x: f64,
    pub(super) y: f64,
    /// Half axes of the ellipse of two standard deviations, metres, and the direction of the first.
    pub(super) ellipse: [f64; 3],
    pub(super) certainty: f64,
    pub(super) readings: u32,
}

/// A place that was proposed for a pair: `T_a_b`.
#[derive(Debug, Serialize)]
pub(super) struct Hypothesis {
    /// The topic that it was sent on.
    pub(super) topic: String,
    pub(super) a: String,
    pub(super) b: String,
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) yaw: f64,
    pub(super) yaw_degrees: String,
    pub(super) rank: u32,
    pub(super) score: String,
    pub(super) accepted: bool,
    pub(super) method: String,
    pub(super) reason: String,
}

/// How the error of ICP fell from a first guess.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Registration {
    pub(super) a: String,
    pub(super) b: String,
    pub(super) source: String,
    pub(super) rank: u32,
    pub(super) accepted: bool,
    pub(super) iterations: usize,
    /// Metres, of the first iteration and of the last.
    pub(super) first: String,
    pub(super) last: String,
    /// A curve over the iterations, as a path of SVG in a box of 160 by 40 pixels.
    pub(super) curve: String,
}

/// Where a robot's map lies, as text for a table.
#[derive(Debug, Serialize)]
pub(super) struct Frame {
    pub(super) robot: String,
    /// The robot in whose map frame it is.
    pub(super) reference: String,
    pub(super) x: String,
    pub(super) y: String,
    pub(super) yaw: String,
    /// Standard deviations: metres, metres, degrees.
    pub(super) deviations: [String; 3],
    /// Three rows of three.
    pub(super) covariance: Vec<Vec<String>>,
}

/// What became of a pair.
#[derive(Debug, Serialize)]
pub(super) struct Pair {
    pub(super) a: String,
    pub(super) b: String,
    pub(super) accepted: bool,
    pub(super) checked: bool,
    pub(super) score: String,
    pub(super) method: String,
    pub(super) reason: String,
}
