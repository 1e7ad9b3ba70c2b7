//! Messages of any ROS 2 type, decoded with the schema in their log.
//!
//! A [`Schema`] is parsed from a channel's schema text (`ros2msg`); it decodes a message (CDR) to a [`Value`]: a tree
//! of fields with their names, in order. Values can be compared ([`compare`]), queried by field path ([`FieldPath`]),
//! and converted to JSON ([`Value::to_json`]). Bytes that do not match the schema give an error that names the field;
//! a message has only so many values for its length, and at most two million of them, so little is allocated for it.
//!
//! The CDR reader is not a library's, because types are known only from the definition in the log, without a ROS
//! installation; because decoded values borrow from the message; and because it must be safe on damaged bytes.
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
mod ros1_encoder;
mod schema;
mod type_hash;
mod value;

#[cfg(test)]
mod tests;

pub use compare::{Difference, Differences, compare, nearly_equal};
pub use decode::SchemaMismatch;
pub use json::JsonOptions;
pub use path::{FieldPath, PathError};
pub use reader::DecodeFault;
pub use recode::Recoder;
pub(crate) use ros1_encoder::Ros1Encoder;
pub(crate) use schema::sections;
pub use schema::{Schema, SchemaError};
pub use value::{Array, Scalar, Value};
