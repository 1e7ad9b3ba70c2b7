//! One log file: its bytes, mapped into memory, and its layout.

use super::damage::Damage;
use super::error::ReadError;
use super::guess::looks_like;
use super::layout::Layout;
use gridweave_runtime::input_file;
use gridweave_runtime::message::Channel;
use mcap::MAGIC;
use memmap2::Mmap;
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::path::{Path, PathBuf};

/// One MCAP file, opened for reading.
#[derive(Debug)]
pub struct LogFile {
    path: PathBuf,
    file: File,
    map: Mmap,
    pub(crate) layout: Layout,
}

impl LogFile {
    /// Opens a file and finds out what it consists of. Only what its own index leaves open is read through.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self, ReadError> {
        let path = path.into();
        let (file, map) = map_file(&path).map_err(|error| ReadError::io(&path, error))?;
        if map.is_empty() {
            return Err(ReadError::Empty { path });
        }
        if !map.starts_with(MAGIC) {
            // A file that breaks off within the magic bytes is a log of which nothing is left.
            if MAGIC.starts_with(&map) {
                return Err(ReadError::NothingLeft { path, damage: Damage::NoEnd { position: 0 } });
            }
            let (looks_like, cure) = looks_like(&map);
            return Err(ReadError::NotMcap { path, looks_like, cure });
        }
        let layout = Layout::of(&map);
        let loss = layout.damage.iter().find(|damage| !matches!(damage, Damage::Incomplete { .. }));
        match loss {
            Some(damage) if layout.blocks.is_empty() => Err(ReadError::NothingLeft { path, damage: damage.clone() }),
            _ => Ok(Self { path, file, map, layout }),
        }
    }

    /// The file's path, as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The file's bytes; none if another program has cut it since it was opened, as what is mapped behind its end cannot be
    /// read.
    pub fn bytes(&self) -> &[u8] {
        if self.is_cut() { &[] } else { &self.map }
    }

    /// Whether another program has cut the file since it was opened.
    pub(crate) fn is_cut(&self) -> bool {
        self.file.metadata().is_ok_and(|file| file.len() < self.map.len() as u64)
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

#[allow(unsafe_code)]
fn map_file(path: &Path) -> std::io::Result<(File, Mmap)> {
    let file = input_file::open(path)?;
    // SAFETY: the map is read-only and private to this process, and is only ever read as bytes, for which every value
    // is valid; every length and offset in it is checked against the map's size, which is fixed. What remains is that
    // another process changes the file meanwhile: a log is only appended to while it is recorded, which does not touch
    // the bytes mapped here, and whether one was cut is looked at before each use of its bytes. (One that is cut in that
    // very moment ends this process with SIGBUS, as with every program that maps files.)
    let map = unsafe { Mmap::map(&file) }?;
    Ok((file, map))
}
