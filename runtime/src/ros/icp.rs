//! `gridweave_msgs`: how ICP went. The `.msg` texts lie in `logs/msg/gridweave_msgs/`.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// How far the walls of two maps lay apart in each iteration of ICP, from one first guess.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IcpErrors {
    /// Time, and the frame of map a.
    pub header: Header,
    /// The robot whose map stays.
    pub a: String,
    /// The robot whose map is moved.
    pub b: String,
    /// What the first guess was found from, such as `tags` or `maps`.
    pub source: String,
    /// Its place among the hypotheses for the pair: 0 for the best.
    pub rank: u32,
    /// Whether the place that was found may be used.
    pub accepted: bool,
    /// The root of the weighted mean of the squared distances of walls that were paired, metres, before each iteration's step.
    /// The first iterations pair a sample of the points, and walls that lie farther apart than the last ones do.
    pub errors: Vec<f64>,
}

ros_messages!("gridweave_msgs": IcpErrors);
