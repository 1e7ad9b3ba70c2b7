//! The summary section at the end of a closed file: its channels again, and the positions of its chunks.

use super::bytes::FileBytes;
use super::definitions::Definitions;
use super::record::{Fields, HEAD, record_at};
use mcap::MAGIC;
use mcap::records::op;
use std::collections::BTreeMap;

/// The length of the footer's body: two offsets and a checksum.
const FOOTER: usize = 20;
/// The maximum length of a summary, bytes; a longer one would index millions of chunks.
const LARGEST: usize = 256 << 20;

/// The summary section of a file.
#[derive(Debug, Default)]
pub(crate) struct SummarySection {
    /// Whether the file ends with a footer.
    pub(crate) closed: bool,
    /// Whether the checksum of the summary is wrong.
    pub(crate) bad_checksum: bool,
    /// The channels in the summary.
    pub(crate) definitions: Definitions,
    /// Whether `definitions` is known to be complete.
    pub(crate) definitions_complete: bool,
    /// The positions of the chunks, ascending.
    pub(crate) chunk_starts: Vec<usize>,
    pub(crate) statistics: Option<FileStatistics>,
}

/// The statistics of a file's messages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileStatistics {
    /// The number of messages.
    pub messages: u64,
    /// The log time of the first, nanoseconds.
    pub first: u64,
    /// The log time of the last, nanoseconds.
    pub last: u64,
    /// The number of messages by channel.
    pub by_channel: BTreeMap<u16, u64>,
}

impl SummarySection {
    /// Reads the summary of a file; empty for a file without one.
    pub(crate) fn read(file: &FileBytes) -> Self {
        let mut summary = Self::default();
        let Some(footer_start) = file.len().checked_sub(HEAD + FOOTER + MAGIC.len()) else { return summary };
        let Some(end) = file.read(footer_start..file.len()) else { return summary };
        let Some(footer) = end.strip_suffix(MAGIC).and_then(|end| record_at(end, 0)) else { return summary };
        if footer.opcode != op::FOOTER || footer.length != FOOTER {
            return summary;
        }
        summary.closed = true;
        let mut fields = Fields(footer.body);
        let (Some(start), Some(_), Some(checksum)) = (fields.u64(), fields.u64(), fields.u32()) else { return summary };
        let Ok(start) = usize::try_from(start) else { return summary };
        if start < MAGIC.len() || start > footer_start || footer_start - start > LARGEST {
            return summary;
        }
        let Some(records) = file.read(start..footer_start) else { return summary };
        // The checksum covers the summary and the footer up to the checksum field.
        let mut hash = crc32fast::Hasher::new();
        hash.update(&records);
        hash.update(&end[..HEAD + FOOTER - 4]);
        if checksum != 0 && hash.finalize() != checksum {
            summary.bad_checksum = true;
            return summary;
        }
        summary.read_records(&records);
        summary
    }

    fn read_records(&mut self, bytes: &[u8]) {
        let mut channel_count = None;
        let mut position = 0;
        while let Some(record) = record_at(bytes, position) {
            position = record.end();
            match record.opcode {
                op::SCHEMA | op::CHANNEL => self.definitions.read(&record),
                op::STATISTICS => {
                    channel_count = read_channel_count(record.body);
                    self.statistics = read_statistics(record.body);
                }
                op::CHUNK_INDEX => self.chunk_starts.extend(read_chunk_start(record.body)),
                _ => {}
            }
        }
        self.chunk_starts.sort_unstable();
        self.definitions_complete =
            channel_count == Some(self.definitions.channel_count()) && self.definitions.schemas_complete();
    }
}

/// The number of channels in a statistics record: after the numbers of messages and of schemas.
fn read_channel_count(body: &[u8]) -> Option<usize> {
    let mut fields = Fields(body);
    fields.bytes(8 + 2)?;
    usize::try_from(fields.u32()?).ok()
}

fn read_statistics(body: &[u8]) -> Option<FileStatistics> {
    let mut fields = Fields(body);
    let messages = fields.u64()?;
    // The numbers of schemas, channels, attachments, metadata records and chunks.
    fields.bytes(2 + 4 * 4)?;
    let (first, last) = (fields.u64()?, fields.u64()?);
    let (mut counts, mut by_channel) = (fields.block()?, BTreeMap::new());
    while let (Some(channel), Some(count)) = (counts.u16(), counts.u64()) {
        by_channel.insert(channel, count);
    }
    Some(FileStatistics { messages, first, last, by_channel })
}

/// The position of the chunk in an index record: after its two times.
fn read_chunk_start(body: &[u8]) -> Option<usize> {
    let mut fields = Fields(body);
    fields.bytes(8 + 8)?;
    usize::try_from(fields.u64()?).ok()
}
