//! The databases of rosbag2.

use super::input::Input;
use super::target::Target;
use gridweave_logs::reader::{LogFile, LogReader};
use gridweave_runtime::ros::{PoseStamped, encode};
use rusqlite::Connection;
use std::path::Path;

const FILE: &str = "bag_0.db3";

/// A database with a few rows, of which some continue on other pages; small pages, so that a change is likely to
/// matter.
fn database(more: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(FILE);
    let connection = Connection::open(&path).unwrap();
    let tables = "PRAGMA page_size = 512;
        CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
            serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
        CREATE INDEX timestamp_idx ON messages (timestamp ASC);
        INSERT INTO topics VALUES (1, '/robot1/pose', 'geometry_msgs/msg/PoseStamped', 'cdr', '- durability: 1'),
            (2, '/other', 'p/msg/X', 'cdr', '');";
    connection.execute_batch(tables).unwrap();
    for number in 0..12 {
        let pose = encode(&PoseStamped::default()).unwrap();
        let data = if number % 4 == 3 { vec![number as u8; 1500] } else { pose };
        let values = (1 + i64::from(number % 4 == 3), i64::from(10 * (number ^ 1)), data);
        connection.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?1, ?2, ?3)", values).unwrap();
    }
    connection.execute_batch(more).unwrap();
    connection.close().unwrap();
    std::fs::read(&path).unwrap()
}

#[test]
fn every_database_is_read_or_refused() {
    let definitions = "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding TEXT,
            encoded_message_definition TEXT, type_description_hash TEXT);
        INSERT INTO message_definitions VALUES (1, 'p/msg/X', 'ros2msg', 'int8[0] a', 'RIHS01_1');";
    let computed = "ALTER TABLE messages ADD COLUMN more BLOB AS (zeroblob(99999999))";
    let seeds = ["", definitions, computed].map(|more| Input(vec![database(more)]));
    Target {
        name: "databases",
        files: &[FILE],
        seeds: seeds.into(),
        words: &[
            "rowid",
            "AS (zeroblob(99999999))",
            "VIEW",
            "WITHOUT ROWID",
            "data",
            "topics",
            "messages",
            "\u{7f}\u{7f}\u{7f}\u{7f}",
        ],
        cases: 1500,
        read,
    }
    .check();
}

fn read(folder: &Path) {
    match LogFile::open(folder.join(FILE)) {
        Ok(log) => {
            let mut log = LogReader::new(vec![log]);
            while log.next_message().is_some() {}
            drop(log.take_damage());
        }
        Err(error) => drop(error.to_string()),
    }
}
