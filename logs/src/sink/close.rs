//! Closing a log whose writer was killed.

use super::output_log::{close_bag, is_ros1_bag};
use super::rewrite::rewrite;
use super::{LogOptions, LogWriteError, LogWriter, Outcome};
use crate::file::{OutputFile, unlock_left};
use crate::reader::OUTCOME_RECORD;
use crate::reader::{Damage, LogFile, LogReader, ReadError};
use mcap::MAGIC;
use mcap::records::op;
use std::fs::{self, File};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// The error when a log cannot be closed.
#[derive(Debug, thiserror::Error)]
pub enum CloseError {
    /// The partial log cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The partial log cannot be rewritten.
    #[error(transparent)]
    Write(#[from] LogWriteError),
}

/// Closes the partial log that a killed writer has left for `path`, and returns its place, as [`LogWriter::finish`]
/// does; `None` if there is no partial log. The readable part is rewritten, with an index and the `reason` why it is
/// incomplete. If there is no room for that, the file is closed in place, without an index, as a ROS 1 bag always is.
///
/// # Errors
/// The writer is alive, the partial file is not a log, or it cannot be written.
pub fn close_log(path: &Path, reason: &str) -> Result<Option<PathBuf>, CloseError> {
    unlock_left(path);
    let Some(mut output) = OutputFile::of_killed(path).map_err(LogWriteError::from)? else { return Ok(None) };
    if is_ros1_bag(path) {
        let end = LogFile::open(output.part()).ok().and_then(|file| file.damage().iter().find_map(end_of_records));
        return Ok(Some(close_bag(output, end)?));
    }
    let (file, end) = match LogFile::open(output.part()) {
        Ok(file) => match file.damage().iter().find_map(end_of_records) {
            Some(end) => (Some(file), Some(end)),
            // The writer was killed before it could rename the file.
            None => return place(output),
        },
        // The writer was killed before it had written a chunk.
        Err(ReadError::Empty { .. } | ReadError::NothingLeft { .. }) => (None, None),
        Err(error) => return Err(error.into()),
    };
    let closed = copy(file, output.part(), reason);
    match (closed, end) {
        (Err(LogWriteError::NoRoom(_) | LogWriteError::TooLarge(_)), Some(end)) => {
            close_in_place(output.part(), end, reason)?
        }
        // As long as the file is locked, no other program removes it.
        (closed, _) => output.set_file(closed?),
    }
    place(output)
}

fn place(output: OutputFile) -> Result<Option<PathBuf>, CloseError> {
    Ok(Some(output.put_in_free_place().map_err(LogWriteError::from)?))
}

/// The end of the last whole record of a truncated log.
fn end_of_records(damage: &Damage) -> Option<u64> {
    match damage {
        Damage::NoEnd { position } => u64::try_from(*position).ok(),
        _ => None,
    }
}

/// Appends the end of a log without an index (MCAP specification: metadata, data end, footer, magic) after its last
/// whole record. A partial record there is overwritten.
fn close_in_place(path: &Path, end: u64, reason: &str) -> Result<(), LogWriteError> {
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
    write().map_err(|error| LogWriteError::from_io(path, error))
}

fn push_text(bytes: &mut Vec<u8>, text: &str) {
    push_length(bytes, text.len());
    bytes.extend(text.as_bytes());
}

fn push_length(bytes: &mut Vec<u8>, length: usize) {
    bytes.extend(u32::try_from(length).unwrap_or(u32::MAX).to_le_bytes());
}

/// Rewrites the readable part of a log in its place. Returns the file, locked.
fn copy(file: Option<LogFile>, path: &Path, reason: &str) -> Result<File, LogWriteError> {
    let mut log = LogWriter::create(path, LogOptions::default())?;
    // A partial copy is of no use, and may fill a full disk.
    log.keep(false);
    rewrite(&mut LogReader::new(file.into_iter().collect()), &mut log)?;
    Ok(log.end(Outcome::Incomplete(reason))?.put_in_place()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::Channel;
    use mcap::records::MessageHeader;

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

    /// The partial file beside the log while it is written.
    fn part(path: &Path) -> PathBuf {
        path.with_extension("mcap.part")
    }

    #[test]
    fn a_partial_log_is_closed_with_the_reason() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        write(&path, 100);
        assert_eq!(close_log(&path, "nothing").unwrap(), None, "it is closed");
        let whole = fs::read(&path).unwrap();
        for length in [0, 5, 8, 30, whole.len() / 2, whole.len() - 20] {
            fs::remove_file(&path).unwrap();
            fs::write(part(&path), &whole[..length]).unwrap();
            let expected = LogFile::open(part(&path)).map_or(0, |file| {
                let mut reader = LogReader::new(vec![file]);
                std::iter::from_fn(|| reader.next_message().map(|message| message.log_time)).count()
            });
            assert_eq!(close_log(&path, "it was killed").unwrap(), Some(path.clone()), "{length}");
            let bytes = fs::read(&path).unwrap();
            let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).count();
            assert_eq!(messages, expected, "{length}");
            let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
            let record = mcap::read::metadata(&bytes, &summary.metadata_indexes[0]).unwrap();
            assert_eq!(record.metadata["reason"], "it was killed");
            assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "no other file is left");
        }
    }

    #[test]
    fn the_log_of_a_living_writer_is_not_touched() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        let log = LogWriter::create(&path, LogOptions::default()).unwrap();
        let error = close_log(&path, "it was killed").unwrap_err().to_string();
        assert!(error.contains(&format!("is being written by process {}", std::process::id())), "{error}");
        log.finish(Outcome::Complete).unwrap();
        let whole = fs::read(&path).unwrap();
        assert_eq!(close_log(&path, "it was killed").unwrap(), None);
        assert!(fs::read(&path).unwrap() == whole);
    }

    #[test]
    fn a_partial_log_of_a_killed_writer_does_not_replace_an_earlier_log() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        write(&path, 100);
        let whole = fs::read(&path).unwrap();
        fs::write(part(&path), &whole[..whole.len() / 2]).unwrap();
        assert_eq!(close_log(&path, "it was killed").unwrap(), Some(part(&path).canonicalize().unwrap()));
        assert!(fs::read(&path).unwrap() == whole);
        let closed = LogFile::open(part(&path)).unwrap();
        assert_eq!(closed.damage(), [Damage::Incomplete { reason: "it was killed".into() }]);
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
    fn a_part_that_is_not_a_log_is_not_changed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        fs::write(part(&path), "this is no log").unwrap();
        assert!(matches!(close_log(&path, "x"), Err(CloseError::Read(_))));
        assert_eq!(fs::read(part(&path)).unwrap(), b"this is no log");
    }
}
