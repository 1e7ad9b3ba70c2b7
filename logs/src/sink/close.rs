//! Closing a log whose writer was killed.

use super::log_writer::OUTCOME_RECORD;
use super::{LogOptions, LogWriteError, LogWriter, Outcome};
use crate::reader::{Damage, LogFile, LogReader, ReadError};
use mcap::MAGIC;
use mcap::records::{MessageHeader, op};
use std::collections::BTreeMap;
use std::fs;
use std::io::{Seek, SeekFrom, Write};
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
/// `reason` why it is not complete. Where there is no room for that, it is closed in its place, without an index.
/// Whether any of this was needed; a log that has an end is not touched.
pub fn close_log(path: &Path, reason: &str) -> Result<bool, CloseError> {
    let (file, end) = match LogFile::open(path) {
        Ok(file) => match file.damage().iter().find_map(end_of_records) {
            Some(end) => (Some(file), Some(end)),
            None => return Ok(false),
        },
        // It was killed before it had written a chunk.
        Err(ReadError::Empty { .. } | ReadError::NothingLeft { .. }) => (None, None),
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
    match (replaced, end) {
        (Err(CloseError::Write(LogWriteError::NoRoom(_))), Some(end)) => close_in_place(path, end, reason),
        (replaced, _) => replaced,
    }
    .map(|()| true)
}

/// Where the last whole record of a log without an end stops.
fn end_of_records(damage: &Damage) -> Option<u64> {
    match damage {
        Damage::NoEnd { position } => u64::try_from(*position).ok(),
        _ => None,
    }
}

/// Puts the end of a log without an index (MCAP specification: metadata, data end, footer, magic) behind its last whole
/// record. The rest of a record that stood there makes room for it.
fn close_in_place(path: &Path, end: u64, reason: &str) -> Result<(), CloseError> {
    let mut metadata = Vec::new();
    push_text(&mut metadata, OUTCOME_RECORD);
    let mut pairs = Vec::new();
    ["complete", "false", "reason", reason].iter().for_each(|text| push_text(&mut pairs, text));
    push_length(&mut metadata, pairs.len());
    metadata.extend(pairs);
    let mut bytes = Vec::new();
    for (opcode, body) in [(op::METADATA, metadata.as_slice()), (op::DATA_END, &[0; 4]), (op::FOOTER, &[0; 20])] {
        bytes.push(opcode);
        bytes.extend((body.len() as u64).to_le_bytes());
        bytes.extend(body);
    }
    bytes.extend(MAGIC);
    let write = || {
        let mut file = fs::OpenOptions::new().write(true).open(path)?;
        file.set_len(end)?;
        file.seek(SeekFrom::Start(end))?;
        file.write_all(&bytes)
    };
    write().map_err(|error| LogWriteError::from_io(path, error).into())
}

fn push_text(bytes: &mut Vec<u8>, text: &str) {
    push_length(bytes, text.len());
    bytes.extend(text.as_bytes());
}

fn push_length(bytes: &mut Vec<u8>, length: usize) {
    bytes.extend(u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
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
    fn a_log_can_be_closed_in_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        write(&path, 100);
        let whole = fs::read(&path).unwrap();
        fs::write(&path, &whole[..whole.len() / 2]).unwrap();
        let end = LogFile::open(&path).unwrap().damage().iter().find_map(end_of_records).unwrap();
        close_in_place(&path, end, "the disk was full").unwrap();
        let file = LogFile::open(&path).unwrap();
        assert_eq!(file.damage(), [Damage::Incomplete { reason: "the disk was full".into() }]);
        let mut reader = LogReader::new(vec![file]);
        assert!(std::iter::from_fn(|| reader.next_message().map(drop)).count() > 20);
        let bytes = fs::read(&path).unwrap();
        assert!(mcap::MessageStream::new(&bytes).unwrap().all(|message| message.is_ok()));
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
