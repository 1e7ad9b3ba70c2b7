//! Rewriting the readable part of damaged logs.

use super::{LogOptions, LogWriteError, LogWriter, Outcome};
use crate::reader::{Damage, LogFile, LogReader, ReadError, SupplementKind, log_files};
use crate::reader::{OUTCOME_RECORD, read_attachment, read_metadata};
use gridweave_runtime::message::LogTime;
use mcap::records::MessageHeader;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The result of recovering a log.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recovery {
    /// The number of messages that were read.
    pub messages: u64,
    /// The topics of these.
    pub topics: BTreeSet<String>,
    /// The log times of the first and the last message.
    pub times: Option<(LogTime, LogTime)>,
    /// Descriptions of the damage, with the number of times each occurred.
    pub losses: BTreeMap<String, u64>,
}

/// The error when a log cannot be recovered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecoverError {
    /// Nothing can be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The output cannot be written.
    #[error(transparent)]
    Write(#[from] LogWriteError),
}

/// Writes everything that can be read of the log at `input`, a log file of any kind or the folder of a bag, to
/// `output`: messages, attachments and metadata records, under their logged names and numbers.
///
/// # Errors
/// Nothing can be read, or the output cannot be written.
pub fn recover(input: &Path, output: &Path) -> Result<Recovery, RecoverError> {
    let mut losses: BTreeMap<String, u64> = BTreeMap::new();
    let mut files = Vec::new();
    let mut failure = None;
    for (_, path) in log_files(&[input.to_owned()])? {
        match LogFile::open(path) {
            Ok(file) => files.push(file),
            // The other files of a bag may be readable.
            Err(error) => {
                *losses.entry(error.to_string()).or_default() += 1;
                failure = Some(error);
            }
        }
    }
    if let Some(failure) = failure.filter(|_| files.is_empty()) {
        return Err(failure.into());
    }
    let mut log = LogWriter::create(output, LogOptions::default())?;
    log.keep(false);
    let ended_early = files.iter().flat_map(LogFile::damage).find_map(|damage| match damage {
        Damage::Incomplete { reason } => Some(reason.clone()),
        _ => None,
    });
    let mut reader = LogReader::new(files);
    let recovery = rewrite(&mut reader, &mut log)?;
    losses.extend(recovery.losses);
    match ended_early {
        Some(reason) => log.end(Outcome::Incomplete(&reason))?.put_in_place().map(drop),
        None => log.end(Outcome::Complete)?.put_in_place().map(drop),
    }
    .map_err(LogWriteError::from)?;
    Ok(Recovery { losses, ..recovery })
}

/// Writes everything that a reader returns, except the records of how the runs ended.
pub(super) fn rewrite(reader: &mut LogReader, log: &mut LogWriter) -> Result<Recovery, LogWriteError> {
    let files = std::sync::Arc::clone(reader.files());
    let mut recovery = Recovery::default();
    let lose = |recovery: &mut Recovery, file: usize, damage: &Damage| {
        let path = files.get(file).map(|file| file.path().display().to_string()).unwrap_or_default();
        *recovery.losses.entry(format!("{path}: {damage}")).or_default() += 1;
    };
    for (number, file) in files.iter().enumerate() {
        file.damage().iter().for_each(|damage| lose(&mut recovery, number, damage));
        for (kind, body) in file.supplements() {
            if !write_supplement(log, kind, &body.unwrap_or_default())? {
                lose(&mut recovery, number, &Damage::BadAttachment);
            }
        }
    }
    let mut numbers: BTreeMap<(usize, u16), Option<u16>> = BTreeMap::new();
    while let Some(message) = reader.next_message() {
        let number = match numbers.get(&(message.file, message.channel)) {
            Some(number) => *number,
            None => {
                let channel = files.get(message.file).and_then(|file| file.channel(message.channel));
                let number = channel.as_ref().map(|channel| log.channel(channel)).transpose()?;
                numbers.insert((message.file, message.channel), number);
                recovery.topics.extend(channel.map(|channel| channel.topic));
                number
            }
        };
        let Some(channel_id) = number else {
            lose(&mut recovery, message.file, &Damage::UnknownChannel { channel: message.channel });
            continue;
        };
        let header = MessageHeader {
            channel_id,
            sequence: message.sequence,
            log_time: message.log_time.0,
            publish_time: message.publish_time,
        };
        log.write(&header, message.data)?;
        recovery.messages += 1;
        let first = recovery.times.map_or(message.log_time, |(first, _)| first);
        recovery.times = Some((first, message.log_time));
    }
    reader.take_damage().iter().for_each(|(file, damage)| lose(&mut recovery, *file, damage));
    Ok(recovery)
}

/// Writes an attachment or metadata record unchanged; `false` if it is damaged.
///
/// # Errors
/// The log cannot be written.
pub fn write_supplement(log: &mut LogWriter, kind: SupplementKind, body: &[u8]) -> Result<bool, LogWriteError> {
    match kind {
        SupplementKind::Attachment => match read_attachment(body) {
            Some(attachment) => log.attachment(&attachment).map(|()| true),
            None => Ok(false),
        },
        SupplementKind::Metadata => match read_metadata(body).filter(|(name, _)| name != OUTCOME_RECORD) {
            Some((name, metadata)) => log.metadata(&name, metadata).map(|()| true),
            None => Ok(true),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::Channel;
    use std::fs;

    fn write(path: &Path, messages: u32) {
        let mut log = LogWriter::create(path, LogOptions { chunk_size: 1000, ..Default::default() }).unwrap();
        log.metadata("drive", BTreeMap::from([("weather".to_owned(), "rain".to_owned())])).unwrap();
        let channel = Channel { topic: "/a".into(), message_encoding: "cdr".into(), ..Default::default() };
        let channel_id = log.channel(&channel).unwrap();
        for sequence in 0..messages {
            let time = 5 + u64::from(sequence);
            log.write(&MessageHeader { channel_id, sequence, log_time: time, publish_time: time }, &[7; 90]).unwrap();
        }
        log.finish(Outcome::Complete).unwrap();
    }

    #[test]
    fn the_readable_part_of_a_log_is_written_and_losses_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let [input, output] = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name));
        write(&input, 100);
        let whole = recover(&input, &output).unwrap();
        assert_eq!((whole.messages, whole.times, whole.losses.len()), (100, Some((LogTime(5), LogTime(104))), 0));
        let mut bytes = fs::read(&input).unwrap();
        bytes.truncate(bytes.len() / 2);
        fs::write(&input, &bytes).unwrap();
        let cut = recover(&input, &output).unwrap();
        assert!((20..100).contains(&cut.messages) && cut.topics.contains("/a"), "{cut:?}");
        assert!(cut.losses.keys().any(|loss| loss.contains("a.mcap: the file has no end")), "{cut:?}");
        let file = LogFile::open(&output).unwrap();
        assert!(file.damage().is_empty() && file.metadata("drive").is_some());
        assert_eq!(file.statistics().unwrap().messages, cut.messages);
    }

    #[test]
    fn the_readable_files_of_a_bag_are_recovered() {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("out.mcap");
        let bag = folder.path().join("bag");
        fs::create_dir(&bag).unwrap();
        fs::write(bag.join("bag_1.mcap"), "").unwrap();
        assert!(matches!(recover(&bag, &output), Err(RecoverError::Read(ReadError::Empty { .. }))));
        assert!(!output.exists());
        write(&bag.join("bag_0.mcap"), 10);
        let recovery = recover(&bag, &output).unwrap();
        assert_eq!(recovery.messages, 10);
        assert!(recovery.losses.keys().any(|loss| loss.contains("bag_1.mcap")), "{recovery:?}");
    }
}
