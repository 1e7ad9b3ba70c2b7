//! The key expressions of topics: `DOMAIN/TOPIC/TYPE/TYPE_HASH`.

use gridweave_logs::dynamic::Schema;
use gridweave_logs::schemas::schema_text;

/// The type hash where ROS has none, as in Humble.
pub const NO_HASH: &str = "TypeHashNotSupported";

/// A topic, with everything that a publisher and a subscriber of ROS 2 must agree on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Topic {
    /// The full name, such as `/robot1/map`.
    pub name: String,
    /// The type of its messages, such as `nav_msgs/msg/OccupancyGrid`.
    pub ros_type: String,
    /// The hash of the type's definition (`RIHS01_...`), or [`NO_HASH`].
    pub type_hash: String,
}

impl Topic {
    /// A topic of a built-in message type; `None` if the type is unknown.
    pub fn known(name: &str, ros_type: &str) -> Option<Self> {
        Some(Self { name: name.to_owned(), ros_type: ros_type.to_owned(), type_hash: known_hash(ros_type)? })
    }

    /// The key expression of its messages.
    pub fn key_expression(&self, domain: u32) -> String {
        let name = self.name.trim_matches('/');
        format!("{domain}/{name}/{}/{}", type_in_keys(&self.ros_type), self.type_hash)
    }
}

/// The hash of a built-in type; `None` if the type is unknown.
pub fn known_hash(ros_type: &str) -> Option<String> {
    let schema = Schema::parse(ros_type, &schema_text(ros_type)?).ok()?;
    Some(schema.type_hash())
}

/// The DDS name of a type: `nav_msgs::msg::dds_::OccupancyGrid_` for `nav_msgs/msg/OccupancyGrid`.
pub(crate) fn type_in_keys(ros_type: &str) -> String {
    match ros_type.rsplit_once('/') {
        Some((package, name)) => format!("{}::dds_::{name}_", package.replace('/', "::")),
        None => ros_type.to_owned(),
    }
}

/// The type with a DDS name; `None` if the name is invalid.
pub(crate) fn type_of_key(type_in_keys: &str) -> Option<String> {
    let (package, name) = type_in_keys.split_once("::dds_::")?;
    let name = name.strip_suffix('_').filter(|name| !name.is_empty() && !package.is_empty())?;
    Some(format!("{}/{name}", package.replace("::", "/")))
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRING_HASH: &str = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18";

    /// The examples of `docs/design.md` of `rmw_zenoh`.
    #[test]
    fn key_expressions_equal_those_of_ros() {
        let of = |name: &str| Topic::known(name, "std_msgs/msg/String").unwrap().key_expression(0);
        assert_eq!(of("/chatter"), format!("0/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"));
        assert_eq!(of("/robot1/chatter"), format!("0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"));
        assert!(Topic::known("/chatter", "other_msgs/msg/String").is_none());
    }

    #[test]
    fn converting_a_type_to_its_dds_name_and_back_gives_the_same_type() {
        for name in ["std_msgs/msg/String", "example_interfaces/srv/AddTwoInts"] {
            assert_eq!(type_of_key(&type_in_keys(name)).as_deref(), Some(name));
        }
        for other in ["", "String", "::dds_::_", "std_msgs::msg::dds_::", "std_msgs::msg::dds_::String"] {
            assert_eq!(type_of_key(other), None, "{other}");
        }
    }
}
