//! The channel of a message in a log, which defines its type.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A channel of a log: the topic, the type and the schema of its messages.
///
/// A source announces a channel on a link before its first message, so that a sink can write messages of types that
/// this program does not know, with all the information of the input log.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
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
    /// Further information of the log about the channel, such as its quality of service.
    pub metadata: BTreeMap<String, String>,
}

impl Channel {
    /// Encodes the channel as CDR, like any message.
    pub fn encode(&self) -> Result<Vec<u8>, crate::ros::EncodeError> {
        crate::ros::encode(self)
    }

    /// Decodes a channel that was encoded by [`encode`](Self::encode).
    pub fn decode(bytes: &[u8]) -> Result<Self, crate::ros::DecodeError> {
        crate::ros::decode(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decoding_an_encoded_channel_gives_the_same_channel() {
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
