//! The layout of a file: its blocks, found by scanning its records without reading their contents.

use super::block::{Block, Records, Survey};
use super::bytes::{FileBytes, Window};
use super::chunk::Chunk;
use super::damage::{ChunkFault, Damage, LARGEST, MOST_REPORTS};
use super::definitions::Definitions;
use super::expansion::drop_excess;
use super::record::{Fields, HEAD, MessageRecord, Record};
use super::summary::{FileStatistics, SummarySection};
use super::supplement::{SupplementKind, damage_of, read_metadata};
use mcap::MAGIC;
use mcap::records::op;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// The approximate length of a block of records outside of chunks, bytes.
const RUN_LENGTH: usize = 1 << 20;

/// The layout of a file.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    /// The blocks that contain messages, by position.
    pub(crate) blocks: Vec<Block>,
    pub(crate) definitions: Definitions,
    pub(crate) damage: Vec<Damage>,
    /// The entries of the metadata records, by name; the last of those with the same name.
    pub(crate) metadata: BTreeMap<String, BTreeMap<String, String>>,
    /// The locations of the bodies of attachments and metadata records, in file order.
    pub(crate) supplements: Vec<(SupplementKind, Range<usize>)>,
    /// The message indexes after the chunks, by channel.
    pub(crate) index: BTreeMap<u16, IndexedChannel>,
    /// The statistics of the file, if it was closed.
    pub(crate) statistics: Option<FileStatistics>,
    /// The number of chunks, including bad ones.
    pub(crate) chunks: usize,
    /// The compressions of the chunks; an empty string for none.
    pub(crate) compressions: BTreeSet<String>,
}

impl Layout {
    /// Finds the blocks of `file`, which starts with the magic bytes.
    pub(crate) fn of(file: &FileBytes) -> Self {
        let summary = SummarySection::read(file);
        let mut walk = Walk { layout: Self::default(), unsure: Vec::new(), run: None };
        walk.data_section(&mut Window::new(file), &summary);
        let Walk { mut layout, mut unsure, .. } = walk;
        if summary.bad_checksum {
            layout.damage.push(Damage::BadIndex);
        }
        if !summary.definitions_complete {
            // A chunk may describe channels that are described nowhere else.
            unsure = layout.blocks.iter().map(|block| matches!(block.records, Records::Chunk(_))).collect();
        }
        let excess = drop_excess(&mut layout.blocks, file.len());
        layout.damage.extend(excess);
        layout.definitions.merge(summary.definitions);
        layout.statistics = summary.statistics;
        layout.survey(file, &unsure);
        let redefined = layout.definitions.redefined.min(MOST_REPORTS);
        layout.damage.extend(std::iter::repeat_n(Damage::Redefined, redefined));
        layout
    }

    /// Scans the unsure blocks for their time spans and channels.
    fn survey(&mut self, file: &FileBytes, unsure: &[bool]) {
        let blocks: Vec<_> = std::mem::take(&mut self.blocks).into_iter().zip(unsure.iter().copied()).collect();
        let mut rest = blocks.as_slice();
        // The number of each block among those that are kept.
        let mut numbers = Vec::with_capacity(blocks.len());
        while !rest.is_empty() {
            let (batch, later) = rest.split_at(surveyed_together(rest));
            rest = later;
            let surveys: Vec<_> = batch.par_iter().map(|(block, unsure)| unsure.then(|| block.survey(file))).collect();
            for ((block, _), survey) in batch.iter().zip(surveys) {
                let number = self.blocks.len();
                self.add_surveyed(block.clone(), survey);
                numbers.push((self.blocks.len() > number).then_some(number));
            }
        }
        for channel in self.index.values_mut() {
            channel.blocks = channel.blocks.iter().filter_map(|block| *numbers.get(*block)?).collect();
        }
    }

    /// Adds a block with what a scan of it has found, if it was scanned.
    fn add_surveyed(&mut self, mut block: Block, survey: Option<Result<Survey, ChunkFault>>) {
        match survey {
            None => self.blocks.push(block),
            Some(Err(fault)) => self.damage.push(Damage::BadChunk { fault }),
            Some(Ok(survey)) => {
                self.definitions.merge(survey.definitions);
                if let Some((first, last)) = survey.times {
                    (block.first_time, block.last_time) = (first, last);
                    self.blocks.push(block);
                }
            }
        }
    }
}

/// The number of blocks at the beginning that are scanned concurrently, at least one: they are in memory together.
fn surveyed_together(blocks: &[(Block, bool)]) -> usize {
    let mut size = 0_u64;
    let fits = |(block, unsure): &&(Block, bool)| {
        size = size.saturating_add(if *unsure { block.most_memory() } else { 0 });
        size <= LARGEST / 4
    };
    blocks.iter().take_while(fits).count().max(1)
}

/// The scan of a file's records.
struct Walk {
    layout: Layout,
    /// For each block, whether its claimed time span is unverified.
    unsure: Vec<bool>,
    /// The current run of records outside of chunks.
    run: Option<Block>,
}

impl Walk {
    fn data_section(&mut self, file: &mut Window<'_>, summary: &SummarySection) {
        let mut index = ChunkTimes::default();
        let mut position = MAGIC.len();
        loop {
            let record =
                file.record(position).map(|record| (record.opcode, record.end(), self.take(&record, &mut index)));
            match record.filter(|(_, end, taken)| taken.unwrap_or_else(|| is_record(file, *end))) {
                Some((op::DATA_END | op::FOOTER, ..)) => break,
                Some((_, end, _)) => position = end,
                None => {
                    // Reading resumes at the next chunk that the summary lists.
                    let next = summary.chunk_starts.partition_point(|&start| start <= position);
                    let Some(&next) = summary.chunk_starts.get(next).filter(|&&next| next < file.file_length()) else {
                        self.cut_chunk(file, position);
                        self.layout.damage.push(Damage::NoEnd { position });
                        break;
                    };
                    self.layout.damage.push(Damage::Unreadable { position, length: next - position });
                    position = next;
                }
            }
        }
        self.end_run();
        self.settle(&mut index);
        let ended = matches!(self.layout.damage.last(), Some(Damage::NoEnd { .. }));
        if !summary.closed && !ended {
            self.layout.damage.push(Damage::NoEnd { position });
        }
    }

    /// Adds a record. Returns `Some(false)` if it cannot be one, and `None` if it is one only where another follows.
    fn take(&mut self, record: &Record<'_>, index: &mut ChunkTimes) -> Option<bool> {
        if let Some(kind) = SupplementKind::of_opcode(record.opcode) {
            self.layout.supplements.push((kind, record.position + HEAD..record.end()));
        }
        match record.opcode {
            0 => return Some(false),
            op::MESSAGE => match MessageRecord::parse(record.body) {
                Some(message) => self.extend_run(record, message.log_time),
                None => return Some(false),
            },
            op::SCHEMA | op::CHANNEL => self.layout.definitions.read(record),
            op::CHUNK => {
                self.end_run();
                self.settle(index);
                match Chunk::parse(record) {
                    Some(chunk) => self.push_chunk(chunk),
                    None => {
                        self.layout.damage.push(Damage::BadChunk { fault: ChunkFault::Records });
                        // If the lengths are inconsistent, the record's is right if another record follows.
                        return None;
                    }
                }
            }
            op::MESSAGE_INDEX => {
                index.read(record.body, self.layout.blocks.len().saturating_sub(1), &mut self.layout.index)
            }
            op::METADATA => {
                if let Some((name, metadata)) = read_metadata(record.body) {
                    self.layout.damage.extend(damage_of(&name, &metadata));
                    self.layout.metadata.insert(name, metadata);
                }
            }
            _ => {}
        }
        Some(true)
    }

    fn extend_run(&mut self, record: &Record<'_>, time: u64) {
        let run = self.run.get_or_insert(Block {
            first_time: time,
            last_time: time,
            records: Records::Bare(record.position..record.position),
        });
        run.first_time = run.first_time.min(time);
        run.last_time = run.last_time.max(time);
        let Records::Bare(range) = &mut run.records else { return };
        range.end = record.end();
        if range.len() >= RUN_LENGTH {
            self.end_run();
        }
    }

    fn end_run(&mut self) {
        if let Some(run) = self.run.take() {
            self.layout.blocks.push(run);
            self.unsure.push(false);
        }
    }

    fn push_chunk(&mut self, chunk: Chunk) {
        self.layout.chunks += 1;
        self.layout.compressions.insert(chunk.compression.clone());
        let (first_time, last_time) = (chunk.first_time, chunk.last_time);
        self.layout.blocks.push(Block { first_time, last_time, records: Records::Chunk(chunk) });
        self.unsure.push(true);
    }

    /// A chunk truncated by the end of the file, as left by a killed recorder.
    fn cut_chunk(&mut self, file: &mut Window<'_>, position: usize) {
        if file.bytes(position, 1) == Some(&[op::CHUNK])
            && let Some(chunk) = Chunk::parse_cut(file, position)
        {
            self.end_run();
            self.push_chunk(chunk);
        }
    }

    /// Marks the last chunk's header as verified if the index records after it match.
    fn settle(&mut self, index: &mut ChunkTimes) {
        let times = std::mem::take(index).0;
        if let (Some(block), Some(unsure)) = (self.layout.blocks.last(), self.unsure.last_mut())
            && matches!(&block.records, Records::Chunk(chunk) if !chunk.cut)
        {
            *unsure = times != Some((block.first_time, block.last_time));
        }
    }
}

/// Whether there may be a record at `position`.
fn is_record(file: &mut Window<'_>, position: usize) -> bool {
    file.record(position).is_some_and(|record| record.opcode != 0)
}

/// The index records of one channel of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct IndexedChannel {
    /// The blocks with messages of the channel.
    pub(crate) blocks: Vec<usize>,
    /// The number of messages.
    pub(crate) messages: u64,
    /// The log time of the first, nanoseconds.
    pub(crate) first: u64,
    /// The log time of the last, nanoseconds.
    pub(crate) last: u64,
    /// The longest time between two consecutive messages, nanoseconds.
    pub(crate) largest_gap: u64,
}

impl IndexedChannel {
    fn add(&mut self, time: u64) {
        if self.messages == 0 {
            (self.first, self.last) = (time, time);
        }
        self.messages += 1;
        self.largest_gap = self.largest_gap.max(time.saturating_sub(self.last));
        (self.first, self.last) = (self.first.min(time), self.last.max(time));
    }
}

/// The least and the greatest log time in the index records after a chunk.
#[derive(Default)]
struct ChunkTimes(Option<(u64, u64)>);

impl ChunkTimes {
    fn read(&mut self, body: &[u8], block: usize, channels: &mut BTreeMap<u16, IndexedChannel>) {
        let mut fields = Fields(body);
        let Some((number, mut entries)) = fields.u16().and_then(|number| Some((number, fields.block()?))) else {
            return;
        };
        let channel = channels.entry(number).or_default();
        if channel.blocks.last() != Some(&block) {
            channel.blocks.push(block);
        }
        while let (Some(time), Some(_)) = (entries.u64(), entries.u64()) {
            channel.add(time);
            let (first, last) = self.0.unwrap_or((time, time));
            self.0 = Some((first.min(time), last.max(time)));
        }
    }
}
