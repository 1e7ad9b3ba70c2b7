//! ROS 1 bags (format 2.0) as outputs: the messages are converted from CDR, and their types from those of ROS 2.
//!
//! A bag has no place for attachments and metadata records.

mod bag_writer;
mod definition;
mod record;
#[cfg(test)]
mod tests;

pub(super) use bag_writer::BagWriter;
