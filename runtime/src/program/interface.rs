//! The interface of a program's stage: its ports and parameters.

use super::header::CALL_VERSION;
use crate::stage::{InputPort, OutputPort, PortType, RESERVED_KEYS};
use schemars::Schema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// The ports and parameters of a stage that is a program, in JSON:
///
/// ```
/// # use gridweave_runtime::program::Interface;
/// let text = r#"{
///     "protocol": 1,
///     "summary": "Inverts maps.",
///     "inputs": [{ "name": "map", "type": "nav_msgs/msg/OccupancyGrid", "summary": "the robots' maps" }],
///     "outputs": [{ "name": "inverted", "type": "nav_msgs/msg/OccupancyGrid", "summary": "free where it was occupied" }],
///     "parameters": { "type": "object", "properties": {}, "additionalProperties": false }
/// }"#;
/// assert_eq!(Interface::read(text).unwrap().inputs[0].name, "map");
/// ```
///
/// An input may have `many` or `optional`, an output `topic` or `side`; see [`InputPort`] and [`OutputPort`]. The
/// parameters are a JSON schema. `definitions` contains the definitions of custom types of ports in the format
/// `ros2msg`, by name.
#[derive(Clone, Debug)]
pub struct Interface {
    /// What the stage does.
    pub summary: &'static str,
    /// Its inputs, in the order that breaks ties; empty for a source.
    pub inputs: Vec<InputPort>,
    /// Its outputs.
    pub outputs: Vec<OutputPort>,
    /// The JSON schema of its parameters.
    pub parameters: Schema,
    /// The definitions of custom types, by name.
    pub definitions: BTreeMap<String, String>,
    /// The JSON text of the interface.
    pub text: String,
}

#[derive(Deserialize)]
struct Written {
    protocol: u32,
    #[serde(default)]
    summary: String,
    inputs: Vec<WrittenPort>,
    outputs: Vec<WrittenPort>,
    parameters: Schema,
    #[serde(default)]
    definitions: BTreeMap<String, String>,
}

#[derive(Deserialize)]
struct WrittenPort {
    name: String,
    #[serde(rename = "type")]
    ros_type: String,
    #[serde(default)]
    summary: String,
    #[serde(default)]
    many: bool,
    #[serde(default)]
    optional: bool,
    topic: Option<String>,
    #[serde(default)]
    side: bool,
}

impl Interface {
    /// Reads the interface of a program. Its texts are never freed, like those of all stage kinds.
    ///
    /// # Errors
    /// The JSON is invalid, has another version of the protocol, or describes impossible ports; the text says why.
    pub fn read(text: &str) -> Result<Self, String> {
        let written: Written = serde_json::from_str(text).map_err(|error| format!("it cannot be read: {error}"))?;
        if written.protocol != CALL_VERSION {
            let protocol = written.protocol;
            return Err(format!("it has version {protocol} of the call protocol, and this program has {CALL_VERSION}"));
        }
        if written.inputs.is_empty() && written.outputs.is_empty() {
            return Err("it has neither inputs nor outputs".to_owned());
        }
        let ports = || written.inputs.iter().chain(&written.outputs);
        if let Some(name) = ports().map(|port| &port.name).find(|name| !is_port_name(name)) {
            return Err(format!("`{name}` is not a valid port name: expected lower-case letters, digits and `_`"));
        }
        if let Some(port) = ports().find(|port| !is_ros_type(&port.ros_type)) {
            return Err(format!(
                "the port `{}` has the type `{}`, which is not a ROS 2 type",
                port.name, port.ros_type
            ));
        }
        if let Some(name) = written.definitions.keys().find(|name| !ports().any(|port| port.ros_type == **name)) {
            return Err(format!("it defines `{name}`, which is the type of none of its ports"));
        }
        for ports in [&written.inputs, &written.outputs] {
            let is_duplicate = |at: &usize| ports[..*at].iter().any(|port| port.name == ports[*at].name);
            if let Some(at) = (0..ports.len()).find(is_duplicate) {
                return Err(format!("two ports are called `{}`", ports[at].name));
            }
        }
        let parameters = written.parameters.get("properties").and_then(serde_json::Value::as_object);
        let mut names = parameters.into_iter().flat_map(serde_json::Map::keys);
        if let Some(name) = names.find(|name| RESERVED_KEYS.contains(&name.as_str())) {
            return Err(format!(
                "it has a parameter `{name}`, which no pipeline can set: the key is reserved in every stage's table"
            ));
        }
        let input = |port: WrittenPort| InputPort {
            name: port.name.leak(),
            port_type: PortType::Ros(port.ros_type.leak()),
            many: port.many,
            optional: port.optional,
            summary: port.summary.leak(),
        };
        let output = |port: WrittenPort| OutputPort {
            name: port.name.leak(),
            port_type: PortType::Ros(port.ros_type.leak()),
            topic: port.topic.map(|topic| &*topic.leak()),
            side: port.side,
            summary: port.summary.leak(),
        };
        Ok(Self {
            summary: written.summary.leak(),
            inputs: written.inputs.into_iter().map(input).collect(),
            outputs: written.outputs.into_iter().map(output).collect(),
            parameters: written.parameters,
            definitions: written.definitions,
            text: text.to_owned(),
        })
    }
}

fn is_port_name(name: &str) -> bool {
    let allowed = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
    (1..=64).contains(&name.len()) && name.bytes().all(allowed)
}

fn is_ros_type(name: &str) -> bool {
    let is_word =
        |word: &str| !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    let parts: Vec<&str> = name.split('/').collect();
    parts.len() == 3 && parts[1] == "msg" && parts.iter().all(|part| is_word(part))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"{ "protocol": 1, "inputs": [{ "name": "map", "type": "nav_msgs/msg/OccupancyGrid", "many": true }],
        "outputs": [{ "name": "out", "type": "a/msg/B", "topic": "/out" }, { "name": "side", "type": "a/msg/B", "side": true }],
        "parameters": { "properties": {} } }"#;

    #[test]
    fn ports_are_as_the_program_says() {
        let interface = Interface::read(TEXT).unwrap();
        let input = &interface.inputs[0];
        assert_eq!((input.name, input.port_type.name(), input.many), ("map", "nav_msgs/msg/OccupancyGrid", true));
        let outputs: Vec<_> = interface.outputs.iter().map(|port| (port.name, port.topic, port.side)).collect();
        assert_eq!(outputs, [("out", Some("/out"), false), ("side", None, true)]);
    }

    #[test]
    fn an_invalid_interface_is_rejected_with_the_reason() {
        for (from, to, says) in [
            ("\"protocol\": 1", "\"protocol\": 9", "version 9 of the call protocol"),
            ("\"map\"", "\"Map\"", "`Map` is not a valid port name"),
            ("a/msg/B", "a/B", "`a/B`, which is not a ROS 2 type"),
            ("\"side\"", "\"out\"", "two ports are called `out`"),
            (
                "\"properties\": {}",
                "\"properties\": { \"depth\": {} }",
                "a parameter `depth`, which no pipeline can set",
            ),
            (
                "\"protocol\": 1",
                "\"protocol\": 1, \"definitions\": { \"a/msg/None\": \"\" }",
                "the type of none of its ports",
            ),
            (TEXT, "{}", "cannot be read"),
            (TEXT, "", "cannot be read"),
        ] {
            let error = Interface::read(&TEXT.replacen(from, to, 1)).unwrap_err();
            assert!(error.contains(says), "{error}");
        }
        let none = r#"{ "protocol": 1, "inputs": [], "outputs": [], "parameters": {} }"#;
        assert!(Interface::read(none).unwrap_err().contains("neither inputs nor outputs"));
    }
}
