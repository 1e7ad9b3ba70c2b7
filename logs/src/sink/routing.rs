//! The assignment of messages to channels of the log.

use crate::qos;
use crate::schemas::{full_type_name, schema_text};
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{RosMessage, TFMessage};
use gridweave_runtime::stage::{Context, match_robot};

/// The route of the messages of an input channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Route {
    /// They are written on this channel.
    Write(Channel),
    /// They are dropped, for this reason.
    LeaveOut(String),
}

/// The topics of a run's results, known before its first message.
pub(crate) struct ResultTopics {
    /// The topic template and the ROS 2 type of each sink input that has them.
    outputs: Vec<(String, String)>,
}

impl ResultTopics {
    pub(crate) fn new(context: &Context) -> Self {
        let results = context.inputs.iter().filter(|wire| !wire.topic.is_empty());
        Self { outputs: results.map(|wire| (wire.topic.clone(), wire.ros_type.clone())).collect() }
    }

    /// The type of the result on this topic.
    fn type_on(&self, topic: &str) -> Option<&str> {
        self.outputs.iter().find(|(template, _)| fits(template, topic)).map(|(_, ros_type)| ros_type.as_str())
    }

    /// The route of an input channel: unchanged, unless a result has its topic.
    ///
    /// A result has its topic exclusively: an input map on `/map` would be mistaken for the merged one. Transforms are
    /// the exception, since all transforms on a topic belong together; they share the result's channel.
    pub(crate) fn route(&self, channel: &Channel) -> Route {
        let topic = &channel.topic;
        match self.type_on(topic) {
            None => Route::Write(qos::completed(channel.clone())),
            Some(TFMessage::NAME) if is_tf(channel) => Route::Write(result_channel(topic, TFMessage::NAME, "")),
            Some(_) => Route::LeaveOut(format!(
                "the input's messages on {topic} were dropped: a result of this run has that topic"
            )),
        }
    }
}

/// Whether a topic matches `template`, with a robot's name or without.
fn fits(template: &str, topic: &str) -> bool {
    template.replace("/{robot}", "") == topic || match_robot(template, topic).is_some()
}

/// Whether a channel carries transforms.
pub(crate) fn is_tf(channel: &Channel) -> bool {
    channel.message_encoding == "cdr" && full_type_name(&channel.schema_name) == TFMessage::NAME
}

/// The channel of a result. `definition` is that of its type, if the stage provides one. Otherwise the schema is empty
/// for types without a built-in definition.
pub fn result_channel(topic: &str, ros_type: &str, definition: &str) -> Channel {
    let schema = match definition.is_empty() {
        true => schema_text(ros_type).unwrap_or_default(),
        false => definition.to_owned(),
    };
    Channel {
        topic: topic.to_owned(),
        message_encoding: "cdr".to_owned(),
        schema_name: ros_type.to_owned(),
        schema_encoding: "ros2msg".to_owned(),
        schema: schema.into_bytes(),
        metadata: qos::metadata(topic, ros_type),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::stage::InputWire;

    fn results() -> ResultTopics {
        let wires = [
            ("", ""),
            ("/map", "nav_msgs/msg/OccupancyGrid"),
            ("/tf_static", TFMessage::NAME),
            ("/{robot}/lines/segments", "gridweave_msgs/msg/Segments"),
        ];
        let wire = |(topic, ros_type): (&str, &str)| InputWire {
            port: "messages",
            ros_type: ros_type.into(),
            topic: topic.into(),
            ..Default::default()
        };
        ResultTopics::new(&Context { inputs: wires.map(wire).to_vec(), ..Default::default() })
    }

    fn channel(topic: &str, schema_name: &str) -> Channel {
        let (message_encoding, schema_name) = ("cdr".into(), schema_name.into());
        Channel { topic: topic.into(), message_encoding, schema_name, schema: b"?".to_vec(), ..Default::default() }
    }

    #[test]
    fn the_input_keeps_its_channels_where_no_result_has_the_topic() {
        for topic in ["/robot1/map", "/tf", "/maps", "/a/b/lines/segments", "/robot1/lines", ""] {
            let channel = channel(topic, "nav_msgs/msg/Odometry");
            assert_eq!(results().route(&channel), Route::Write(channel));
        }
    }

    #[test]
    fn a_result_keeps_its_topic_for_itself() {
        for topic in ["/map", "/robot1/lines/segments", "/lines/segments"] {
            for ros_type in ["nav_msgs/msg/OccupancyGrid", "std_msgs/msg/String"] {
                let Route::LeaveOut(reason) = results().route(&channel(topic, ros_type)) else { panic!("{topic}") };
                assert!(reason.starts_with(&format!("the input's messages on {topic} were dropped")), "{reason}");
            }
        }
    }

    #[test]
    fn transforms_of_the_input_join_those_of_the_result() {
        let expected = result_channel("/tf_static", TFMessage::NAME, "");
        for name in [TFMessage::NAME, "tf2_msgs/TFMessage"] {
            assert_eq!(results().route(&channel("/tf_static", name)), Route::Write(expected.clone()));
        }
        let foreign = Channel { message_encoding: "ros1".into(), ..channel("/tf_static", TFMessage::NAME) };
        assert!(matches!(results().route(&foreign), Route::LeaveOut(_)));
    }
}
