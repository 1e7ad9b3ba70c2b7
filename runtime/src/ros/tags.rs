//! `gridweave_msgs`: what robots read of radio tags and see of visual ones, and where the tags are.
//!
//! Covariances are row by row.

use super::{Header, ros_messages};
use serde::{Deserialize, Serialize};

/// One range reading of one radio tag.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TagRange {
    /// Time, and the frame of the antenna.
    pub header: Header,
    /// Which tag.
    pub tag_id: String,
    /// Distance from the antenna to the tag, metres.
    pub range: f64,
    /// Standard deviation of the distance, metres; 0 if it is not known.
    pub range_stddev: f64,
    /// Signal strength, dBm.
    pub rssi: f32,
}

/// Where a robot sees one tag, as a camera does.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TagPosition {
    /// Time, and the frame of the robot's base.
    pub header: Header,
    /// Which tag.
    pub tag_id: String,
    /// Metres ahead of the base.
    pub x: f64,
    /// Metres to its left.
    pub y: f64,
    /// Covariance of x and y, by rows, square metres; zeros if it is not known.
    pub covariance: [f64; 4],
}

/// In which direction a robot perceives one tag, as a camera or an array of antennas does.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TagBearing {
    /// Time, and the frame of the robot's base.
    pub header: Header,
    /// Which tag.
    pub tag_id: String,
    /// Where the sensor is in that frame, metres ahead of the base.
    pub x: f64,
    /// Metres to its left.
    pub y: f64,
    /// The direction from the sensor to the tag, radians, counterclockwise from straight ahead of the base.
    pub bearing: f64,
    /// Standard deviation of the direction, radians; 0 if it is not known.
    pub bearing_stddev: f64,
}

/// Where a robot believes one tag to be.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TagEstimate {
    /// Which tag.
    pub tag_id: String,
    /// Position in the robot's map frame, metres.
    pub x: f64,
    /// Position in the robot's map frame, metres.
    pub y: f64,
    /// Covariance of (x, y) of this mode, square metres, 2 x 2.
    pub covariance: [f64; 4],
    /// Share of the probability that lies at this place, 0 to 1.
    pub certainty: f64,
    /// The number of readings it rests on.
    pub readings: u32,
}

/// All tags that a robot has located so far.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TagEstimates {
    /// Time, and the robot's map frame.
    pub header: Header,
    /// Whose map.
    pub robot: String,
    /// The tags, by falling certainty and then by id.
    pub tags: Vec<TagEstimate>,
}

/// A tag that two robots have located.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CommonTag {
    /// Which tag.
    pub tag_id: String,
    /// Position in map a, metres.
    pub a: [f64; 2],
    /// Position in map b, metres.
    pub b: [f64; 2],
    /// Covariance in map a, square metres, 2 x 2.
    pub covariance_a: [f64; 4],
    /// Covariance in map b, square metres, 2 x 2.
    pub covariance_b: [f64; 4],
    /// Certainty in map a, 0 to 1.
    pub certainty_a: f64,
    /// Certainty in map b, 0 to 1.
    pub certainty_b: f64,
}

impl CommonTag {
    /// The lesser of the two certainties: the common precision of Tsardoulias et al., section 4.1.3.
    pub fn common_precision(&self) -> f64 {
        self.certainty_a.min(self.certainty_b)
    }
}

/// The tags that two robots have in common.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CommonTags {
    /// Time.
    pub header: Header,
    /// The first robot by name.
    pub robot_a: String,
    /// The second robot by name.
    pub robot_b: String,
    /// The tags, by falling common precision and then by id.
    pub tags: Vec<CommonTag>,
    /// Whether they suffice for a merge.
    pub accepted: bool,
    /// Whether they suffice only if the directions and the walls of the maps confirm what they say.
    pub provisional: bool,
    /// Why they do not, or what they are.
    pub reason: String,
}

ros_messages!("gridweave_msgs": TagRange, TagPosition, TagBearing, TagEstimates, CommonTags);
