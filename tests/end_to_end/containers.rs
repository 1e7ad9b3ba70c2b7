//! Bags that are no MCAP files: what is in them is merged, shown and converted as that of an MCAP file.

use crate::support::{gridweave, simulate};
use gridweave_logs::reader::{LogFile, LogReader};
use gridweave_runtime::message::Channel;
use rusqlite::Connection;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// Writes the messages of an MCAP file as a database of rosbag2, as Humble does: without definitions.
fn write_database(log: &Path, database: &Path, is_wanted: impl Fn(&str) -> bool, pack: impl Fn(&[u8]) -> Vec<u8>) {
    let mut connection = Connection::open(database).unwrap();
    let tables = "
        CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
            serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
        CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
            data BLOB NOT NULL);";
    connection.execute_batch(tables).unwrap();
    let mut reader = LogReader::new(vec![LogFile::open(log).unwrap()]);
    let files = reader.files().clone();
    let transaction = connection.transaction().unwrap();
    for (number, channel) in files[0].channels().filter(|(_, channel)| is_wanted(&channel.topic)) {
        let Channel { topic, schema_name, message_encoding, metadata, .. } = channel;
        let qos = metadata.get("offered_qos_profiles").cloned().unwrap_or_default();
        let values = (number, topic, schema_name, message_encoding, qos);
        transaction.execute("INSERT INTO topics VALUES (?1, ?2, ?3, ?4, ?5)", values).unwrap();
    }
    while let Some(message) = reader.next_message() {
        if is_wanted(&files[0].channel(message.channel).unwrap().topic) {
            let values = (message.channel, message.log_time.0 as i64, pack(message.data));
            let query = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
            transaction.execute(query, values).unwrap();
        }
    }
    transaction.commit().unwrap();
    connection.close().unwrap();
}

/// The type and the definition of a topic, and the times and bytes of its messages.
type Contents = (String, Vec<u8>, Vec<(u64, Vec<u8>)>);

/// What is on every topic of a log.
fn contents(log: &Path) -> BTreeMap<String, Contents> {
    let mut reader = LogReader::new(vec![LogFile::open(log).unwrap()]);
    let files = reader.files().clone();
    let mut contents = BTreeMap::new();
    while let Some(message) = reader.next_message() {
        let Channel { topic, schema_name, schema, .. } = files[0].channel(message.channel).unwrap();
        let (.., messages) = contents.entry(topic).or_insert((schema_name, schema, Vec::new()));
        messages.push((message.log_time.0, message.data.to_vec()));
    }
    contents
}

#[test]
fn bags_in_databases_are_merged_shown_and_converted_as_mcap_files_are() {
    let folder = TempDir::new().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (log, truth) = simulate(folder.path(), "in.mcap", &["--robots", "2", "--seed", "2"]);
    // One robot's bag split in a folder, its messages packed; the other's a packed file.
    fs::create_dir(path("one")).unwrap();
    let pack = |data: &[u8]| zstd::bulk::compress(data, 1).unwrap();
    write_database(&log, &path("one/one_0.db3"), |topic| topic == "/robot1/map", pack);
    write_database(&log, &path("one/one_1.db3"), |topic| topic.starts_with("/robot1/") && topic != "/robot1/map", pack);
    let description = "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: sqlite3\n  relative_file_paths: \
                       [one_0.db3, one_1.db3]\n  compression_format: zstd\n  compression_mode: MESSAGE\n";
    fs::write(path("one/metadata.yaml"), description).unwrap();
    write_database(&log, &path("two.db3"), |topic| topic.starts_with("/robot2/"), <[u8]>::to_vec);
    let packed = pack(&fs::read(path("two.db3")).unwrap());
    fs::write(path("two.db3.zstd"), packed).unwrap();
    fs::remove_file(path("two.db3")).unwrap();

    let run = |args: &[&str]| gridweave(folder.path(), args);
    run(&["convert", "one", "two.db3.zstd", "-o", "converted.mcap"]).assert(0, &["wrote"]);
    let (before, after) = (contents(&log), contents(&path("converted.mcap")));
    for (topic, converted) in &after {
        assert!(*converted == before[topic], "{topic}");
    }
    assert!(before.keys().filter(|topic| topic.starts_with("/robot")).all(|topic| after.contains_key(topic)));

    run(&["merge", "one", "two.db3.zstd", "-o", "out.mcap", "--summary", "summary.json"]).assert(0, &["merged 2 of 2"]);
    let truth = ["evaluate", "summary.json", "--truth", truth.to_str().unwrap()];
    run(&truth).assert(0, &["right 1, wrong 0, refused 0"]);
    run(&["info", "one", "two.db3.zstd"]).assert(0, &["SQLite, compressed with zstd", "/robot2/map", "robot1"]);
    let left: Vec<_> = fs::read_dir(path("one")).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(left.len(), 3, "{left:?}");
    run(&["convert", "one", "-o", "one/one_0.db3"]).assert(2, &["one_0.db3 is an input"]);
    run(&["convert", "a.yaml", "-o", "out.mcap"]).assert(2, &["`convert` reads logs"]);
}

#[test]
fn a_converted_log_is_put_under_its_robot_and_cut() {
    let folder = TempDir::new().unwrap();
    let (log, _) = simulate(folder.path(), "in.mcap", &["--robots", "1", "--seed", "2"]);
    write_database(&log, &folder.path().join("a.db3"), |topic| topic.starts_with("/robot1/"), <[u8]>::to_vec);
    let args = ["convert", "r9=a.db3", "-o", "out.mcap", "--rename", "/{robot}/map=/map", "--topics", "/r9/map"];
    gridweave(folder.path(), &args).assert(0, &[]);
    let converted = contents(&folder.path().join("out.mcap"));
    assert_eq!(converted.keys().collect::<Vec<_>>(), ["/r9/map"]);
}
