use crate::reader::tests::read_file;
use crate::reader::{Damage, LogFile, ReadError, open};
use crate::schemas::schema_text;
use crate::test_log::Folder;
use gridweave_runtime::ros::{PoseStamped, RosMessage, encode};
use rusqlite::Connection;
use std::fs;
use std::path::PathBuf;

/// The tables that rosbag2 creates up to Humble.
const TABLES: &str = "
    CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,
        serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL);
    CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL);
    CREATE INDEX timestamp_idx ON messages (timestamp ASC);
";

/// Writes a bag with two topics and returns its path; `messages` are topic, time and bytes.
fn bag(folder: &Folder, name: &str, messages: &[(i64, u64, Vec<u8>)]) -> PathBuf {
    let path = folder.path().join(name);
    let mut connection = Connection::open(&path).unwrap();
    connection.execute_batch(TABLES).unwrap();
    let topics = [(1, "/robot1/pose", PoseStamped::NAME), (7, "/x", "p/msg/X")];
    for (id, topic, name) in topics {
        let values = (id, topic, name, "cdr", "- durability: 1");
        connection.execute("INSERT INTO topics VALUES (?1, ?2, ?3, ?4, ?5)", values).unwrap();
    }
    let transaction = connection.transaction().unwrap();
    for (topic, time, data) in messages {
        let query = "INSERT INTO messages (topic_id, timestamp, data) VALUES (?1, ?2, ?3)";
        transaction.execute(query, (topic, *time as i64, data)).unwrap();
    }
    transaction.commit().unwrap();
    connection.close().unwrap();
    path
}

/// Rows whose messages differ in length and order.
fn many(count: u64) -> Vec<(i64, u64, Vec<u8>)> {
    let row = |number: u64| {
        let time = 1000 + (number ^ 3);
        (if number.is_multiple_of(3) { 7 } else { 1 }, time, vec![number as u8; 20 + (number as usize * 37) % 9000])
    };
    (0..count).map(row).collect()
}

#[test]
fn messages_are_read_by_time_with_their_types() {
    let folder = Folder::new();
    let pose = encode(&PoseStamped::default()).unwrap();
    let path = bag(
        &folder,
        "a.db3",
        &[(7, 30, b"late".to_vec()), (1, 10, pose.clone()), (7, 20, b"x".to_vec()), (9, 20, vec![1])],
    );
    let (messages, damage) = read_file(&path).unwrap();
    let expected =
        [("/robot1/pose", 10, pose), ("/x", 20, b"x".to_vec()), ("", 20, vec![1]), ("/x", 30, b"late".to_vec())];
    assert_eq!(messages, expected.map(|(topic, time, data)| (topic.to_owned(), time, data)));
    assert_eq!(damage, []);
    let file = LogFile::open(&path).unwrap();
    let [(_, one), (_, two)] = &file.channels().collect::<Vec<_>>()[..] else { panic!() };
    assert_eq!(one.schema, schema_text(PoseStamped::NAME).unwrap().into_bytes());
    assert_eq!(
        (one.message_encoding.as_str(), one.metadata["offered_qos_profiles"].as_str()),
        ("cdr", "- durability: 1")
    );
    assert_eq!((two.schema_name.as_str(), two.schema.as_slice()), ("p/msg/X", &[][..]));
    assert_eq!((file.container().as_str(), file.first_time()), ("SQLite", Some(10)));
}

#[test]
fn definitions_that_a_database_holds_count() {
    let folder = Folder::new();
    let path = bag(&folder, "a.db3", &[(7, 1, vec![0])]);
    let connection = Connection::open(&path).unwrap();
    let more = "
        CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
            encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
        INSERT INTO message_definitions VALUES (1, 'p/msg/X', 'ros2msg', 'int8 x', 'RIHS01_1');
        CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
        INSERT INTO metadata VALUES (1, 9, 'version: 9');
        ALTER TABLE topics ADD COLUMN type_description_hash TEXT NOT NULL DEFAULT 'RIHS01_1';";
    connection.execute_batch(more).unwrap();
    connection.close().unwrap();
    let file = LogFile::open(&path).unwrap();
    let (_, channel) = file.channels().nth(1).unwrap();
    assert_eq!((channel.schema.as_slice(), channel.schema_encoding.as_str()), (&b"int8 x"[..], "ros2msg"));
    assert_eq!(channel.metadata["topic_type_hash"], "RIHS01_1");
    assert_eq!(file.metadata("rosbag2").unwrap()["serialized_metadata"], "version: 9");
}

#[test]
fn long_bags_are_read_in_runs_and_no_file_is_created() {
    let folder = Folder::new();
    let rows = many(3000);
    let path = bag(&folder, "a#b?c%.db3", &rows);
    let before = fs::read(&path).unwrap();
    let (messages, damage) = read_file(&path).unwrap();
    assert!(messages.len() == rows.len() && messages.is_sorted_by_key(|(_, time, _)| *time));
    let mut expected: Vec<_> = rows.iter().map(|(_, time, data)| (*time, data.clone())).collect();
    expected.sort();
    assert!(messages.into_iter().map(|(_, time, data)| (time, data)).eq(expected));
    assert_eq!(damage, []);
    assert!(LogFile::open(&path).unwrap().layout.blocks.len() > 5);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    assert!(fs::read(&path).unwrap() == before);
}

#[test]
fn a_truncated_or_damaged_database_is_read_as_far_as_possible() {
    let folder = Folder::new();
    let rows = many(400);
    let whole = fs::read(bag(&folder, "a.db3", &rows)).unwrap();
    let is_of_bag = |messages: &[(String, u64, Vec<u8>)]| {
        messages.iter().filter(|(_, time, data)| rows.iter().any(|(_, at, bytes)| at == time && bytes == data)).count()
    };
    let mut most = 0;
    for part in 1..40 {
        let path = folder.write("cut.db3", &whole[..whole.len() * part / 40]);
        match read_file(&path) {
            Ok((messages, damage)) => {
                assert!(damage.iter().any(|damage| matches!(damage, Damage::NoEnd { .. })), "{part}: {damage:?}");
                assert_eq!(is_of_bag(&messages), messages.len(), "{part}");
                most = most.max(messages.len());
            }
            Err(error) => {
                assert!(matches!(error, ReadError::Database { .. } | ReadError::NothingLeft { .. }), "{error}")
            }
        }
    }
    assert!(most > 300, "{most}");
    // A lost page in the middle loses its messages, those that continue on it, and at worst those of all pages under
    // it.
    let (mut reported, mut all) = (0, 0);
    for page in 10..60 {
        let mut bytes = whole.clone();
        bytes[page * 4096..][..4096].fill(0xa5);
        let (messages, damage) = read_file(&folder.write("bad.db3", &bytes)).unwrap();
        let right = is_of_bag(&messages);
        assert!(right > 150 && messages.len() - right < 10, "{page}: {right} of {}", messages.len());
        all += right;
        reported += usize::from(!damage.is_empty());
    }
    assert!(reported > 10 && all > 50 * 350, "{reported} {all}");
}

#[test]
fn other_databases_are_reported_and_their_code_is_not_run() {
    let folder = Folder::new();
    let made = |name: &str, text: &str| {
        let path = folder.path().join(name);
        Connection::open(&path).unwrap().execute_batch(text).unwrap();
        path
    };
    let other = made("other.db3", "CREATE TABLE people(name TEXT)");
    assert!(read_file(&other).unwrap_err().to_string().contains("no table `topics`"));
    let endless = "CREATE TABLE topics(id, name, type);
        CREATE VIEW messages AS WITH RECURSIVE r(id) AS (SELECT 1 UNION ALL SELECT 1 FROM r) SELECT id FROM r;";
    assert!(read_file(&made("view.db3", endless)).unwrap_err().to_string().contains("no table `messages`"));
    let empty = bag(&folder, "empty.db3", &[]);
    assert_eq!(read_file(&empty).unwrap(), (Vec::new(), Vec::new()));
    let short = folder.write("short.db3", b"SQLite form");
    assert!(matches!(read_file(&short), Err(ReadError::NothingLeft { .. })));
}

/// Writes a database with these statements and returns its path.
fn database(folder: &Folder, name: &str, statements: &str) -> PathBuf {
    let path = folder.path().join(name);
    Connection::open(&path).unwrap().execute_batch(statements).unwrap();
    path
}

#[test]
fn computed_columns_and_views_are_refused() {
    let folder = Folder::new();
    let topics = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT,
        offered_qos_profiles TEXT); INSERT INTO topics VALUES (1, '/x', 'p/msg/X', 'cdr', '');";
    let messages = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);
        INSERT INTO messages(topic_id, timestamp) VALUES (1, 1);";
    let error = |name: &str, statements: &str| read_file(&database(&folder, name, statements)).unwrap_err().to_string();
    let computed = messages.replace("data BLOB", "data BLOB AS (zeroblob(999999999))");
    let text = error("data.db3", &format!("{topics}{computed}"));
    assert!(text.contains("the column `data` of its table `messages` is computed"), "{text}");
    let computed =
        topics.replace("offered_qos_profiles TEXT", "offered_qos_profiles TEXT AS (hex(zeroblob(400000000)))");
    let computed = computed.replace(", '')", ")");
    let text = error("topics.db3", &format!("{computed}{messages}"));
    assert!(text.contains("the column `offered_qos_profiles` of its table `topics` is computed"), "{text}");
    // What the schema calls a table is a view.
    let renamed = "PRAGMA writable_schema = ON;
        UPDATE sqlite_schema SET sql = 'CREATE VIEW messages AS WITH RECURSIVE r(topic_id) AS (SELECT 1 UNION ALL
            SELECT 1 FROM r) SELECT topic_id, 1 AS timestamp, NULL AS data FROM r' WHERE name = 'messages';";
    let text = error("view.db3", &format!("{topics}{messages}{renamed}"));
    assert!(text.contains("`messages`"), "{text}");
    let text =
        error("virtual.db3", &format!("{topics}CREATE VIRTUAL TABLE messages USING fts5(topic_id, timestamp, data);"));
    assert!(text.contains("its schema has `CREATE VIRTUAL TABLE"), "{text}");
    // Definitions that are computed are not read.
    let definitions = "CREATE TABLE message_definitions(topic_type TEXT DEFAULT 'p/msg/X', encoding TEXT,
        encoded_message_definition TEXT AS (hex(zeroblob(400000000)))); INSERT INTO message_definitions DEFAULT VALUES;";
    let path = database(&folder, "definitions.db3", &format!("{topics}{messages}{definitions}"));
    assert_eq!(LogFile::open(&path).unwrap().channels().count(), 1);
}

#[test]
fn a_column_does_not_hide_the_number_of_a_row() {
    let folder = Folder::new();
    let tables = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT,
        offered_qos_profiles TEXT); INSERT INTO topics VALUES (1, '/x', 'p/msg/X', 'cdr', '');
        CREATE TABLE messages(topic_id INTEGER, timestamp INTEGER, data BLOB, rowid INTEGER, _ROWID_ INTEGER);
        WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n WHERE i < 39999)
            INSERT INTO messages SELECT 1, i, x'01', 7, 7 FROM n;";
    let path = database(&folder, "rowid.db3", tables);
    let (messages, damage) = read_file(&path).unwrap();
    assert!(messages.len() == 40_000 && messages.is_sorted_by_key(|(_, time, _)| *time));
    assert_eq!(damage, []);
    for (name, columns) in
        [("all.db3", "data, rowid, _rowid_, oid"), ("none.db3", "data PRIMARY KEY) WITHOUT ROWID; --")]
    {
        let other = tables.replace("data BLOB, rowid INTEGER, _ROWID_ INTEGER", columns);
        let other = other.split("WITH RECURSIVE").next().unwrap();
        let text = read_file(&database(&folder, name, other)).unwrap_err().to_string();
        assert!(text.contains("have no number"), "{text}");
    }
}

#[test]
fn messages_take_no_more_than_the_file_holds() {
    const PAGE: usize = 4096;
    let folder = Folder::new();
    // Rows that share the pages of one of them, as only a forged database has them.
    let path =
        bag(&folder, "a.db3", &[(7, 1, vec![1; 40 * PAGE]), (7, 2, vec![2; 40 * PAGE]), (7, 3, vec![3; 40 * PAGE])]);
    let mut bytes = fs::read(&path).unwrap();
    let root = |connection: &Connection| {
        let query = "SELECT rootpage FROM sqlite_schema WHERE name = 'messages'";
        connection.query_row(query, [], |row| row.get::<_, i64>(0)).unwrap() as usize
    };
    let start = (root(&Connection::open(&path).unwrap()) - 1) * PAGE;
    let number = |bytes: &[u8], at: usize| usize::from(u16::from_be_bytes([bytes[at], bytes[at + 1]]));
    assert_eq!((bytes[start], number(&bytes, start + 3)), (0x0d, 3), "a leaf with three rows");
    // The end of each cell is the number of the first page on which it continues.
    let cells: Vec<usize> = (0..3).map(|cell| number(&bytes, start + 8 + 2 * cell)).collect();
    let length = cells[0] - cells[1];
    let first = bytes[start + cells[0] + length - 4..][..4].to_vec();
    for cell in &cells {
        bytes[start + cell + length - 4..][..4].copy_from_slice(&first);
    }
    // The other pages are cut off.
    let pages = 60_u32;
    bytes.truncate(pages as usize * PAGE);
    bytes[28..32].copy_from_slice(&pages.to_be_bytes());
    let (messages, damage) = read_file(&folder.write("shared.db3", &bytes)).unwrap();
    assert_eq!(messages.len(), 1, "{damage:?}");
    assert!(damage.iter().any(|damage| matches!(damage, Damage::LostRows { .. })), "{damage:?}");
}

#[test]
fn the_journal_of_a_killed_recorder_is_reported() {
    let folder = Folder::new();
    let path = bag(&folder, "a.db3", &many(3));
    folder.write("a.db3-wal", b"more");
    let (messages, damage) = read_file(&path).unwrap();
    assert_eq!(messages.len(), 3);
    assert!(matches!(&damage[..], [Damage::NotClosed { rest }] if rest.ends_with("a.db3-wal")));
}

#[test]
fn a_database_with_all_messages_in_its_journal_is_reported_as_that() {
    let folder = Folder::new();
    let path = folder.path().join("a.db3");
    let recorder = Connection::open(&path).unwrap();
    recorder.execute_batch(&format!("PRAGMA journal_mode = WAL; PRAGMA wal_autocheckpoint = 0; {TABLES}")).unwrap();
    // As a killed recorder leaves both: a database without tables, and one without bytes.
    let journal = fs::read(folder.path().join("a.db3-wal")).unwrap();
    for (name, database) in [("early.db3", fs::read(&path).unwrap()), ("empty.db3", Vec::new())] {
        let copy = folder.write(name, &database);
        folder.write(&format!("{name}-wal"), &journal);
        let error = read_file(&copy).unwrap_err();
        assert!(matches!(&error, ReadError::OnlyJournal { journal, .. } if journal.ends_with(format!("{name}-wal"))));
        assert!(error.to_string().contains("wal_checkpoint"), "{error}");
    }
    // Tables, and no message.
    let path = bag(&folder, "tables.db3", &[]);
    folder.write("tables.db3-wal", &journal);
    assert!(matches!(read_file(&path), Err(ReadError::OnlyJournal { .. })));
}

#[test]
fn compressed_files_and_messages_are_decompressed() {
    let folder = Folder::new();
    let pack = |bytes: &[u8]| zstd::bulk::compress(bytes, 1).unwrap();
    let rows = many(50);
    let compressed: Vec<_> = rows.iter().map(|(topic, time, data)| (*topic, *time, pack(data))).collect();
    let expected = read_file(&bag(&folder, "plain.db3", &rows)).unwrap();
    assert_eq!(read_file(&bag(&folder, "messages.db3", &compressed)).unwrap(), expected);
    let whole = pack(&fs::read(folder.path().join("plain.db3")).unwrap());
    let path = folder.write("plain.db3.zstd", &whole);
    assert_eq!(read_file(&path).unwrap(), expected);
    assert_eq!(LogFile::open(&path).unwrap().container(), "SQLite, compressed with zstd");
    let cut = folder.write("cut.db3.zstd", &whole[..whole.len() / 2]);
    match read_file(&cut) {
        Ok((_, damage)) => assert!(damage.contains(&Damage::TruncatedCompressedFile)),
        Err(error) => assert!(matches!(error, ReadError::Database { .. } | ReadError::Empty { .. }), "{error}"),
    }
    // A message that only starts like a compressed one is unchanged.
    let odd = [crate::reader::compressed::ZSTD_MAGIC, b"odd"].concat();
    let (messages, _) = read_file(&bag(&folder, "odd.db3", &[(7, 1, odd.clone())])).unwrap();
    assert_eq!(messages[0].2, odd);
}

#[test]
fn a_folder_is_read_with_or_without_metadata() {
    let folder = Folder::new();
    let inner = folder.path().join("bag");
    fs::create_dir(&inner).unwrap();
    bag(&folder, "bag/bag_0.db3", &[(7, 5, vec![5])]);
    bag(&folder, "bag/bag_1.db3", &[(7, 4, vec![4])]);
    let times = || {
        let mut reader = open(std::slice::from_ref(&inner)).unwrap();
        std::iter::from_fn(|| reader.next_message().map(|message| message.log_time.0)).collect::<Vec<_>>()
    };
    assert_eq!(times(), [4, 5]);
    let describe = |files: &str| {
        let text = format!(
            "rosbag2_bagfile_information:\n  version: 3\n  storage_identifier: sqlite3\n  relative_file_paths: [{files}]\n"
        );
        fs::write(inner.join("metadata.yaml"), text).unwrap();
    };
    describe("bag_1.db3");
    assert_eq!(times(), [4]);
    describe("bag/bag_0.db3");
    assert_eq!(times(), [5], "names up to Foxy include the bag's folder");
    let compressed = zstd::bulk::compress(&fs::read(inner.join("bag_0.db3")).unwrap(), 1).unwrap();
    fs::write(inner.join("bag_0.db3.zstd"), compressed).unwrap();
    fs::remove_file(inner.join("bag_0.db3")).unwrap();
    describe("bag_0.db3, bag_1.db3");
    assert_eq!(times(), [4, 5]);
}

#[test]
fn views_that_name_each_other_twice_take_no_time() {
    let folder = Folder::new();
    let mut statements = format!("{TABLES} CREATE VIEW v0 AS SELECT 1 AS x;");
    for number in 1..60 {
        let before = number - 1;
        statements += &format!("CREATE VIEW v{number} AS SELECT a.x FROM v{before} AS a, v{before} AS b;");
    }
    statements += "INSERT INTO messages (topic_id, timestamp, data) VALUES (1, 1, x'00');";
    assert_eq!(read_file(&database(&folder, "views.db3", &statements)).unwrap().0.len(), 1);
}

#[test]
fn messages_that_a_default_value_gives_are_read_up_to_the_size_of_the_file() {
    let folder = Folder::new();
    let zeros = "00".repeat(100_000);
    let statements = format!(
        "{} WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n WHERE i < 20000)
            INSERT INTO messages (topic_id, timestamp) SELECT 1, i FROM n;
        ALTER TABLE messages ADD COLUMN data BLOB DEFAULT x'{zeros}';",
        TABLES.replace(", data BLOB NOT NULL", "")
    );
    // An index that claims that they are empty, and that it is the best one.
    let index = "CREATE INDEX claims ON messages (id, timestamp, octet_length(data));
        ANALYZE; UPDATE sqlite_stat1 SET stat = '1 1 1 1'; PRAGMA writable_schema = ON;";
    for (name, more) in [("a.db3", ""), ("b.db3", index)] {
        let path = database(&folder, name, &format!("{statements}{more}"));
        let length = fs::metadata(&path).unwrap().len();
        let (messages, damage) = read_file(&path).unwrap();
        assert!(messages.iter().map(|(_, _, data)| data.len() as u64).sum::<u64>() <= length);
        assert!(damage.len() < 20 && matches!(damage.last(), Some(Damage::ExcessRows { .. })), "{damage:?}");
    }
}
