//! The topics of a database.

use crate::qos;
use crate::reader::definitions::MOST_CHANNELS;
use crate::reader::layout::Layout;
use crate::schemas::{full_type_name, schema_text};
use gridweave_runtime::message::Channel;
use rusqlite::{Connection, Row};
use std::collections::{BTreeMap, BTreeSet};

/// The name under which rosbag2 stores the bag's metadata.
const DESCRIPTION: (&str, &str) = ("rosbag2", "serialized_metadata");

/// Adds the channels of all topics to the layout. Returns their channel numbers, from 1, by topic id.
///
/// # Errors
/// The cause, if the database is not a bag.
pub(super) fn read_topics(connection: &Connection, layout: &mut Layout) -> Result<BTreeMap<i64, u16>, String> {
    let text_of = |error: rusqlite::Error| error.to_string();
    let tables = tables(connection).map_err(text_of)?;
    if let Some(missing) = ["topics", "messages"].iter().find(|table| !tables.contains(**table)) {
        return Err(format!("it has no table `{missing}`, so it is not a rosbag2 bag"));
    }
    let definitions = match tables.contains("message_definitions") {
        true => definitions(connection).unwrap_or_default(),
        false => BTreeMap::new(),
    };
    let columns = columns(connection, "topics").map_err(text_of)?;
    let optional = |column: &str| if columns.contains(column) { column.to_owned() } else { "''".to_owned() };
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
        layout.definitions.insert(number, channel(row, &definitions));
        numbers.insert(topic, number);
    }
    if let Some(description) = tables.contains("metadata").then(|| description(connection)).flatten() {
        let (record, key) = DESCRIPTION;
        layout.metadata.insert(record.to_owned(), BTreeMap::from([(key.to_owned(), description)]));
    }
    Ok(numbers)
}

/// The names of the tables. Views are excluded.
fn tables(connection: &Connection) -> rusqlite::Result<BTreeSet<String>> {
    let mut statement = connection.prepare("SELECT name FROM sqlite_schema WHERE type = 'table' AND rootpage > 0")?;
    statement.query_map([], |row| row.get(0))?.collect()
}

fn columns(connection: &Connection, table: &str) -> rusqlite::Result<BTreeSet<String>> {
    let mut statement = connection.prepare("SELECT name FROM pragma_table_info(?1)")?;
    statement.query_map([table], |row| row.get(0))?.collect()
}

/// The encodings and texts of definitions, by type.
fn definitions(connection: &Connection) -> rusqlite::Result<BTreeMap<String, (String, String)>> {
    let query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions";
    let mut statement = connection.prepare(query)?;
    statement.query_map([], |row| Ok((row.get(0)?, (row.get(1)?, row.get(2)?))))?.collect()
}

fn channel(row: &Row<'_>, definitions: &BTreeMap<String, (String, String)>) -> Channel {
    let text = |column: usize| row.get::<_, String>(column).unwrap_or_default();
    let schema_name = text(2);
    let (schema_encoding, schema) = match definitions.get(&schema_name).filter(|(_, text)| !text.is_empty()) {
        Some((encoding, schema)) => (encoding.clone(), schema.clone()),
        None => ("ros2msg".to_owned(), schema_text(&full_type_name(&schema_name)).unwrap_or_default()),
    };
    let mut metadata = BTreeMap::from([(qos::KEY.to_owned(), text(4))]);
    if !text(5).is_empty() {
        metadata.insert("topic_type_hash".to_owned(), text(5));
    }
    Channel {
        topic: text(1),
        message_encoding: text(3),
        schema_name,
        schema_encoding,
        schema: schema.into_bytes(),
        metadata,
    }
}

fn description(connection: &Connection) -> Option<String> {
    connection.query_row("SELECT metadata FROM metadata ORDER BY id DESC LIMIT 1", [], |row| row.get(0)).ok()
}
