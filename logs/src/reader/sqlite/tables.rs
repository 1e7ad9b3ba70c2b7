//! The topics of a database.

use crate::qos;
use crate::reader::definitions::MOST_CHANNELS;
use crate::reader::layout::Layout;
use crate::schemas::{full_type_name, schema_text};
use gridweave_runtime::message::Channel;
use rusqlite::{Connection, Row};
use std::collections::BTreeMap;

/// The name under which rosbag2 stores the bag's metadata.
const DESCRIPTION: (&str, &str) = ("rosbag2", "serialized_metadata");

/// Adds the channels of all topics to the layout. Returns their channel numbers, from 1, by topic id. All texts
/// together take at most `room` bytes: the length of the database, in which each is stored.
///
/// # Errors
/// The cause, if the database is not a bag.
pub(super) fn read_topics(
    connection: &Connection,
    layout: &mut Layout,
    room: usize,
) -> Result<BTreeMap<i64, u16>, String> {
    let text_of = |error: rusqlite::Error| error.to_string();
    let mut room = Room(room);
    let needed = |name: &'static str| {
        let table = table(connection, name).map_err(text_of)?;
        table.ok_or_else(|| format!("it has no table `{name}`, so it is not a rosbag2 bag"))?.stored(name)
    };
    let (topics, _) = (needed("topics")?, needed("messages")?);
    let is_stored = |name: &str| table(connection, name).ok().flatten().is_some_and(|table| table.stored(name).is_ok());
    let definitions = match is_stored("message_definitions") {
        true => definitions(connection, &mut room).unwrap_or_default(),
        false => BTreeMap::new(),
    };
    let optional = |column: &str| if topics.has(column) { column.to_owned() } else { "''".to_owned() };
    let query = format!(
        "SELECT id, name, type, {}, {}, {} FROM topics ORDER BY id",
        optional("serialization_format"),
        optional("offered_qos_profiles"),
        optional("type_description_hash")
    );
    let mut statement = connection.prepare(&query).map_err(text_of)?;
    let mut rows = statement.query([]).map_err(text_of)?;
    let mut numbers = BTreeMap::new();
    // The topics before the damage are kept; messages of other topics are reported.
    while let Ok(Some(row)) = rows.next() {
        let Ok(topic) = row.get::<_, i64>(0) else { continue };
        let number = numbers.len() + 1;
        let Some(number) = u16::try_from(number).ok().filter(|_| number <= MOST_CHANNELS) else {
            return Err(format!("it has more than {MOST_CHANNELS} topics"));
        };
        let channel = channel(row, &definitions, &mut room);
        let channel = channel.ok_or("its topics have longer texts than the database can hold")?;
        layout.definitions.insert(number, channel);
        numbers.insert(topic, number);
    }
    if let Some(description) = is_stored("metadata").then(|| description(connection)).flatten() {
        let (record, key) = DESCRIPTION;
        layout.metadata.insert(record.to_owned(), BTreeMap::from([(key.to_owned(), description)]));
    }
    Ok(numbers)
}

/// A table of a database.
pub(super) struct Table {
    /// Whether its rows have no number.
    is_without_numbers: bool,
    /// Its columns in lower case, and whether each is computed.
    columns: BTreeMap<String, bool>,
}

/// Checks that nothing in the schema is a virtual table, whose rows are computed, or what no program writes.
///
/// # Errors
/// The statement that is refused.
pub(super) fn check_schema(connection: &Connection) -> Result<(), String> {
    // SQLite stores statements with these first words, in this form.
    let query = "SELECT substr(sql, 1, 40) FROM sqlite_schema WHERE sql IS NOT NULL AND NOT (sql LIKE 'CREATE TABLE %'
        OR sql LIKE 'CREATE INDEX %' OR sql LIKE 'CREATE UNIQUE INDEX %' OR sql LIKE 'CREATE VIEW %'
        OR sql LIKE 'CREATE TRIGGER %') LIMIT 1";
    // The schema of a damaged database may end anywhere.
    let refused: Option<String> = connection.query_row(query, [], |row| row.get(0)).unwrap_or_default();
    match refused {
        Some(statement) => Err(format!("its schema has `{statement}`, so it is not a rosbag2 bag")),
        None => Ok(()),
    }
}

/// The table with this name as SQLite understands it, whatever the schema calls it; `None` if there is none, or a view:
/// views are not looked into, as a few that name each other twice take hours.
pub(super) fn table(connection: &Connection, name: &str) -> rusqlite::Result<Option<Table>> {
    if !connection.table_exists(Some("main"), name)? {
        return Ok(None);
    }
    let mut statement = connection.prepare("SELECT name, hidden FROM pragma_table_xinfo(?1)")?;
    let column = |row: &Row<'_>| Ok((row.get::<_, String>(0)?.to_ascii_lowercase(), row.get::<_, i64>(1)? != 0));
    let columns = statement.query_map([name], column)?.collect::<rusqlite::Result<_>>()?;
    let mut table = Table { is_without_numbers: false, columns };
    let number = table.row_number();
    table.is_without_numbers =
        number.is_some_and(|number| connection.prepare(&format!("SELECT {number} FROM {name}")).is_err());
    Ok(Some(table))
}

impl Table {
    fn has(&self, column: &str) -> bool {
        self.columns.contains_key(column)
    }

    /// The table, if all that it holds is stored in the file: what is computed has no limit.
    fn stored(self, name: &str) -> Result<Self, String> {
        match self.columns.iter().find(|(_, is_computed)| **is_computed) {
            Some((column, _)) => {
                Err(format!("the column `{column}` of its table `{name}` is computed, so it is not a rosbag2 bag"))
            }
            None => Ok(self),
        }
    }

    /// The name of the number of a row, which no column hides.
    pub(super) fn row_number(&self) -> Option<&'static str> {
        let is_free = |name: &&str| !self.is_without_numbers && !self.has(name);
        ["rowid", "_rowid_", "oid"].into_iter().find(is_free)
    }
}

/// The number of bytes that texts may still take.
struct Room(usize);

impl Room {
    /// The text in a column, empty if it is not text; `None` without room for it.
    fn text(&mut self, row: &Row<'_>, column: usize) -> Option<String> {
        let text = row.get_ref(column).ok().and_then(|value| value.as_str().ok()).unwrap_or_default();
        self.0 = self.0.checked_sub(text.len())?;
        Some(text.to_owned())
    }
}

/// The encodings and texts of definitions, by type, as far as there is room.
fn definitions(connection: &Connection, room: &mut Room) -> rusqlite::Result<BTreeMap<String, (String, String)>> {
    let query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions";
    let mut statement = connection.prepare(query)?;
    let (mut rows, mut definitions) = (statement.query([])?, BTreeMap::new());
    while let Some(row) = rows.next()? {
        let texts = (room.text(row, 0), room.text(row, 1), room.text(row, 2));
        let (Some(name), Some(encoding), Some(text)) = texts else { break };
        definitions.insert(name, (encoding, text));
    }
    Ok(definitions)
}

/// The channel of a topic; `None` without room for it.
fn channel(row: &Row<'_>, definitions: &BTreeMap<String, (String, String)>, room: &mut Room) -> Option<Channel> {
    let schema_name = room.text(row, 2)?;
    let (schema_encoding, schema) = match definitions.get(&schema_name).filter(|(_, text)| !text.is_empty()) {
        Some((encoding, schema)) => (encoding.clone(), schema.clone()),
        None => ("ros2msg".to_owned(), schema_text(&full_type_name(&schema_name)).unwrap_or_default()),
    };
    let mut metadata = BTreeMap::from([(qos::KEY.to_owned(), room.text(row, 4)?)]);
    let hash = room.text(row, 5)?;
    if !hash.is_empty() {
        metadata.insert("topic_type_hash".to_owned(), hash);
    }
    Some(Channel {
        topic: room.text(row, 1)?,
        message_encoding: room.text(row, 3)?,
        schema_name,
        schema_encoding,
        schema: schema.into_bytes(),
        metadata,
    })
}

fn description(connection: &Connection) -> Option<String> {
    connection.query_row("SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1", [], |row| row.get(0)).ok()
}
