//! Liveliness tokens: the discovery of nodes, publishers and subscribers by ROS 2 programs, such as `ros2 node list`
//! and `ros2 topic list`.

use super::key_expression::{Topic, type_in_keys, type_of_key};
use super::qos::Qos;
use std::fmt;
use std::str::FromStr;
use twox_hash::XxHash3_128;

/// The prefix of all tokens.
const SPACE: &str = "@ros2_lv";

/// The kind of an entity.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// A node.
    Node,
    /// A publisher of a node.
    Publisher(Topic, Qos),
    /// A subscriber of a node.
    Subscriber(Topic, Qos),
}

/// A node, or a publisher or subscriber of a node, as announced by a token.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Entity {
    /// The ROS domain.
    pub domain: u32,
    /// The Zenoh session that it belongs to, in hexadecimal digits.
    pub session: String,
    /// The number of its node in the session.
    pub node_number: u32,
    /// Its number in the session; for a node the number of the node.
    pub number: u32,
    /// The enclave of its node; `/` without SROS.
    pub enclave: String,
    /// The namespace of its node: `/`, or such as `/robot1`.
    pub namespace: String,
    /// The name of its node.
    pub node: String,
    /// Its kind.
    pub kind: Kind,
}

impl Entity {
    /// The key expression that matches the tokens of all entities in a domain.
    pub fn all(domain: u32) -> String {
        format!("{SPACE}/{domain}/**")
    }

    /// The key expression that matches the tokens of all subscribers of a topic.
    pub(crate) fn subscribers(domain: u32, topic: &Topic) -> String {
        let (name, of) = (mangled(&topic.name), type_in_keys(&topic.ros_type));
        format!("{SPACE}/{domain}/*/*/*/MS/*/*/*/{name}/{of}/{}/*", topic.type_hash)
    }

    /// The identifier of its messages: the 128-bit XXH3 hash of the token.
    pub fn gid(&self) -> [u8; 16] {
        XxHash3_128::oneshot(self.to_string().as_bytes()).to_le_bytes()
    }

    /// The full name of its node, such as `/robot1/slam_toolbox`.
    pub fn full_node_name(&self) -> String {
        format!("{}/{}", self.namespace.trim_end_matches('/'), self.node)
    }
}

/// The key expression of the token.
impl fmt::Display for Entity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (short, topic) = match &self.kind {
            Kind::Node => ("NN", None),
            Kind::Publisher(topic, qos) => ("MP", Some((topic, qos))),
            Kind::Subscriber(topic, qos) => ("MS", Some((topic, qos))),
        };
        let Self { domain, session, node_number, number, .. } = self;
        let [enclave, namespace, node] = [&self.enclave, &self.namespace, &self.node].map(|name| mangled(name));
        write!(f, "{SPACE}/{domain}/{session}/{node_number}/{number}/{short}/{enclave}/{namespace}/{node}")?;
        match topic {
            None => Ok(()),
            Some((topic, qos)) => {
                let (name, of) = (mangled(&topic.name), type_in_keys(&topic.ros_type));
                write!(f, "/{name}/{of}/{}/{qos}", topic.type_hash)
            }
        }
    }
}

impl FromStr for Entity {
    type Err = ();

    /// An error for an invalid token, or one of another kind, such as a service.
    fn from_str(token: &str) -> Result<Self, ()> {
        let parts: Vec<&str> = token.split('/').collect();
        let [SPACE, domain, session, node_number, number, short, enclave, namespace, node, topic @ ..] =
            parts.as_slice()
        else {
            return Err(());
        };
        let topic = match topic {
            [name, of, hash, qos, ..] => {
                let ros_type = type_of_key(of).ok_or(())?;
                Some((Topic { name: demangled(name), ros_type, type_hash: (*hash).to_owned() }, qos.parse()?))
            }
            _ => None,
        };
        let kind = match (*short, topic) {
            ("NN", None) => Kind::Node,
            ("MP", Some((topic, qos))) => Kind::Publisher(topic, qos),
            ("MS", Some((topic, qos))) => Kind::Subscriber(topic, qos),
            _ => return Err(()),
        };
        let number_of = |text: &str| text.parse().map_err(|_| ());
        Ok(Self {
            domain: number_of(domain)?,
            session: (*session).to_owned(),
            node_number: number_of(node_number)?,
            number: number_of(number)?,
            enclave: demangled(enclave),
            namespace: demangled(namespace),
            node: demangled(node),
            kind,
        })
    }
}

fn mangled(name: &str) -> String {
    name.replace('/', "%")
}

fn demangled(name: &str) -> String {
    name.replace('%', "/")
}

#[cfg(test)]
mod tests {
    use super::*;

    const HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

    fn listener() -> Entity {
        Entity {
            domain: 2,
            session: "aac3178e146ba6f1fc6e6a4085e77f21".into(),
            node_number: 0,
            number: 0,
            enclave: "/".into(),
            namespace: "/".into(),
            node: "listener".into(),
            kind: Kind::Node,
        }
    }

    /// The examples of `docs/design.md` of `rmw_zenoh`.
    #[test]
    fn tokens_equal_those_of_ros() {
        let topic = Topic { name: "/chatter".into(), ros_type: "std_msgs/msg/String".into(), type_hash: HASH.into() };
        let subscriber = Entity { number: 10, kind: Kind::Subscriber(topic.clone(), Qos::reliable(10)), ..listener() };
        let publisher = Entity {
            session: "8b20917502ee955ac4476e0266340d5c".into(),
            number: 10,
            node: "talker".into(),
            kind: Kind::Publisher(topic, Qos::reliable(7)),
            ..listener()
        };
        let of_chatter = format!("%chatter/std_msgs::msg::dds_::String_/{HASH}");
        for (entity, token) in [
            (listener(), "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener".to_owned()),
            (
                subscriber,
                format!("@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MS/%/%/listener/{of_chatter}/::,10:,:,:,,"),
            ),
            (
                publisher,
                format!("@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/{of_chatter}/::,7:,:,:,,"),
            ),
        ] {
            assert_eq!(entity.to_string(), token);
            assert_eq!(token.parse(), Ok(entity));
        }
    }

    /// By the library `xxhash` for Python.
    #[test]
    fn the_identifier_is_the_hash_of_the_token() {
        let hex = listener().gid().iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        assert_eq!(hex, "49877999dacb858702d11ac823785912");
    }

    #[test]
    fn names_in_a_namespace_or_an_enclave_are_read_back() {
        let node = Entity { namespace: "/fleet/robot1".into(), ..listener() };
        assert_eq!(node.to_string(), "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%fleet%robot1/listener");
        assert_eq!(node.to_string().parse(), Ok(node.clone()));
        assert_eq!(node.full_node_name(), "/fleet/robot1/listener");
        let node = Entity { enclave: "/fleet/a".into(), ..listener() };
        assert_eq!(node.to_string(), "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%fleet%a/%/listener");
        assert_eq!(node.to_string().parse(), Ok(node));
        assert_eq!(listener().full_node_name(), "/listener");
    }

    #[test]
    fn invalid_tokens_are_errors() {
        for text in [
            "",
            "@ros2_lv/0",
            "@ros2_lv/x/a/0/0/NN/%/%/n",
            "@ros2_lv/0/a/0/0/XX/%/%/n",
            "@ros2_lv/0/a/0/1/MP/%/%/n",
            "@ros2_lv/0/a/0/1/MP/%/%/n/%map/nav_msgs/RIHS01_1/::,1:,:,:,,",
            "@ros2_lv/0/a/0/1/SS/%/%/n/%add/a::srv::dds_::Add_/RIHS01_1/::,1:,:,:,,",
            "other/0/a/0/0/NN/%/%/n",
        ] {
            assert_eq!(text.parse::<Entity>(), Err(()), "{text}");
        }
    }
}
