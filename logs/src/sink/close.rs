//! Closing a log whose writer was killed.

use super::{LogOptions, LogWriteError, LogWriter, Outcome};
use crate::reader::{Damage, LogFile, LogReader, ReadError};
use mcap::records::MessageHeader;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Why a log could not be closed.
#[derive(Debug, thiserror::Error)]
pub enum CloseError {
    /// What there is of it cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It cannot be written anew.
    #[error(transparent)]
    Write(#[from] LogWriteError),
    /// The closed log cannot be put in place of the other.
    #[error("cannot put the closed log in place of {}: {cause}", path.display())]
    Replace {
        /// The log.
        path: PathBuf,
        /// What the system says.
        cause: std::io::Error,
    },
}

/// Closes the log at `path` if its writer was killed: what can be read of it is written anew, with an index, and with the
/// `reason` why it is not complete. Whether that was needed; a log that has an end is not touched.
pub fn close_log(path: &Path, reason: &str) -> Result<bool, CloseError> {
    let file = match LogFile::open(path) {
        Ok(file) if !file.damage().iter().any(|damage| matches!(damage, Damage::NoEnd { .. })) => return Ok(false),
        Ok(file) => Some(file),
        // It was killed before it had written a chunk.
        Err(ReadError::Empty { .. } | ReadError::NothingLeft { .. }) => None,
        Err(error) => return Err(error.into()),
    };
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".closing");
    let closing = path.with_file_name(name);
    let written = copy(file, &closing, reason);
    let replaced = written.and_then(|()| {
        fs::rename(&closing, path).map_err(|cause| CloseError::Replace { path: path.to_owned(), cause })
    });
    if replaced.is_err() {
        // It is of no use, and it may be a full disk that is in the way.
        let _ = fs::remove_file(&closing);
    }
    replaced.map(|()| true)
}

fn copy(file: Option<LogFile>, path: &Path, reason: &str) -> Result<(), CloseError> {
    let mut log = LogWriter::create(path, LogOptions::default())?;
    let mut reader = LogReader::new(file.into_iter().collect());
    let files = std::sync::Arc::clone(reader.files());
    let mut numbers: BTreeMap<u16, u16> = BTreeMap::new();
    while let Some(message) = reader.next_message() {
        let channel_id = match numbers.get(&message.channel) {
            Some(number) => *number,
            None => {
                let Some(channel) = files.first().and_then(|file| file.channel(message.channel)) else { continue };
                let number = log.channel(&channel)?;
                numbers.insert(message.channel, number);
                number
            }
        };
        let header = MessageHeader {
            channel_id,
            sequence: message.sequence,
            log_time: message.log_time.0,
            publish_time: message.publish_time,
        };
        log.write(&header, message.data)?;
    }
    Ok(log.finish(Outcome::Incomplete(reason))?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::Channel;

    fn write(path: &Path, messages: u32) {
        let mut log = LogWriter::create(path, LogOptions { chunk_size: 1000, ..Default::default() }).unwrap();
        let channel = Channel { topic: "/a".into(), message_encoding: "cdr".into(), ..Default::default() };
        let channel_id = log.channel(&channel).unwrap();
        for sequence in 0..messages {
            let time = u64::from(sequence);
            log.write(&MessageHeader { channel_id, sequence, log_time: time, publish_time: time }, &[7; 90]).unwrap();
        }
        log.finish(Outcome::Complete).unwrap();
    }

    #[test]
    fn what_is_left_of_a_log_is_closed_and_says_why_it_ends() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        write(&path, 100);
        assert!(!close_log(&path, "nothing").unwrap(), "it has an end");
        let whole = fs::read(&path).unwrap();
        for length in [0, 5, 8, 30, whole.len() / 2, whole.len() - 20] {
            fs::write(&path, &whole[..length]).unwrap();
            let expected = LogFile::open(&path).map_or(0, |file| {
                let mut reader = LogReader::new(vec![file]);
                std::iter::from_fn(|| reader.next_message().map(|message| message.log_time)).count()
            });
            assert!(close_log(&path, "it was killed").unwrap(), "{length}");
            let bytes = fs::read(&path).unwrap();
            let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).count();
            assert_eq!(messages, expected, "{length}");
            let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
            let record = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
            assert_eq!(record.metadata["reason"], "it was killed");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing else is left");
        }
    }

    #[test]
    fn what_is_no_log_is_not_touched() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "this is no log").unwrap();
        assert!(matches!(close_log(&path, "x"), Err(CloseError::Read(_))));
        assert_eq!(fs::read(&path).unwrap(), b"this is no log");
    }
}
