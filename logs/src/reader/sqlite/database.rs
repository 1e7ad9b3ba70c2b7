//! A rosbag2 database, opened read-only.

use super::rows::{Rows, survey};
use super::tables;
use super::torn::Pages;
use crate::reader::bytes::FileBytes;
use crate::reader::damage::{ChunkFault, Damage};
use crate::reader::layout::Layout;
use crate::temporary::Name;
use rusqlite::{Connection, OpenFlags};
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// The length of the database header, which contains the database size, bytes.
const HEADER: usize = 100;

/// A rosbag2 database.
#[derive(Debug)]
pub(crate) struct Database {
    /// The open file.
    file: FileBytes,
    /// One thread reads at a time.
    connection: Mutex<Connection>,
    /// The channel numbers of the topics, by topic id.
    channels: BTreeMap<i64, u16>,
    /// The ids of rows with incomplete messages, ascending.
    torn: Vec<i64>,
    /// The name of the number of a row of `messages`.
    row_number: &'static str,
}

impl Database {
    /// Opens the database at `path` and determines its layout. A compressed one was decompressed to `decompressed`,
    /// whose name is removed.
    ///
    /// # Errors
    /// The cause, if no message can be read.
    pub(crate) fn open(path: &Path, decompressed: Option<Name>, file: FileBytes) -> Result<(Self, Layout), String> {
        let text_of = |error: rusqlite::Error| error.to_string();
        let connection = connect(decompressed.as_ref().map_or(path, Name::path)).map_err(text_of)?;
        drop(decompressed);
        let mut layout = Layout::default();
        let cut = cut(&file);
        let torn = if cut.is_some() { torn_rows(&connection, &file) } else { Vec::new() };
        layout.damage.extend(cut);
        layout.damage.extend(beside(path));
        tables::check_schema(&connection)?;
        let channels = tables::read_topics(&connection, &mut layout, file.len())?;
        let messages = tables::table(&connection, "messages").map_err(text_of)?;
        let row_number = messages.and_then(|table| table.row_number());
        let row_number =
            row_number.ok_or("the rows of its table `messages` have no number, so it is not a rosbag2 bag")?;
        survey(&connection, row_number, &torn, file.len() as u64, &mut layout).map_err(text_of)?;
        if layout.blocks.is_empty() && !layout.damage.is_empty() && layout.definitions.channel_count() == 0 {
            return Err("it has no readable topic".to_owned());
        }
        Ok((Self { file, connection: Mutex::new(connection), channels, torn, row_number }, layout))
    }

    pub(crate) fn is_cut(&self) -> bool {
        self.file.is_cut()
    }

    /// The messages of a run of rows as MCAP records, and the number of unreadable ones.
    ///
    /// # Errors
    /// They are too large, or the database cannot be read there.
    pub(crate) fn contents(&self, rows: &Rows) -> Result<(Vec<u8>, u64), ChunkFault> {
        // A panicking thread leaves the connection usable.
        let connection = self.connection.lock().unwrap_or_else(PoisonError::into_inner);
        rows.contents(&connection, self.row_number, &self.torn, &self.channels)
    }
}

fn torn_rows(connection: &Connection, file: &FileBytes) -> Vec<i64> {
    let query = "SELECT rootpage FROM sqlite_schema WHERE type = 'table' AND name = 'messages'";
    let root = connection.query_row(query, [], |row| row.get::<_, i64>(0)).ok();
    let root = root.and_then(|root| usize::try_from(root).ok());
    root.and_then(|root| Some(Pages::new(file)?.torn_rows(root))).unwrap_or_default()
}

/// A connection that writes neither to the database nor beside it, and runs no code from the database.
fn connect(path: &Path) -> rusqlite::Result<Connection> {
    let mut uri = "file:".to_owned();
    for &byte in path.as_os_str().as_bytes() {
        match byte {
            b'/' | b'.' | b'-' | b'_' => uri.push(byte.into()),
            _ if byte.is_ascii_alphanumeric() => uri.push(byte.into()),
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri.push_str("?mode=ro&immutable=1");
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_URI | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let connection = Connection::open_with_flags(uri, flags)?;
    // With a writable schema, SQLite reads a truncated database as far as possible; the connection is read-only, so
    // nothing is written.
    connection.execute_batch(
        "PRAGMA writable_schema = ON; PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON; PRAGMA query_only = ON;",
    )?;
    Ok(connection)
}

/// The damage if the file is shorter than its header indicates.
fn cut(file: &FileBytes) -> Option<Damage> {
    let header = file.read(0..HEADER)?;
    let number = |at: usize| Some(u32::from_be_bytes(header.get(at..at + 4)?.try_into().ok()?));
    let page_size = match u16::from_be_bytes(header.get(16..18)?.try_into().ok()?) {
        1 => 65536,
        size => usize::from(size),
    };
    // The page count is valid if it was written by the last writer.
    let pages = usize::try_from(number(28)?).ok().filter(|_| number(24) == number(92))?;
    (pages.checked_mul(page_size)? > file.len()).then(|| Damage::NoEnd { position: file.len() })
}

/// The damage if a killed recorder has left a journal beside the database, which is not read.
fn beside(path: &Path) -> Option<Damage> {
    let rest = ["-wal", "-journal"].iter().find_map(|ending| journal(path, ending))?;
    Some(Damage::NotClosed { rest: rest.display().to_string() })
}

/// The journal of changes beside a database, if there is one.
pub(crate) fn write_ahead_log(path: &Path) -> Option<PathBuf> {
    journal(path, "-wal")
}

fn journal(path: &Path, ending: &str) -> Option<PathBuf> {
    let mut name = path.as_os_str().to_owned();
    name.push(ending);
    let journal = PathBuf::from(name);
    fs::metadata(&journal).is_ok_and(|file| file.len() > 0).then_some(journal)
}
