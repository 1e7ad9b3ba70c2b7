//! The rows of the table of messages: found in runs, and read one run at a time.

use crate::reader::block::{Block, Records};
use crate::reader::damage::{ChunkFault, Damage, LARGEST};
use crate::reader::layout::Layout;
use crate::reader::record::push_message;
use rusqlite::types::ValueRef;
use rusqlite::{Connection, Row, Statement};
use std::collections::BTreeMap;

/// The limits of a run: the size of its messages in bytes, and the number of rows.
const RUN_BYTES: u64 = 1 << 20;
const RUN_ROWS: u64 = 16 << 10;
/// The maximum number of unreadable gaps that are skipped.
const MOST_GAPS: u64 = 1000;
/// The maximum number of messages that are skipped because they take more than is left of the file: of a damaged
/// database a few, of one that gives the same bytes again and again all.
const MOST_EXCESS: u64 = 10;

/// A run of rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rows {
    /// The id of the first row.
    first: i64,
    /// The id of the last row.
    last: i64,
    /// The number of rows.
    count: u64,
    /// The size of their messages, bytes.
    pub(crate) size: u64,
}

/// A row without its message.
struct Place {
    number: i64,
    time: u64,
    size: u64,
}

impl Place {
    fn of(row: &Row<'_>) -> rusqlite::Result<Self> {
        let time = row.get_ref(1)?.as_i64().unwrap_or(0);
        let size = row.get_ref(2)?.as_i64().unwrap_or(0);
        Ok(Self { number: row.get(0)?, time: u64::try_from(time).unwrap_or(0), size: u64::try_from(size).unwrap_or(0) })
    }
}

/// Scans all rows, and adds runs of them to the layout as blocks. `row_number` is the name of their numbers; the rows
/// `torn`, ascending, are incomplete; the messages of the others take at most `room` bytes: the length of the database.
pub(super) fn survey(
    connection: &Connection,
    row_number: &str,
    torn: &[i64],
    room: u64,
    layout: &mut Layout,
) -> rusqlite::Result<()> {
    // The length of a message is known without reading it. An index could claim another one.
    let query = format!(
        "SELECT {row_number}, timestamp, octet_length(data) FROM messages NOT INDEXED WHERE {row_number} >= ?1 ORDER BY {row_number}"
    );
    let mut statement = connection.prepare(&query)?;
    let mut runs = Runs { layout, run: None, torn, room, excess: 0 };
    let (mut from, mut gaps) = (i64::MIN, 0);
    loop {
        let mut last = None;
        let ended = walk(&mut statement, from, |place| {
            // Pages that are linked in a ring have rows without end.
            let is_taken = last.is_none_or(|last| place.number > last) && runs.push(&place);
            last = if is_taken { Some(place.number) } else { last };
            is_taken
        });
        let next = last.map_or(Some(from), |last: i64| last.checked_add(1));
        match (ended, next) {
            (Ok(true), _) | (_, None) => break,
            (Ok(false) | Err(_), Some(lost_from)) => {
                // A run is read without gaps.
                runs.end();
                if runs.excess > MOST_EXCESS {
                    runs.layout.damage.push(Damage::ExcessRows { from: lost_from.max(0) });
                    break;
                }
                gaps += 1;
                let found = (gaps <= MOST_GAPS).then(|| behind(&mut statement, lost_from.max(0))).flatten();
                runs.layout.damage.push(Damage::LostRows { from: lost_from.max(0), to: found });
                match found {
                    Some(found) => from = found,
                    None => break,
                }
            }
        }
    }
    runs.end();
    Ok(())
}

/// Passes the rows to `take` until it refuses one; whether it took all.
fn walk(statement: &mut Statement<'_>, from: i64, mut take: impl FnMut(Place) -> bool) -> rusqlite::Result<bool> {
    let mut rows = statement.query([from])?;
    while let Some(row) = rows.next()? {
        if !take(Place::of(row)?) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// The next id after `lost` at which a row can be read; `None` if there is none.
fn behind(statement: &mut Statement<'_>, lost: i64) -> Option<i64> {
    // Whether there is a readable row, or an error.
    let mut first_from = |from: i64| -> Result<Option<i64>, ()> {
        let mut rows = statement.query([from]).map_err(|_| ())?;
        let row = rows.next().map_err(|_| ())?;
        row.map(|row| row.get(0)).transpose().map_err(|_| ())
    };
    let (mut bad, mut step) = (lost, 1_i64);
    let mut good = loop {
        let from = lost.checked_add(step)?;
        match first_from(from) {
            Ok(found) => break found?.min(from),
            Err(()) => bad = from,
        }
        step = step.checked_mul(2)?;
    };
    while good - bad > 1 {
        let middle = bad + (good - bad) / 2;
        match first_from(middle) {
            Ok(_) => good = middle,
            Err(()) => bad = middle,
        }
    }
    Some(good)
}

/// Combines rows to blocks.
struct Runs<'a> {
    layout: &'a mut Layout,
    run: Option<Block>,
    /// The ids of incomplete rows, ascending.
    torn: &'a [i64],
    /// The number of bytes that further messages may take, and the number of those that take more.
    room: u64,
    excess: u64,
}

impl Runs<'_> {
    /// Adds a row; `false` if its message cannot be in the file.
    fn push(&mut self, place: &Place) -> bool {
        let Place { number, time, size } = *place;
        let size = if self.torn.binary_search(&number).is_ok() { 0 } else { size };
        let Some(room) = self.room.checked_sub(size) else {
            self.excess += 1;
            return false;
        };
        self.room = room;
        let run = self.run.get_or_insert(Block {
            first_time: time,
            last_time: time,
            records: Records::Rows(Rows { first: number, last: number, count: 0, size: 0 }),
        });
        run.first_time = run.first_time.min(time);
        run.last_time = run.last_time.max(time);
        let Records::Rows(rows) = &mut run.records else { return false };
        rows.last = number;
        rows.count += 1;
        rows.size = rows.size.saturating_add(size);
        if rows.size >= RUN_BYTES || rows.count >= RUN_ROWS {
            self.end();
        }
        true
    }

    fn end(&mut self) {
        self.layout.blocks.extend(self.run.take());
    }
}

impl Rows {
    /// The messages of the rows as MCAP records, and the number of unreadable ones. `row_number` is the name of their
    /// numbers; the rows `torn`, ascending, are incomplete; `channels` are the channel numbers of the topics.
    pub(super) fn contents(
        &self,
        connection: &Connection,
        row_number: &str,
        torn: &[i64],
        channels: &BTreeMap<i64, u16>,
    ) -> Result<(Vec<u8>, u64), ChunkFault> {
        if self.size > LARGEST {
            return Err(ChunkFault::TooMuch { size: self.size });
        }
        let (records, room) = (Vec::new(), self.size);
        let mut reading = Reading { row_number, torn, channels, records, room, seen: 0, read: 0, last: None };
        // The size is claimed by the database, so it is not trusted.
        let _ = reading.records.try_reserve(usize::try_from(self.size.min(2 * RUN_BYTES)).unwrap_or(0));
        if reading.all(connection, self).is_err() {
            reading.one_by_one(connection, self).map_err(|_| ChunkFault::Records)?;
        }
        if reading.records.len() as u64 > 2 * LARGEST {
            return Err(ChunkFault::TooLarge);
        }
        Ok((reading.records, self.count.saturating_sub(reading.read)))
    }
}

struct Reading<'a> {
    row_number: &'a str,
    torn: &'a [i64],
    channels: &'a BTreeMap<i64, u16>,
    records: Vec<u8>,
    /// The number of bytes that further messages may take: no more than the scan has found.
    room: u64,
    /// The number of rows seen and of messages read, and the id of the last row.
    seen: u64,
    read: u64,
    last: Option<i64>,
}

impl Reading<'_> {
    /// Reads the rows of a run, up to the first unreadable one.
    fn all(&mut self, connection: &Connection, rows: &Rows) -> rusqlite::Result<()> {
        let number = self.row_number;
        let query = format!(
            "SELECT {number}, timestamp, topic_id, data FROM messages NOT INDEXED WHERE {number} BETWEEN ?1 AND ?2 ORDER BY {number}"
        );
        let mut statement = connection.prepare(&query)?;
        let mut found = statement.query([rows.first, rows.last])?;
        // There are no more rows, unless pages are linked in a ring.
        while self.seen < rows.count
            && let Some(row) = found.next()?
        {
            self.seen += 1;
            self.take(row)?;
        }
        Ok(())
    }

    /// Reads the rows after the last one individually; unreadable ones are skipped.
    fn one_by_one(&mut self, connection: &Connection, rows: &Rows) -> rusqlite::Result<()> {
        let number = self.row_number;
        let mut next = connection.prepare(&format!(
            "SELECT {number} FROM messages NOT INDEXED WHERE {number} BETWEEN ?1 AND ?2 ORDER BY {number} LIMIT 1"
        ))?;
        let mut one = connection.prepare(&format!(
            "SELECT {number}, timestamp, topic_id, data FROM messages NOT INDEXED WHERE {number} = ?1"
        ))?;
        let mut from = self.last.map_or(Some(rows.first), |last| last.checked_add(1));
        while let Some(start) = from.filter(|from| *from <= rows.last) {
            let Ok(number) = next.query_row([start, rows.last], |row| row.get::<_, i64>(0)) else { break };
            // A row that is no later one is of pages that are linked in a ring.
            if number < start {
                break;
            }
            // An unreadable row is lost.
            let _ = one.query_row([number], |row| self.take(row));
            from = number.checked_add(1);
        }
        Ok(())
    }

    fn take(&mut self, row: &Row<'_>) -> rusqlite::Result<()> {
        let number: i64 = row.get(0)?;
        self.last = Some(number);
        if self.torn.binary_search(&number).is_ok() {
            return Ok(());
        }
        let (time, topic) = match (row.get_ref(1)?, row.get_ref(2)?) {
            (ValueRef::Integer(time), ValueRef::Integer(topic)) => (u64::try_from(time).unwrap_or(0), topic),
            _ => return Ok(()),
        };
        let (ValueRef::Blob(data) | ValueRef::Text(data)) = row.get_ref(3)? else { return Ok(()) };
        let Some(room) = self.room.checked_sub(data.len() as u64) else { return Ok(()) };
        self.room = room;
        // A number without a channel, if the database does not describe the topic.
        let channel = self.channels.get(&topic).copied().unwrap_or(0);
        // Sequence numbers count from 1 and wrap around.
        push_message(&mut self.records, channel, number as u32, time, time, data);
        self.read += 1;
        Ok(())
    }
}
