//! The summary at the end of a file that was closed: its channels again, and where its chunks begin.

use super::definitions::Definitions;
use super::record::{Fields, HEAD, record_at};
use mcap::MAGIC;
use mcap::records::op;

/// The footer's body: two offsets and a checksum.
const FOOTER: usize = 20;

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
}

impl SummarySection {
    /// Reads the summary of a whole file; of a file without one, nothing.
    pub(crate) fn read(file: &[u8]) -> Self {
        let mut summary = Self::default();
        let Some(content) = file.strip_suffix(MAGIC) else { return summary };
        let Some(footer_start) = content.len().checked_sub(HEAD + FOOTER) else { return summary };
        let Some(footer) = record_at(content, footer_start).filter(|record| record.opcode == op::FOOTER) else {
            return summary;
        };
        summary.closed = true;
        let mut fields = Fields(footer.body);
        let (Some(start), Some(_), Some(checksum)) = (fields.u64(), fields.u64(), fields.u32()) else { return summary };
        let Ok(start) = usize::try_from(start) else { return summary };
        if start < MAGIC.len() || start > footer_start {
            return summary;
        }
        // The checksum covers the summary and the footer up to the checksum itself.
        if checksum != 0 && crc32fast::hash(&content[start..content.len() - 4]) != checksum {
            summary.bad_checksum = true;
            return summary;
        }
        summary.read_records(&content[..footer_start], start);
        summary
    }

    fn read_records(&mut self, bytes: &[u8], start: usize) {
        let mut channel_count = None;
        let mut position = start;
        while let Some(record) = record_at(bytes, position) {
            position = record.end();
            match record.opcode {
                op::SCHEMA | op::CHANNEL => self.definitions.read(&record),
                op::STATISTICS => channel_count = read_channel_count(record.body),
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

/// Where the chunk of an index record begins: behind its two times.
fn read_chunk_start(body: &[u8]) -> Option<usize> {
    let mut fields = Fields(body);
    fields.bytes(8 + 8)?;
    usize::try_from(fields.u64()?).ok()
}
