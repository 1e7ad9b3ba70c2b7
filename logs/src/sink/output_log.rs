//! A log that is written in the format that its name asks for: MCAP, or a ROS 1 bag for `NAME.bag`.

use super::ros1::BagWriter;
use super::{LogOptions, LogWriteError, LogWriter, Outcome};
use crate::file::OutputFile;
use gridweave_runtime::message::Channel;
use mcap::Attachment;
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A log of either format.
pub(super) enum OutputLog {
    Mcap(Box<LogWriter>),
    Ros1(Box<BagWriter>),
}

/// Whether the log at `path` is a ROS 1 bag, by its name.
pub fn is_ros1_bag(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("bag"))
}

impl OutputLog {
    /// Starts a log at `path`; see [`LogWriter::create`].
    pub(super) fn create(path: &Path, options: LogOptions) -> Result<Self, LogWriteError> {
        Ok(match is_ros1_bag(path) {
            true => Self::Ros1(Box::new(BagWriter::create(path, options)?)),
            false => Self::Mcap(Box::new(LogWriter::create(path, options)?)),
        })
    }

    /// The number of a channel in this log. The inner error says why the format cannot hold its messages.
    pub(super) fn channel(&mut self, channel: &Channel) -> Result<Result<u16, String>, LogWriteError> {
        match self {
            Self::Mcap(log) => log.channel(channel).map(Ok),
            Self::Ros1(bag) => bag.channel(channel),
        }
    }

    /// Writes a message. The inner error says why it was left out.
    pub(super) fn write(&mut self, header: &MessageHeader, bytes: &[u8]) -> Result<Result<(), String>, LogWriteError> {
        match self {
            Self::Mcap(log) => log.write(header, bytes).map(Ok),
            Self::Ros1(bag) => bag.write(header, bytes),
        }
    }

    /// Writes a metadata record; a bag has none.
    pub(super) fn metadata(&mut self, name: &str, metadata: BTreeMap<String, String>) -> Result<(), LogWriteError> {
        match self {
            Self::Mcap(log) => log.metadata(name, metadata),
            Self::Ros1(_) => Ok(()),
        }
    }

    /// Writes an attachment. Returns whether the format has them.
    pub(super) fn attachment(&mut self, attachment: &Attachment<'_>) -> Result<bool, LogWriteError> {
        match self {
            Self::Mcap(log) => log.attachment(attachment).map(|()| true),
            Self::Ros1(_) => Ok(false),
        }
    }

    /// Sets whether the partial file is kept if the log is not finished. By default it is.
    pub(super) fn keep(&mut self, is_kept: bool) {
        match self {
            Self::Mcap(log) => log.keep(is_kept),
            Self::Ros1(bag) => bag.keep(is_kept),
        }
    }

    /// Ends the log; see [`LogWriter::finish`].
    pub(super) fn finish(self, outcome: Outcome<'_>) -> Result<PathBuf, LogWriteError> {
        match self {
            Self::Mcap(log) => log.finish(outcome),
            Self::Ros1(bag) => bag.finish(outcome),
        }
    }

    /// Ends the log, which is complete and stays at `NAME.part`.
    pub(super) fn leave(self) -> Result<(), LogWriteError> {
        let output = match self {
            Self::Mcap(log) => log.end(Outcome::Complete),
            Self::Ros1(bag) => bag.end(),
        };
        output.map(OutputFile::leave)
    }
}

/// Closes the bag that a killed writer has left, of which the whole records end at `end`; it has no index. Returns its
/// path.
pub(super) fn close_bag(output: OutputFile, end: Option<u64>) -> Result<PathBuf, LogWriteError> {
    if let Some(end) = end {
        output.file().set_len(end).map_err(|error| LogWriteError::from_io(output.part(), error))?;
    }
    Ok(output.put_in_free_place()?)
}
