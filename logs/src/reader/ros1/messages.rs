//! Conversion of ROS 1 messages to ROS 2.

use super::definition::{translate, type_name};
use crate::dynamic::{Recoder, Schema};
use crate::reader::damage::{ChunkFault, LARGEST};
use crate::reader::definitions::Definitions;
use crate::reader::record::copy_messages;
use std::sync::Arc;

/// A ROS 1 message type as ROS 2 knows it.
pub(crate) struct Converted {
    pub(crate) type_name: String,
    pub(crate) definition: String,
    /// Converts messages.
    pub(crate) recoder: Arc<Recoder>,
}

impl Converted {
    /// Converts a type by its name and its definition. `None` if the definition cannot be used, or is missing.
    pub(crate) fn of(name: &str, definition: &str) -> Option<Self> {
        if definition.is_empty() && name != "std_msgs/Empty" {
            return None;
        }
        let (type_name, definition) = (type_name(name), translate(definition));
        let recoder = Schema::parse(&type_name, &definition).ok().and_then(Recoder::new).map(Arc::new)?;
        Some(Self { type_name, definition, recoder })
    }
}

/// Copies the messages in `records`, those of ROS 1 converted to CDR. Also returns the number of messages that do not
/// match their definition, which are left out.
pub(crate) fn convert_messages(records: &[u8], definitions: &Definitions) -> Result<(Vec<u8>, u64), ChunkFault> {
    copy_messages(records, |channel, data, copy| {
        let matches = match definitions.ros1().get(&channel) {
            Some(recoder) => recoder.append_ros1(data, copy).is_ok(),
            None => {
                copy.extend_from_slice(data);
                true
            }
        };
        match copy.len() as u64 > LARGEST {
            true => Err(ChunkFault::TooLarge),
            false => Ok(matches),
        }
    })
}
