//! How a message of any type names its type: the channel that it was logged on.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A channel of a log: the topic, the type and the schema of the messages on it.
///
/// A source announces a channel on a link before the first message of it, so that a sink can write messages of types
/// that this program does not know, with all that their log says of them.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Channel {
    /// The topic, as in the input.
    pub topic: String,
    /// The encoding of the messages, `cdr` for ROS 2.
    pub message_encoding: String,
    /// The name of the type, such as `nav_msgs/msg/OccupancyGrid`; empty if the channel has no schema.
    pub schema_name: String,
    /// The encoding of the schema, `ros2msg` for ROS 2.
    pub schema_encoding: String,
    /// The schema.
    #[serde(with = "serde_bytes")]
    pub schema: Vec<u8>,
    /// What else the log says of the channel, such as quality of service.
    pub metadata: BTreeMap<String, String>,
}

impl Channel {
    /// The channel as bytes: CDR, as any message.
    pub fn encode(&self) -> Result<Vec<u8>, crate::ros::EncodeError> {
        crate::ros::encode(self)
    }

    /// Reads what [`encode`](Self::encode) wrote.
    pub fn decode(bytes: &[u8]) -> Result<Self, crate::ros::DecodeError> {
        crate::ros::decode(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_channel_comes_back_as_it_went_in() {
        let channel = Channel {
            topic: "/robot1/scan".into(),
            message_encoding: "cdr".into(),
            schema_name: "sensor_msgs/msg/LaserScan".into(),
            schema_encoding: "ros2msg".into(),
            schema: b"float32[] ranges".to_vec(),
            metadata: BTreeMap::from([("offered_qos_profiles".into(), "".into())]),
        };
        assert_eq!(Channel::decode(&channel.encode().unwrap()).unwrap(), channel);
    }
}
