//! Tests of the reader as a whole.

mod conformance;
mod damaged;
mod errors;
mod order;

use super::*;
use crate::test_log::{Folder, TestLog, layouts};
use std::path::Path;

/// A message from the reader: file, topic, log time and bytes.
type ReadMessage = (usize, String, u64, Vec<u8>);

/// All messages, and all reported damage.
fn read_all(mut reader: LogReader) -> (Vec<ReadMessage>, Vec<Damage>) {
    let files = reader.files().clone();
    let mut damage: Vec<_> = files.iter().flat_map(|file| file.damage().to_vec()).collect();
    let mut seen = Vec::new();
    while let Some(message) = reader.next_message() {
        let topic = files[message.file].channel(message.channel).map(|channel| channel.topic).unwrap_or_default();
        seen.push((message.file, topic, message.log_time.0, message.data.to_vec()));
    }
    damage.extend(reader.take_damage().into_iter().map(|(_, damage)| damage));
    (seen, damage)
}

/// A message from the reader of one file: topic, log time and bytes.
type MessageInFile = (String, u64, Vec<u8>);

/// All messages of a file, and all reported damage.
pub(crate) fn read_file(path: &Path) -> Result<(Vec<MessageInFile>, Vec<Damage>), ReadError> {
    let (seen, damage) = read_all(LogReader::new(vec![LogFile::open(path)?]));
    Ok((seen.into_iter().map(|(_, topic, time, data)| (topic, time, data)).collect(), damage))
}

/// Three chunks of a few messages each.
fn three_chunks(options: mcap::WriteOptions) -> Vec<u8> {
    let mut log = TestLog::new(options);
    for chunk in 0..3 {
        for message in 0..4 {
            let time = 10 * chunk + message;
            log.raw("/a", "p/msg/A", time, &[time as u8; 40]);
        }
        log.flush();
    }
    log.finish()
}

fn times(seen: &[ReadMessage]) -> Vec<u64> {
    seen.iter().map(|(_, _, time, _)| *time).collect()
}
