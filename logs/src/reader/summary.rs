//! The summary at the end of a file that was closed: its channels again, and where its chunks begin.

use super::bytes::FileBytes;
use super::definitions::Definitions;
use super::record::{Fields, HEAD, record_at};
use mcap::MAGIC;
use mcap::records::op;
use std::collections::BTreeMap;

/// The footer's body: two offsets and a checksum.
const FOOTER: usize = 20;
/// A longer summary is not used: it would index millions of chunks.
const LARGEST: usize = 256 << 20;

/// What stands behind the messages of a file.
#[derive(Debug, Default)]
pub(crate) struct SummarySection {
    /// Whether the file ends as a file that was closed does.
    pub(crate) closed: bool,
    /// Whether the summary is there and its checksum is wrong.
    pub(crate) bad_checksum: bool,
    /// The channels it describes.
    pub(crate) definitions: Definitions,
    /// Whether `definitions` are known to be all.
    pub(crate) definitions_complete: bool,
    /// Where the chunks begin, rising.
    pub(crate) chunk_starts: Vec<usize>,
    pub(crate) statistics: Option<Statistics>,
}

/// What a file says of its messages.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Statistics {
    /// How many there are.
    pub messages: u64,
    /// The log time of the first, nanoseconds.
    pub first: u64,
    /// The log time of the last, nanoseconds.
    pub last: u64,
    /// How many there are on each channel, by its number.
    pub by_channel: BTreeMap<u16, u64>,
}

impl SummarySection {
    /// Reads the summary of a whole file; of a file without one, nothing.
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
        // The checksum covers the summary and the footer up to the checksum itself.
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

/// The number of channels in a record of statistics: behind the counts of messages and of schemas.
fn read_channel_count(body: &[u8]) -> Option<usize> {
    let mut fields = Fields(body);
    fields.bytes(8 + 2)?;
    usize::try_from(fields.u32()?).ok()
}

fn read_statistics(body: &[u8]) -> Option<Statistics> {
    let mut fields = Fields(body);
    let messages = fields.u64()?;
    // The numbers of schemas, channels, attachments, metadata records and chunks.
    fields.bytes(2 + 4 * 4)?;
    let (first, last) = (fields.u64()?, fields.u64()?);
    let (mut counts, mut by_channel) = (fields.block()?, BTreeMap::new());
    while let (Some(channel), Some(count)) = (counts.u16(), counts.u64()) {
        by_channel.insert(channel, count);
    }
    Some(Statistics { messages, first, last, by_channel })
}

/// Where the chunk of an index record begins: behind its two times.
fn read_chunk_start(body: &[u8]) -> Option<usize> {
    let mut fields = Fields(body);
    fields.bytes(8 + 8)?;
    usize::try_from(fields.u64()?).ok()
}
