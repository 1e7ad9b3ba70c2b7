//! The hash of a type, by which ROS 2 (since Iron) checks that two programs use the same definition.
//!
//! It is the SHA-256 of a canonical JSON description of the type and of all types that it uses: version 1 of REP-2016
//! ("ROS 2 Interface Type Descriptions"), as implemented by `rosidl_generator_type_description`. Comments, constants
//! and default values are not included.

use super::definition::{Count, Primitive};
use super::schema::{Element, Field, MessageType, Schema};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The ids of types in `type_description_interfaces/msg/FieldType`.
const MESSAGE: u32 = 1;
const BOUNDED_TEXT: u32 = 21;
const BOUNDED_WIDE_TEXT: u32 = 22;
/// The offsets of these ids for fields with several values.
const ARRAY: u32 = 48;
const BOUNDED_SEQUENCE: u32 = 96;
const SEQUENCE: u32 = 144;

impl Schema {
    /// The hash of the type: `RIHS01_` and 64 hexadecimal digits.
    pub fn type_hash(&self) -> String {
        let description = self.description();
        let digits = Sha256::digest(description.as_bytes());
        digits.iter().fold("RIHS01_".to_owned(), |mut text, byte| {
            let _ = write!(text, "{byte:02x}");
            text
        })
    }

    fn description(&self) -> String {
        let Some((root, used)) = self.types.split_last() else { return String::new() };
        // Sorted by name, since the text of a type may be in any order.
        let used: BTreeMap<String, &MessageType> = used.iter().map(|of| (long_name(of), of)).collect();
        let used: Vec<String> = used.into_values().map(|of| self.describe(of)).collect();
        let root = self.describe(root);
        format!(r#"{{"type_description": {root}, "referenced_type_descriptions": [{}]}}"#, used.join(", "))
    }

    fn describe(&self, of: &MessageType) -> String {
        let fields: Vec<String> = match of.fields.is_empty() {
            // The member that IDL adds to a message without fields, since a structure has at least one member.
            true => vec![described("structure_needs_at_least_one_member", number(Primitive::U8), 0, 0, "")],
            false => of.fields.iter().map(|field| self.describe_field(field)).collect(),
        };
        format!(r#"{{"type_name": "{}", "fields": [{}]}}"#, long_name(of), fields.join(", "))
    }

    fn describe_field(&self, field: &Field) -> String {
        let (of_one, nested) = match field.of {
            Element::Message(index) => (MESSAGE, self.types.get(index).map(long_name).unwrap_or_default()),
            Element::Primitive(primitive) => (
                match (primitive, field.text_bound) {
                    (Primitive::Text, Some(_)) => BOUNDED_TEXT,
                    (Primitive::WideText, Some(_)) => BOUNDED_WIDE_TEXT,
                    _ => number(primitive),
                },
                String::new(),
            ),
        };
        let (more, capacity) = match field.count {
            Count::One => (0, 0),
            Count::Fixed(count) => (ARRAY, count),
            Count::UpTo(bound) => (BOUNDED_SEQUENCE, bound),
            Count::Any => (SEQUENCE, 0),
        };
        described(&field.name, of_one + more, capacity, field.text_bound.unwrap_or(0), &nested)
    }
}

fn described(name: &str, id: u32, capacity: usize, text_capacity: usize, nested: &str) -> String {
    format!(
        r#"{{"name": "{name}", "type": {{"type_id": {id}, "capacity": {capacity}, "string_capacity": {text_capacity}, "nested_type_name": "{nested}"}}}}"#
    )
}

/// `package/msg/Type`.
fn long_name(of: &MessageType) -> String {
    of.name.replacen('/', "/msg/", 1)
}

fn number(primitive: Primitive) -> u32 {
    match primitive {
        Primitive::I8 => 2,
        Primitive::U8 => 3,
        Primitive::I16 => 4,
        Primitive::U16 => 5,
        Primitive::I32 => 6,
        Primitive::U32 => 7,
        Primitive::I64 => 8,
        Primitive::U64 => 9,
        Primitive::F32 => 10,
        Primitive::F64 => 11,
        Primitive::Bool => 15,
        Primitive::Byte => 16,
        Primitive::Text => 17,
        Primitive::WideText => 18,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::schemas::schema_text;

    fn hash(name: &str, text: &str) -> String {
        Schema::parse(name, text).unwrap().type_hash()
    }

    /// From the files `share/PACKAGE/msg/TYPE.json` of ROS 2 Jazzy; `ros2 topic info -v` shows the same.
    #[test]
    fn standard_types_have_the_hashes_that_ros_publishes() {
        for (name, expected) in [
            ("builtin_interfaces/msg/Time", "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197"),
            ("geometry_msgs/msg/PoseStamped", "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"),
            (
                "geometry_msgs/msg/PoseWithCovarianceStamped",
                "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
            ),
            ("nav_msgs/msg/OccupancyGrid", "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7"),
            ("nav_msgs/msg/Odometry", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
            ("nav_msgs/msg/Path", "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b"),
            ("rosgraph_msgs/msg/Clock", "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"),
            ("sensor_msgs/msg/CameraInfo", "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"),
            ("sensor_msgs/msg/Image", "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"),
            ("sensor_msgs/msg/Imu", "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"),
            ("sensor_msgs/msg/LaserScan", "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"),
            ("sensor_msgs/msg/MultiEchoLaserScan", "ba5eac341cd5bbb2701527aa4568e8baec172b69cadb9a1945d6f149d087ee48"),
            ("sensor_msgs/msg/NavSatFix", "62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404"),
            ("sensor_msgs/msg/PointCloud2", "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"),
            ("std_msgs/msg/Empty", "20b625256f32d5dbc0d04fee44f43c41e51c70d3502f84b4a08e7a9c26a96312"),
            ("std_msgs/msg/Header", "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"),
            ("std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
            ("tf2_msgs/msg/TFMessage", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
            ("visualization_msgs/msg/Marker", "45b13ccf791f225962bf74e746f9644518855d783a6f42ba0cc14fde2b4f3ce0"),
            ("visualization_msgs/msg/MarkerArray", "86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf"),
        ] {
            assert_eq!(hash(name, &schema_text(name).unwrap()), format!("RIHS01_{expected}"), "{name}");
        }
    }

    #[test]
    fn bounds_and_kinds_count_and_comments_constants_and_defaults_do_not() {
        let of = |text| hash("a/msg/B", text);
        assert_eq!(of("int32 X=5\nint32 a 7 # the first"), of("int32 a"));
        let different = [
            "int32 a",
            "int32 b",
            "int32[] a",
            "int32[3] a",
            "int32[<=3] a",
            "int32[<=4] a",
            "byte a",
            "uint8 a",
            "string a",
            "string<=3 a",
            "string<=4 a",
            "wstring a",
            "wstring<=3 a",
        ];
        let hashes: std::collections::BTreeSet<String> = different.into_iter().map(of).collect();
        assert_eq!(hashes.len(), different.len());
        assert_eq!(of("char a"), of("uint8 a"), "char is a number in ROS 2");
    }
}
