//! One log file: its bytes and its layout.

use super::bytes::FileBytes;
use super::damage::Damage;
use super::error::ReadError;
use super::guess::looks_like;
use super::layout::{IndexedChannel, Layout};
use super::map;
use super::packed::{Unpacked, ZSTD_MAGIC, unpack_file};
use super::ros1::{self, Bag};
use super::sqlite::{self, Database};
use super::storage::Storage;
use super::summary::Statistics;
use super::supplement::SupplementKind;
use crate::map_file::Thresholds;
use gridweave_runtime::message::Channel;
use mcap::MAGIC;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// As much of a file is looked at to see what it is.
const HEAD: usize = 1 << 10;

/// One file of messages, opened for reading: MCAP, a database of rosbag2, or a bag of ROS 1, as it is or packed with zstd.
#[derive(Debug)]
pub struct LogFile {
    path: PathBuf,
    size: u64,
    is_packed: bool,
    /// Whether it is a map, and no log.
    is_map: bool,
    /// By how much its clock is set later, nanoseconds.
    later: i64,
    pub(crate) storage: Storage,
    pub(crate) layout: Layout,
}

impl LogFile {
    /// Opens a file and finds out what it consists of. Only what its own index leaves open is read through.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self, ReadError> {
        Self::open_as(path, Thresholds::ByPicture)
    }

    /// The same, with the thresholds of a map file read so.
    pub fn open_as(path: impl Into<PathBuf>, thresholds: Thresholds) -> Result<Self, ReadError> {
        let path = path.into();
        let packed = FileBytes::open(&path).map_err(|error| ReadError::io(&path, error))?;
        let size = packed.len() as u64;
        let is_packed = head(&packed).starts_with(ZSTD_MAGIC);
        let is_map = map::is_called_so(&path);
        let (storage, layout) = match is_packed {
            false if is_map => {
                let log =
                    map::as_log(&path, thresholds).map_err(|cause| ReadError::Map { path: path.clone(), cause })?;
                open_storage(&path, None, log)?
            }
            false => open_storage(&path, None, packed)?,
            true => {
                let unpacked = unpack_file(&packed);
                let Unpacked { bytes, name, is_whole } =
                    unpacked.map_err(|cause| ReadError::Unpack { path: path.clone(), cause })?;
                let (storage, mut layout) = open_storage(&path, Some(&name), bytes)?;
                layout.damage.extend((!is_whole).then_some(Damage::CutPack));
                (storage, layout)
            }
        };
        let loss = layout.damage.iter().find(|damage| !matches!(damage, Damage::Incomplete { .. }));
        match loss {
            Some(damage) if layout.blocks.is_empty() => Err(ReadError::NothingLeft { path, damage: damage.clone() }),
            _ => Ok(Self { path, size, is_packed, is_map, later: 0, storage, layout }),
        }
    }

    /// Sets the clock of the whole file later by so many nanoseconds, or earlier where these are negative. Stamps in messages
    /// stay.
    pub(crate) fn set_later(&mut self, later: i64) {
        self.later = later;
        for block in &mut self.layout.blocks {
            block.first_time = block.first_time.saturating_add_signed(later);
            block.last_time = block.last_time.saturating_add_signed(later);
        }
    }

    /// By how much the clock of the file was set later, nanoseconds.
    pub(crate) fn later(&self) -> i64 {
        self.later
    }

    /// Whether the file is a map that is read as a log of one message.
    pub(crate) fn is_map(&self) -> bool {
        self.is_map
    }

    /// What the file is: `MCAP`, `SQLite` or `ROS 1 bag`, and whether it is packed.
    pub fn container(&self) -> String {
        if self.is_map {
            return "map file".to_owned();
        }
        let packed = if self.is_packed { ", packed with zstd" } else { "" };
        format!("{}{packed}", self.storage.name())
    }

    /// The file's path, as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How long the file was when it was opened, bytes.
    pub fn size(&self) -> u64 {
        self.size
    }

    /// The channel with the given number in this file.
    pub fn channel(&self, id: u16) -> Option<Channel> {
        self.layout.definitions.channel(id)
    }

    /// All channels that the file describes, with their numbers in it; some may have no messages.
    pub fn channels(&self) -> impl Iterator<Item = (u16, Channel)> + '_ {
        let definitions = &self.layout.definitions;
        definitions.channel_numbers().filter_map(|id| Some((id, definitions.channel(id)?)))
    }

    /// The entries of the file's metadata record of the given name.
    pub fn metadata(&self, name: &str) -> Option<&BTreeMap<String, String>> {
        self.layout.metadata.get(name)
    }

    /// What an MCAP file says of its messages at its end; nothing if it has none, or is damaged.
    pub fn statistics(&self) -> Option<&Statistics> {
        let is_whole = self.layout.damage.iter().all(|damage| matches!(damage, Damage::Incomplete { .. }));
        self.layout.statistics.as_ref().filter(|_| is_whole)
    }

    /// What the index of an MCAP file says of every channel with messages; nothing unless it tells of all messages.
    pub(crate) fn index(&self) -> Option<&BTreeMap<u16, IndexedChannel>> {
        let told = &self.statistics()?.by_channel;
        let counted = self.layout.index.iter().map(|(number, channel)| (*number, channel.messages));
        let is_told = |(number, count): (u16, u64)| told.get(&number) == Some(&count);
        let messages: u64 = self.layout.index.values().map(|channel| channel.messages).sum();
        (counted.into_iter().all(is_told) && self.statistics()?.messages == messages).then_some(&self.layout.index)
    }

    /// The names of the file's metadata records.
    pub fn metadata_names(&self) -> impl Iterator<Item = &str> {
        self.layout.metadata.keys().map(String::as_str)
    }

    /// How many attachments the file has.
    pub fn attachments(&self) -> usize {
        self.layout.supplements.iter().filter(|(kind, _)| *kind == SupplementKind::Attachment).count()
    }

    /// The attachments and metadata records of an MCAP file, in its order, each as the body of its record (MCAP
    /// specification). None of one whose body cannot be read.
    pub fn supplements(&self) -> impl Iterator<Item = (SupplementKind, Option<Vec<u8>>)> + '_ {
        let body = |range: &Range<usize>| match &self.storage {
            Storage::Mcap(bytes) => bytes.read(range.clone()),
            Storage::Sqlite(_) | Storage::Ros1(_) => None,
        };
        self.layout.supplements.iter().map(move |(kind, range)| (*kind, body(range)))
    }

    /// What was found wrong when the file was opened. Bad chunks may show only when they are read.
    pub fn damage(&self) -> &[Damage] {
        &self.layout.damage
    }

    /// How many chunks the file has.
    pub fn chunks(&self) -> usize {
        self.layout.chunks
    }

    /// How the file's chunks are compressed, such as `zstd`; an empty text for those that are not.
    pub fn compressions(&self) -> &BTreeSet<String> {
        &self.layout.compressions
    }

    /// The least log time in the file; `None` if it has no messages.
    pub fn first_time(&self) -> Option<u64> {
        self.layout.blocks.iter().map(|block| block.first_time).min()
    }
}

fn head(bytes: &FileBytes) -> Vec<u8> {
    bytes.read(0..bytes.len().min(HEAD)).unwrap_or_default()
}

/// The container that a file begins as, and its layout. A packed file was unpacked to `unpacked`.
fn open_storage(path: &Path, unpacked: Option<&Path>, bytes: FileBytes) -> Result<(Storage, Layout), ReadError> {
    let path = || path.to_owned();
    let head = head(&bytes);
    if head.is_empty() {
        return Err(ReadError::Empty { path: path() });
    }
    if head.starts_with(MAGIC) {
        let layout = Layout::of(&bytes);
        return Ok((Storage::Mcap(bytes), layout));
    }
    if head.starts_with(sqlite::MAGIC) {
        let opened = Database::open(&path(), unpacked, bytes);
        let (database, layout) = opened.map_err(|cause| ReadError::Database { path: path(), cause })?;
        return Ok((Storage::Sqlite(database), layout));
    }
    if head.starts_with(ros1::MAGIC) {
        let (bag, layout) = Bag::open(bytes);
        return Ok((Storage::Ros1(bag), layout));
    }
    // A file that breaks off within the magic bytes is a log of which nothing is left.
    if [MAGIC, sqlite::MAGIC, ros1::MAGIC].iter().any(|magic| magic.starts_with(&head)) {
        return Err(ReadError::NothingLeft { path: path(), damage: Damage::NoEnd { position: 0 } });
    }
    let (looks_like, cure) = looks_like(&head);
    Err(ReadError::NotALog { path: path(), looks_like, cure })
}
