//! Messages are ordered by log time, file and position.

use super::*;
use proptest::prelude::*;

/// The position of the body of each record with the given opcode.
fn bodies(file: &[u8], opcode: u8) -> Vec<usize> {
    let mut found = Vec::new();
    let mut position = mcap::MAGIC.len();
    while let Some(record) = record::record_at(file, position) {
        if record.opcode == opcode {
            found.push(position + record::HEAD);
        }
        position = record.end();
    }
    found
}

fn write_files(folder: &Folder, files: &[Vec<(u8, u64, bool)>], options: &mcap::WriteOptions) -> Vec<PathBuf> {
    let write = |(index, messages): (usize, &Vec<(u8, u64, bool)>)| {
        let mut log = TestLog::new(options.clone());
        for (place, (topic, time, ends_chunk)) in messages.iter().enumerate() {
            log.raw(&format!("/topic{topic}"), "p/msg/A", *time, &(place as u32).to_le_bytes());
            if *ends_chunk {
                log.flush();
            }
        }
        folder.write(&format!("{index}.mcap"), &log.finish())
    };
    files.iter().enumerate().map(write).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn messages_are_ordered_by_time_then_file_then_position(
        files in prop::collection::vec(
            prop::collection::vec((0u8..3, 0u64..20, prop::bool::weighted(0.2)), 0..40),
            1..4,
        ),
        layout in 0usize..4,
        summary: bool,
        indexes: bool,
    ) {
        let folder = Folder::new();
        let options = layouts()[layout].clone().emit_summary_records(summary).emit_message_indexes(indexes);
        let (seen, damage) = read_all(open(&write_files(&folder, &files, &options)).unwrap());
        let mut expected: Vec<_> = files
            .iter()
            .enumerate()
            .flat_map(|(file, messages)| {
                messages.iter().enumerate().map(move |(place, (topic, time, _))| (*time, file, place, *topic))
            })
            .collect();
        expected.sort_unstable();
        let expected: Vec<ReadMessage> = expected
            .into_iter()
            .map(|(time, file, place, topic)| {
                (file, format!("/topic{topic}"), time, (place as u32).to_le_bytes().to_vec())
            })
            .collect();
        prop_assert_eq!(seen, expected);
        prop_assert!(damage.is_empty(), "{:?}", damage);
    }
}

#[test]
fn a_chunk_header_that_contradicts_its_index_is_not_used() {
    let folder = Folder::new();
    for options in &layouts()[1..] {
        let mut file = TestLog::new(options.clone());
        file.raw("/a", "p/msg/A", 5, b"5").raw("/a", "p/msg/A", 9, b"9").flush().raw("/a", "p/msg/A", 1, b"1");
        let mut file = file.finish();
        // The header of the last chunk claims that it begins at time 8.
        let chunk = *bodies(&file, mcap::records::op::CHUNK).last().unwrap();
        file[chunk..chunk + 8].copy_from_slice(&8u64.to_le_bytes());
        let (seen, damage) = read_all(open(&[folder.write("a.mcap", &file)]).unwrap());
        assert_eq!(times(&seen), [1, 5, 9]);
        assert_eq!(damage, []);
    }
}

#[test]
fn an_index_that_hides_an_early_message_keeps_log_times_ascending() {
    let folder = Folder::new();
    let mut file = TestLog::new(layouts()[1].clone());
    file.raw("/a", "p/msg/A", 5, b"5").raw("/a", "p/msg/A", 9, b"9").flush().raw("/a", "p/msg/A", 1, b"1");
    let mut file = file.finish();
    let late = 8u64.to_le_bytes();
    let chunk = *bodies(&file, mcap::records::op::CHUNK).last().unwrap();
    file[chunk..chunk + 8].copy_from_slice(&late);
    file[chunk + 8..chunk + 16].copy_from_slice(&late);
    let index = *bodies(&file, mcap::records::op::MESSAGE_INDEX).last().unwrap();
    file[index + 6..index + 14].copy_from_slice(&late);
    let (seen, damage) = read_all(open(&[folder.write("a.mcap", &file)]).unwrap());
    assert_eq!(times(&seen), [5, 5, 9]);
    assert_eq!(seen[1].3, b"1");
    assert_eq!(damage, [Damage::LateMessage]);
}

#[test]
fn the_fields_of_a_message_are_read() {
    let folder = Folder::new();
    for options in layouts() {
        let mut log = TestLog::new(options);
        log.raw("/a", "p/msg/A", 7, b"seven").raw("/b", "std_msgs/msg/Header", 8, b"");
        let mut reader = open(&[folder.write("a.mcap", &log.finish())]).unwrap();
        let message = reader.next_message().unwrap();
        assert_eq!(
            (message.sequence, message.log_time.0, message.publish_time, message.data),
            (1, 7, 6, &b"seven"[..])
        );
        let number = reader.next_message().unwrap().channel;
        let channel = reader.files()[0].channel(number).unwrap();
        assert_eq!((channel.topic.as_str(), channel.schema_name.as_str()), ("/b", "std_msgs/msg/Header"));
        assert_eq!((channel.message_encoding.as_str(), channel.schema_encoding.as_str()), ("cdr", "ros2msg"));
        assert!(channel.schema.starts_with(b"builtin_interfaces/Time stamp"));
        assert!(reader.next_message().is_none());
        assert!(reader.next_message().is_none());
        assert_eq!(reader.progress(), 1.0);
    }
}

#[test]
fn more_chunks_than_are_prefetched_are_all_read() {
    let folder = Folder::new();
    let mut log = TestLog::new(layouts()[3].clone().chunk_size(Some(100_000)));
    for time in 0..400u64 {
        let noise: Vec<u8> = (0..5000u64).map(|byte| ((byte * time * 31) >> 3) as u8).collect();
        log.raw("/a", "p/msg/A", time, &noise);
    }
    let (seen, damage) = read_all(open(&[folder.write("a.mcap", &log.finish())]).unwrap());
    assert_eq!(times(&seen), (0..400).collect::<Vec<_>>());
    assert_eq!(damage, []);
}

#[test]
fn messages_do_not_depend_on_those_read_before() {
    let folder = Folder::new();
    let message = |time: u64| -> Vec<u8> {
        // Blocks grow, shrink and overlap.
        let size = [400_000, 90_000, 150_000, 100, 70_000, 1_000_000][time as usize % 6];
        (0..size).map(|byte: u64| ((byte * (time + 1)) >> 5) as u8).collect()
    };
    for options in layouts() {
        let mut log = TestLog::new(options.chunk_size(Some(80_000)));
        for time in (0..60).map(|time| time ^ 3) {
            log.raw("/a", "p/msg/A", time, &message(time));
        }
        let (seen, damage) = read_all(open(&[folder.write("a.mcap", &log.finish())]).unwrap());
        assert_eq!(times(&seen), (0..60).collect::<Vec<_>>());
        assert!(seen.iter().zip(0..).all(|(seen, time)| seen.3 == message(time)));
        assert_eq!(damage, []);
    }
}

#[test]
fn individually_compressed_messages_are_decompressed() {
    let folder = Folder::new();
    for options in layouts() {
        let mut log = TestLog::new(options);
        let long = vec![7; 100_000];
        for (time, data) in [(2, &long), (1, &b"short".to_vec())] {
            log.raw("/a", "p/msg/A", time, &zstd::bulk::compress(data, 1).unwrap());
        }
        log.raw("/a", "p/msg/A", 3, b"plain");
        let (seen, damage) = read_all(open(&[folder.write("a.mcap", &log.finish())]).unwrap());
        let data: Vec<&[u8]> = seen.iter().map(|seen| &seen.3[..]).collect();
        assert_eq!((data, damage), (vec![&b"short"[..], &long, b"plain"], vec![]));
    }
}

/// A log of five chunks with a message of 400 KB at the times of each, and of one at a later time.
fn chunks(options: &mcap::WriteOptions, times: impl Fn(u64) -> [u64; 2], data: &[u8]) -> Vec<u8> {
    let mut log = TestLog::new(options.clone());
    for chunk in 0..5 {
        for time in times(chunk) {
            log.raw("/a", "p/msg/A", time, data);
        }
        log.flush();
    }
    log.raw("/a", "p/msg/A", 200, b"last");
    log.finish()
}

#[test]
fn chunks_that_overlap_in_time_take_limited_memory_and_the_others_are_reported() {
    let folder = Folder::new();
    let plain = vec![0; 400 << 10];
    let packed = zstd::bulk::compress(&plain, 1).unwrap();
    // Chunks that are compressed, or not, and messages that are.
    let [_, bare, lz4, zstd] = layouts();
    for (options, data) in [(&bare, &plain), (&lz4, &plain), (&zstd, &plain), (&bare, &packed), (&zstd, &packed)] {
        let read = |times: fn(u64) -> [u64; 2], most: u64| {
            let path = folder.write("a.mcap", &chunks(options, times, data));
            let mut reader = LogReader::new(vec![LogFile::open(path).unwrap()]);
            reader.limit_overlap(most);
            read_all(reader)
        };
        let after_each_other: fn(u64) -> [u64; 2] = |chunk| [10 * chunk, 10 * chunk + 5];
        let (seen, damage) = read(after_each_other, 2 << 20);
        assert_eq!((seen.len(), damage), (11, Vec::new()));
        let (seen, damage) = read(|chunk| [chunk, 100 + chunk], 2 << 20);
        assert_eq!(times(&seen), [0, 1, 100, 101, 200], "two chunks are read");
        assert!(seen[..4].iter().all(|(.., data)| data.len() == 400 << 10));
        assert_eq!(damage, vec![Damage::BadChunk { fault: ChunkFault::Overlap }; 3]);
        // One chunk is read, however large it is.
        let (seen, damage) = read(after_each_other, 1000);
        assert_eq!((seen.len(), damage), (11, Vec::new()));
    }
}

#[test]
fn individually_compressed_messages_take_limited_room_in_all_chunks_together() {
    let folder = Folder::new();
    let plain = vec![0; 400 << 10];
    let packed = zstd::bulk::compress(&plain, 1).unwrap();
    let [_, bare, _, zstd] = layouts();
    for (options, data, read) in [(&bare, &packed, 4), (&zstd, &packed, 4), (&zstd, &plain, 11)] {
        let path = folder.write("a.mcap", &chunks(options, |chunk| [10 * chunk, 10 * chunk + 5], data));
        let mut reader = LogReader::new(vec![LogFile::open(path).unwrap()]);
        reader.limit_unpacked(2 << 20);
        let (seen, damage) = read_all(reader);
        assert_eq!(seen.len(), read);
        let lost = if read < 11 { 4 } else { 0 };
        assert_eq!(damage, vec![Damage::BadChunk { fault: ChunkFault::Expansion }; lost], "the rest is not unpacked");
    }
}
