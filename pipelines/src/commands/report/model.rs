//! Data of the page for its script.

use serde::Serialize;

/// Versions of a value over time: each is valid from its moment to that of the next.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Versions<T>(Vec<Version<T>>);

impl<T> Default for Versions<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

#[derive(Debug, PartialEq, Serialize)]
struct Version<T> {
    /// Index of the moment among those of the page.
    from: usize,
    what: T,
}

impl<T: PartialEq> Versions<T> {
    /// Adds the value from a moment on, if it has changed.
    pub(super) fn add(&mut self, from: usize, what: T) {
        if self.0.last().is_none_or(|last| last.what != what) {
            self.0.push(Version { from, what });
        }
    }

    /// The value at the end.
    pub(super) fn last(&self) -> Option<&T> {
        self.0.last().map(|version| &version.what)
    }
}

/// All data of the page.
#[derive(Debug, Default, Serialize)]
pub(super) struct PageData {
    /// The names of the logs.
    pub(super) logs: Vec<String>,
    /// The moments: seconds from the first message.
    pub(super) times: Vec<f64>,
    pub(super) robots: Vec<Robot>,
    pub(super) merged: Versions<Option<MapImage>>,
    pub(super) conflicts: Versions<Option<MapImage>>,
    pub(super) hypotheses: Vec<HypothesisRow>,
    pub(super) registrations: Vec<RegistrationRow>,
    /// Frames at the last moment.
    pub(super) frames: Vec<FrameRow>,
    pub(super) unmerged: Vec<(String, String)>,
    pub(super) pairs: Vec<PairRow>,
    pub(super) agreement: Option<[f64; 3]>,
    /// Metadata of the log: name and text.
    pub(super) metadata: Vec<(String, String)>,
    /// Problems of the log.
    pub(super) problems: Vec<String>,
}

/// A map.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct MapImage {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Side of a cell, metres.
    pub(super) resolution: f64,
    /// Pose of the outer corner of the first cell, metres and radians.
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) yaw: f64,
    /// The cells as a grey PNG in base 64: 0 to 100, or 255 for unknown; the last row first.
    pub(super) png: String,
}

/// A robot, with its findings in the frame of the page, metres and radians.
#[derive(Debug, Default, Serialize)]
pub(super) struct Robot {
    pub(super) name: String,
    /// Colour such as `#0072b2`.
    pub(super) colour: String,
    /// Its last map in its own frame.
    pub(super) own: Option<MapImage>,
    /// The pose of its map frame at the end: x, y and yaw.
    pub(super) pose: [f64; 3],
    pub(super) map: Versions<Option<MapImage>>,
    pub(super) findings: Versions<Findings>,
}

/// The features of a robot's map.
#[derive(Debug, Default, PartialEq, Serialize)]
pub(super) struct Findings {
    /// Walls: both ends, reliability, inliers.
    pub(super) segments: Vec<[f64; 6]>,
    /// Origin of the map frame, direction of the walls, its standard deviation, the agreement.
    pub(super) direction: Option<[f64; 5]>,
    pub(super) tags: Vec<TagMark>,
    /// The path of the robot.
    pub(super) path: Vec<[f64; 2]>,
    /// Nodes of the deformation: position, displacement and rotation of each.
    pub(super) bends: Vec<[f64; 5]>,
    /// Places of the topological map: position and kind.
    pub(super) places: Vec<(f64, f64, String)>,
    pub(super) ways: Vec<Vec<[f64; 2]>>,
}

#[derive(Debug, PartialEq, Serialize)]
pub(super) struct TagMark {
    pub(super) id: String,
    pub(super) x: f64,
    pub(super) y: f64,
    /// Half axes of the ellipse of two standard deviations, metres, and the direction of the first.
    pub(super) ellipse: [f64; 3],
    pub(super) certainty: f64,
    pub(super) readings: u32,
}

/// A hypothesis for a pair, with its pose `T_a_b`.
#[derive(Debug, Serialize)]
pub(super) struct HypothesisRow {
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

/// Errors of ICP over its iterations, from one initial guess.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct RegistrationRow {
    pub(super) a: String,
    pub(super) b: String,
    pub(super) source: String,
    pub(super) rank: u32,
    pub(super) accepted: bool,
    pub(super) iterations: usize,
    /// Error of the first iteration, metres.
    pub(super) first: String,
    /// Error of the last iteration, metres.
    pub(super) last: String,
    /// The curve over the iterations, as an SVG path in a box of 160 by 40 pixels.
    pub(super) curve: String,
}

/// The pose of a robot's map frame, as text for a table.
#[derive(Debug, Serialize)]
pub(super) struct FrameRow {
    pub(super) robot: String,
    /// The robot whose map frame the pose is in.
    pub(super) reference: String,
    pub(super) x: String,
    pub(super) y: String,
    pub(super) yaw: String,
    /// Standard deviations: metres, metres, degrees.
    pub(super) deviations: [String; 3],
    /// Three rows of three.
    pub(super) covariance: Vec<Vec<String>>,
}

/// The decision on a pair.
#[derive(Debug, Serialize)]
pub(super) struct PairRow {
    pub(super) a: String,
    pub(super) b: String,
    pub(super) accepted: bool,
    pub(super) checked: bool,
    pub(super) score: String,
    pub(super) method: String,
    pub(super) reason: String,
}
