//! `gridweave_msgs`: the convergence of ICP. The `.msg` texts are in `logs/msg/gridweave_msgs/`.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// The distance between the walls of two maps in each iteration of ICP, from one initial guess.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct IcpErrors {
    /// Time, and the frame of map a.
    pub header: Header,
    /// The robot whose map stays.
    pub a: String,
    /// The robot whose map is moved.
    pub b: String,
    /// The source of the initial guess, such as `tags` or `maps`.
    pub source: String,
    /// The rank of the hypothesis among those for the pair: 0 for the best.
    pub rank: u32,
    /// Whether the result may be used.
    pub accepted: bool,
    /// The weighted root mean square distance of the matched walls before each iteration, metres. The first iterations
    /// match a sample of the points, with a larger maximum distance.
    pub errors: Vec<f64>,
}

ros_messages!("gridweave_msgs": IcpErrors);
