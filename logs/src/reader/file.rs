//! A log file: its bytes and its layout.

use super::bytes::FileBytes;
use super::compressed::{Decompressed, ZSTD_MAGIC, decompress_file};
use super::damage::Damage;
use super::error::ReadError;
use super::guess::looks_like;
use super::layout::{IndexedChannel, Layout};
use super::map;
use super::ros1::{self, Bag};
use super::sqlite::{self, Database};
use super::storage::Storage;
use super::summary::FileStatistics;
use super::supplement::SupplementKind;
use crate::map_file::Thresholds;
use gridweave_runtime::message::Channel;
use mcap::MAGIC;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The number of leading bytes that identify a file's type.
const HEAD: usize = 1 << 10;

/// A log file opened for reading: MCAP, a rosbag2 database or a ROS 1 bag, possibly compressed with zstd.
#[derive(Debug)]
pub struct LogFile {
    path: PathBuf,
    size: u64,
    is_compressed: bool,
    /// Whether it is a map file instead of a log.
    is_map: bool,
    /// The shift of its log times, nanoseconds.
    later: i64,
    /// Whether the index covers all messages.
    is_indexed: bool,
    pub(crate) storage: Storage,
    pub(crate) layout: Layout,
}

impl LogFile {
    /// Opens a file and determines its layout. Only parts that its index does not cover are scanned.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self, ReadError> {
        Self::open_as(path, Thresholds::ByPicture)
    }

    /// The same, with this treatment of the thresholds of a map file.
    pub fn open_as(path: impl Into<PathBuf>, thresholds: Thresholds) -> Result<Self, ReadError> {
        let path = path.into();
        let file = FileBytes::open(&path).map_err(|error| ReadError::io(&path, error))?;
        let size = file.len() as u64;
        let is_compressed = head(&file).starts_with(ZSTD_MAGIC);
        let is_map = map::is_called_so(&path);
        let (storage, mut layout) = match is_compressed {
            false if is_map => {
                let log =
                    map::as_log(&path, thresholds).map_err(|cause| ReadError::Map { path: path.clone(), cause })?;
                open_storage(&path, log, false)?
            }
            false => open_storage(&path, file, false)?,
            true => {
                let decompressed = decompress_file(&file);
                let Decompressed { bytes, is_whole } =
                    decompressed.map_err(|cause| ReadError::Decompress { path: path.clone(), cause })?;
                let (storage, mut layout) = open_storage(&path, bytes, true)?;
                layout.damage.extend((!is_whole).then_some(Damage::TruncatedCompressedFile));
                (storage, layout)
            }
        };
        let removed = layout.definitions.limit();
        layout.definitions.convert_ros1();
        layout.damage.extend((removed > 0).then_some(Damage::ManyDefinitions { count: removed }));
        let loss = layout.damage.iter().find(|damage| !matches!(damage, Damage::Incomplete { .. }));
        match loss {
            Some(damage) if layout.blocks.is_empty() => Err(match sqlite::write_ahead_log(&path) {
                Some(journal) if matches!(storage, Storage::Sqlite(_)) => ReadError::OnlyJournal { path, journal },
                _ if let Damage::ManyDefinitions { count } = damage => {
                    ReadError::ManyDefinitions { path, count: *count }
                }
                _ => ReadError::NothingLeft { path, damage: damage.clone() },
            }),
            _ => {
                let is_indexed = whole_statistics(&layout).is_some_and(|known| is_complete(&layout.index, known));
                Ok(Self { path, size, is_compressed, is_map, later: 0, is_indexed, storage, layout })
            }
        }
    }

    /// Shifts the log times of the whole file by nanoseconds, which may be negative. Stamps in messages are unchanged.
    pub(crate) fn set_later(&mut self, later: i64) {
        self.later = later;
        for block in &mut self.layout.blocks {
            block.first_time = block.first_time.saturating_add_signed(later);
            block.last_time = block.last_time.saturating_add_signed(later);
        }
    }

    /// The shift of the file's log times, nanoseconds.
    pub(crate) fn later(&self) -> i64 {
        self.later
    }

    /// Whether the file is a map, read as a log of one message.
    pub(crate) fn is_map(&self) -> bool {
        self.is_map
    }

    /// The container: `MCAP`, `SQLite` or `ROS 1 bag`, and whether it is compressed.
    pub fn container(&self) -> String {
        if self.is_map {
            return "map file".to_owned();
        }
        let compression = if self.is_compressed { ", compressed with zstd" } else { "" };
        format!("{}{compression}", self.storage.name())
    }

    /// The path as given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The length of the file when it was opened, bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// The channel with the given number in this file.
    pub fn channel(&self, id: u16) -> Option<Channel> {
        self.layout.definitions.channel(id)
    }

    /// All channels that the file describes, with their numbers; some may have no messages.
    pub fn channels(&self) -> impl Iterator<Item = (u16, Channel)> + '_ {
        let definitions = &self.layout.definitions;
        definitions.channel_numbers().filter_map(|id| Some((id, definitions.channel(id)?)))
    }

    /// The entries of the metadata record with the given name.
    pub fn metadata(&self, name: &str) -> Option<&BTreeMap<String, String>> {
        self.layout.metadata.get(name)
    }

    /// The statistics record of an MCAP file; `None` if it has none or is damaged.
    pub fn statistics(&self) -> Option<&FileStatistics> {
        whole_statistics(&self.layout)
    }

    /// The index of an MCAP file by channel; `None` unless it covers all messages.
    pub(crate) fn index(&self) -> Option<&BTreeMap<u16, IndexedChannel>> {
        self.is_indexed.then_some(&self.layout.index)
    }

    /// Whether an index says that a channel has no messages, in a file that has some.
    pub(crate) fn is_silent(&self, channel: u16) -> bool {
        let has_none = |index: &BTreeMap<u16, IndexedChannel>| {
            !index.is_empty() && index.get(&channel).is_none_or(|indexed| indexed.messages == 0)
        };
        self.index().is_some_and(has_none)
    }

    /// The names of the file's metadata records.
    pub fn metadata_names(&self) -> impl Iterator<Item = &str> {
        self.layout.metadata.keys().map(String::as_str)
    }

    /// The number of attachments.
    pub fn attachments(&self) -> usize {
        self.layout.supplements.iter().filter(|(kind, _)| *kind == SupplementKind::Attachment).count()
    }

    /// The attachments and metadata records of an MCAP file, in file order, each as the body of its record (MCAP
    /// specification). `None` for a body that cannot be read.
    pub fn supplements(&self) -> impl Iterator<Item = (SupplementKind, Option<Vec<u8>>)> + '_ {
        let body = |range: &Range<usize>| match &self.storage {
            Storage::Mcap(bytes) => bytes.read(range.clone()),
            Storage::Sqlite(_) | Storage::Ros1(_) => None,
        };
        self.layout.supplements.iter().map(move |(kind, range)| (*kind, body(range)))
    }

    /// The damage found when the file was opened. Bad chunks may be found only when they are read.
    pub fn damage(&self) -> &[Damage] {
        &self.layout.damage
    }

    /// The number of chunks.
    pub fn chunks(&self) -> usize {
        self.layout.chunks
    }

    /// The compressions of the file's chunks, such as `zstd`; an empty string for uncompressed chunks.
    pub fn compressions(&self) -> &BTreeSet<String> {
        &self.layout.compressions
    }

    /// The log times of the first and the last message of a channel, or of the file where no index has them; `None`
    /// if there are no messages.
    pub(crate) fn span(&self, channel: u16) -> Option<(u64, u64)> {
        if let Some(index) = self.index() {
            let indexed = index.get(&channel).filter(|indexed| indexed.messages > 0)?;
            return Some([indexed.first, indexed.last].map(|time| time.saturating_add_signed(self.later)).into());
        }
        let blocks = &self.layout.blocks;
        Some((self.first_time()?, blocks.iter().map(|block| block.last_time).max()?))
    }

    /// The least log time in the file; `None` if it has no messages.
    pub fn first_time(&self) -> Option<u64> {
        self.layout.blocks.iter().map(|block| block.first_time).min()
    }
}

/// The statistics of a layout; `None` if there are none, or damage has lost messages.
fn whole_statistics(layout: &Layout) -> Option<&FileStatistics> {
    let is_whole = layout.damage.iter().all(|damage| matches!(damage, Damage::Incomplete { .. }));
    layout.statistics.as_ref().filter(|_| is_whole)
}

/// Whether an index has as many messages as the statistics say, of each channel.
fn is_complete(index: &BTreeMap<u16, IndexedChannel>, known: &FileStatistics) -> bool {
    let is_counted =
        |(number, channel): (&u16, &IndexedChannel)| known.by_channel.get(number) == Some(&channel.messages);
    let messages: u64 = index.values().map(|channel| channel.messages).sum();
    known.messages == messages && index.iter().all(is_counted)
}

fn head(bytes: &FileBytes) -> Vec<u8> {
    bytes.read(0..bytes.len().min(HEAD)).unwrap_or_default()
}

/// The container of a file by its first bytes, and its layout. A decompressed file has no name.
fn open_storage(path: &Path, bytes: FileBytes, is_decompressed: bool) -> Result<(Storage, Layout), ReadError> {
    let path = || path.to_owned();
    let head = head(&bytes);
    if head.is_empty() {
        return Err(match sqlite::write_ahead_log(&path()) {
            Some(journal) => ReadError::OnlyJournal { path: path(), journal },
            None => ReadError::Empty { path: path() },
        });
    }
    if head.starts_with(MAGIC) {
        let layout = Layout::of(&bytes);
        return Ok((Storage::Mcap(bytes), layout));
    }
    if head.starts_with(sqlite::MAGIC) {
        let name = is_decompressed.then(|| bytes.name()).transpose();
        let name = name.map_err(|cause| ReadError::Decompress { path: path(), cause })?;
        let opened = Database::open(&path(), name, bytes);
        let (database, layout) = opened.map_err(|cause| match sqlite::write_ahead_log(&path()) {
            Some(journal) => ReadError::OnlyJournal { path: path(), journal },
            None => ReadError::Database { path: path(), cause },
        })?;
        return Ok((Storage::Sqlite(database), layout));
    }
    if head.starts_with(ros1::MAGIC) {
        let (bag, layout) = Bag::open(bytes);
        return Ok((Storage::Ros1(bag), layout));
    }
    // A file that ends within the magic bytes is a log truncated to nothing.
    if [MAGIC, sqlite::MAGIC, ros1::MAGIC].iter().any(|magic| magic.starts_with(&head)) {
        return Err(ReadError::NothingLeft { path: path(), damage: Damage::NoEnd { position: 0 } });
    }
    let (looks_like, fix) = looks_like(&head);
    Err(ReadError::NotALog { path: path(), looks_like, fix })
}
