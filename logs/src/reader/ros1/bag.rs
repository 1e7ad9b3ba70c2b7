//! A ROS 1 bag: its connections and chunks.

use super::record::{BAG, CHUNK, CONNECTION, Header, INDEX, MESSAGE, record_at, record_in, time};
use super::{DEFINITION, LATCHING, MAGIC, MESSAGES};
use crate::reader::block::{Block, Records};
use crate::reader::bytes::{FileBytes, Window};
use crate::reader::chunk::{decompress_bz2, decompress_lz4};
use crate::reader::damage::{ChunkFault, Damage, LARGEST};
use crate::reader::definitions::{MOST_BYTES, MOST_CHANNELS};
use crate::reader::expansion::drop_excess;
use crate::reader::layout::Layout;
use crate::reader::record::{Fields, push_message};
use gridweave_runtime::message::Channel;
use std::collections::BTreeMap;
use std::ops::Range;

/// A ROS 1 bag.
#[derive(Debug)]
pub(crate) struct Bag {
    pub(crate) file: FileBytes,
    /// The numbers of the channels by those of the connections in the bag.
    connections: BTreeMap<u32, u16>,
}

/// A chunk of a bag.
#[derive(Clone, Debug)]
pub(crate) struct BagChunk {
    compression: String,
    /// The uncompressed size of its contents, bytes.
    pub(crate) size: u64,
    /// The location of its contents in the file.
    data: Range<usize>,
}

impl Bag {
    /// Opens the bag in a file and determines its layout.
    pub(crate) fn open(file: FileBytes) -> (Self, Layout) {
        let mut walk = Walk { layout: Layout::default(), connections: BTreeMap::new(), unsure: Vec::new() };
        walk.walk(&file);
        let excess: Vec<Damage> = drop_excess(&mut walk.layout.blocks, file.len()).collect();
        walk.survey(&file);
        walk.layout.damage.extend(excess);
        let Walk { layout, connections, .. } = walk;
        (Self { file, connections }, layout)
    }
}

/// The scan of a bag's records.
struct Walk {
    layout: Layout,
    connections: BTreeMap<u32, u16>,
    /// For each block, whether its time span is unknown.
    unsure: Vec<bool>,
}

impl Walk {
    fn walk(&mut self, file: &FileBytes) {
        let mut window = Window::new(file);
        let mut position = MAGIC.len();
        let mut is_closed = false;
        while position < file.len() {
            let record = record_in(&mut window, position).filter(|(_, data)| data.end <= file.len());
            let Some((header, data)) = record else {
                self.layout.damage.push(Damage::NoEnd { position });
                return;
            };
            position = data.end;
            let Some(header) = Header::parse(&header) else {
                self.layout.damage.push(Damage::Unreadable { position: data.start, length: data.len() });
                continue;
            };
            match header.opcode() {
                // The position of the index is written when the bag is closed.
                Some(BAG) => {
                    is_closed = header.bytes("index_pos").is_some_and(|place| place.iter().any(|byte| *byte != 0))
                }
                Some(CHUNK) => self.chunk(&header, data),
                Some(INDEX) => self.index(&header, &file.read(data).unwrap_or_default()),
                Some(CONNECTION) => self.connection(&header, &file.read(data).unwrap_or_default()),
                _ => {}
            }
        }
        if !is_closed {
            self.layout.damage.push(Damage::NoEnd { position });
        }
    }

    fn chunk(&mut self, header: &Header<'_>, data: Range<usize>) {
        let compression = header.text("compression").unwrap_or_default();
        let size = u64::from(header.u32("size").unwrap_or(0));
        self.layout.chunks += 1;
        self.layout.compressions.insert(if compression == "none" { String::new() } else { compression.clone() });
        let records = Records::Ros1(BagChunk { compression, size, data });
        self.layout.blocks.push(Block { first_time: u64::MAX, last_time: 0, records });
        self.unsure.push(true);
    }

    /// Reads the message times of one connection in the last chunk.
    fn index(&mut self, header: &Header<'_>, data: &[u8]) {
        let (Some(block), Some(unsure)) = (self.layout.blocks.last_mut(), self.unsure.last_mut()) else { return };
        if header.u32("ver") != Some(1) {
            return;
        }
        let mut fields = Fields(data);
        while let (Some(time), Some(_)) = (time(&mut fields), fields.u32()) {
            block.first_time = block.first_time.min(time);
            block.last_time = block.last_time.max(time);
            *unsure = false;
        }
    }

    fn connection(&mut self, header: &Header<'_>, data: &[u8]) {
        let (Some(number), Some(data_header)) = (header.u32("conn"), Header::parse(data)) else { return };
        if self.connections.contains_key(&number) || self.connections.len() >= MOST_CHANNELS {
            return;
        }
        // Checked above.
        let Ok(channel) = u16::try_from(self.connections.len() + 1) else { return };
        self.connections.insert(number, channel);
        // Its texts are copied only if they may fit.
        if data.len() > MOST_BYTES {
            self.layout.definitions.refuse(channel);
            return;
        }
        let latching = data_header.text("latching").unwrap_or_default();
        let description = Channel {
            topic: header.text("topic").or_else(|| data_header.text("topic")).unwrap_or_default(),
            message_encoding: MESSAGES.to_owned(),
            schema_name: data_header.text("type").unwrap_or_default(),
            schema_encoding: DEFINITION.to_owned(),
            schema: data_header.bytes("message_definition").unwrap_or_default().to_vec(),
            metadata: BTreeMap::from([(LATCHING.to_owned(), latching)]),
        };
        self.layout.definitions.insert(channel, description);
    }

    /// Scans chunks whose time span is unknown, or all chunks if some may contain connections that are described
    /// nowhere else.
    fn survey(&mut self, file: &FileBytes) {
        let is_whole = self.layout.damage.is_empty();
        let blocks = std::mem::take(&mut self.layout.blocks);
        for (mut block, unsure) in blocks.into_iter().zip(std::mem::take(&mut self.unsure)) {
            if is_whole && !unsure {
                self.layout.blocks.push(block);
                continue;
            }
            let Records::Ros1(chunk) = &block.records else { continue };
            let contents = match chunk.contents(file) {
                Ok(contents) => contents,
                Err(fault) => {
                    self.layout.damage.push(Damage::BadChunk { fault });
                    continue;
                }
            };
            let mut position = 0;
            while let Some((header, data, end)) = record_at(&contents, position) {
                position = end;
                match header.opcode() {
                    Some(CONNECTION) => self.connection(&header, data),
                    Some(MESSAGE) => {
                        let Some(time) = header.time("time") else { continue };
                        block.first_time = block.first_time.min(time);
                        block.last_time = block.last_time.max(time);
                    }
                    _ => {}
                }
            }
            // A chunk without messages is dropped.
            if block.first_time <= block.last_time {
                self.layout.blocks.push(block);
            }
        }
    }
}

impl BagChunk {
    /// The decompressed records of the chunk.
    fn contents(&self, file: &FileBytes) -> Result<Vec<u8>, ChunkFault> {
        let most = self.size.max(self.data.len() as u64);
        if most > LARGEST {
            return Err(ChunkFault::TooMuch { size: most });
        }
        let data = file.read(self.data.clone()).ok_or(ChunkFault::Records)?;
        let contents = match self.compression.as_str() {
            "none" => data,
            "lz4" => decompress_lz4(&data, self.size, Vec::new())?,
            "bz2" => decompress_bz2(&data, self.size)?,
            other => return Err(ChunkFault::UnknownCompression(other.to_owned())),
        };
        match contents.len() as u64 == self.size {
            true => Ok(contents),
            false => Err(ChunkFault::Decompression),
        }
    }

    /// The messages of the chunk as MCAP records; and the number of unreadable ones.
    pub(crate) fn messages(&self, bag: &Bag) -> Result<(Vec<u8>, u64), ChunkFault> {
        let contents = self.contents(&bag.file)?;
        let (mut records, mut lost) = (Vec::with_capacity(contents.len()), 0);
        let (mut position, mut sequence) = (0, 0_u32);
        while let Some((header, data, end)) = record_at(&contents, position) {
            position = end;
            if header.opcode() != Some(MESSAGE) {
                continue;
            }
            let (Some(number), Some(time)) = (header.u32("conn"), header.time("time")) else {
                lost += 1;
                continue;
            };
            sequence = sequence.wrapping_add(1);
            let channel = bag.connections.get(&number).copied().unwrap_or(0);
            push_message(&mut records, channel, sequence, time, time, data);
        }
        if position != contents.len() {
            lost += 1;
        }
        Ok((records, lost))
    }
}
