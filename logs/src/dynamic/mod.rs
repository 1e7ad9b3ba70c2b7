//! Messages of any ROS 2 type, read by the schema that their log holds.
//!
//! A [`Schema`] is made from the text of a channel (`ros2msg`); it decodes a message (CDR) to a [`Value`]: a tree of
//! fields that knows their names and their order. Values can be compared ([`compare`]), asked for a field by its path
//! ([`FieldPath`]), and shown as JSON ([`Value::to_json`]). Bytes that do not fit the schema are an error that names the
//! field; nothing is allocated that the length of the message does not warrant.
//!
//! ```
//! use gridweave_logs::dynamic::{FieldPath, Schema};
//! use gridweave_logs::schemas::schema_text;
//! use gridweave_runtime::ros::{TagRange, encode};
//!
//! let name = "gridweave_msgs/msg/TagRange";
//! let schema = Schema::parse(name, &schema_text(name).unwrap()).unwrap();
//! let bytes = encode(&TagRange { tag_id: "9".into(), range: 1.5, ..Default::default() }).unwrap();
//! let value = schema.decode(&bytes).unwrap();
//! let path: FieldPath = "tag_id".parse().unwrap();
//! assert_eq!(value.find(&path).unwrap().to_string(), "\"9\"");
//! ```

mod compare;
mod decode;
mod definition;
mod json;
mod path;
mod reader;
mod recode;
mod schema;
mod type_hash;
mod value;

#[cfg(test)]
mod tests;

pub use compare::{Difference, Differences, compare, nearly_equal};
pub use decode::DecodeError;
pub use json::JsonOptions;
pub use path::{FieldPath, PathError};
pub use reader::DecodeFault;
pub use recode::Recoder;
pub use schema::{Schema, SchemaError};
pub use value::{Array, Scalar, Value};
