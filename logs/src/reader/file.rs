//! One log file: its bytes and its layout.

use super::bytes::FileBytes;
use super::damage::Damage;
use super::error::ReadError;
use super::guess::looks_like;
use super::layout::Layout;
use gridweave_runtime::message::Channel;
use mcap::MAGIC;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// As much of a file is looked at to see what it is.
const HEAD: usize = 1 << 10;

/// One MCAP file, opened for reading.
#[derive(Debug)]
pub struct LogFile {
    path: PathBuf,
    pub(crate) bytes: FileBytes,
    pub(crate) layout: Layout,
}

impl LogFile {
    /// Opens a file and finds out what it consists of. Only what its own index leaves open is read through.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self, ReadError> {
        let path = path.into();
        let bytes = FileBytes::open(&path).map_err(|error| ReadError::io(&path, error))?;
        let head = bytes.read(0..bytes.len().min(HEAD)).unwrap_or_default();
        if head.is_empty() {
            return Err(ReadError::Empty { path });
        }
        if !head.starts_with(MAGIC) {
            // A file that breaks off within the magic bytes is a log of which nothing is left.
            if MAGIC.starts_with(&head) {
                return Err(ReadError::NothingLeft { path, damage: Damage::NoEnd { position: 0 } });
            }
            let (looks_like, cure) = looks_like(&head);
            return Err(ReadError::NotMcap { path, looks_like, cure });
        }
        let layout = Layout::of(&bytes);
        let loss = layout.damage.iter().find(|damage| !matches!(damage, Damage::Incomplete { .. }));
        match loss {
            Some(damage) if layout.blocks.is_empty() => Err(ReadError::NothingLeft { path, damage: damage.clone() }),
            _ => Ok(Self { path, bytes, layout }),
        }
    }

    /// The file's path, as it was given.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How long the file was when it was opened, bytes.
    pub fn size(&self) -> u64 {
        self.bytes.len() as u64
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
