//! Damaged files are read as far as possible.

use super::*;
use std::collections::BTreeSet;

fn open_bytes(folder: &Folder, bytes: &[u8]) -> Result<(Vec<ReadMessage>, Vec<Damage>), ReadError> {
    open(&[folder.write("damaged.mcap", bytes)]).map(read_all)
}

fn read_damaged(bytes: &[u8]) -> (Vec<ReadMessage>, Vec<Damage>) {
    open_bytes(&Folder::new(), bytes).unwrap()
}

fn summary_of(bytes: &[u8]) -> summary::SummarySection {
    let path = Folder::new();
    summary::SummarySection::read(&bytes::FileBytes::open(&path.write("in.mcap", bytes)).unwrap())
}

#[test]
fn a_file_truncated_anywhere_gives_its_first_messages_and_is_reported() {
    let folder = Folder::new();
    for options in layouts() {
        let whole = three_chunks(options);
        let all = read_damaged(&whole).0;
        assert_eq!(all.len(), 12);
        let mut most = 0;
        for length in (0..whole.len()).step_by(3) {
            let Ok((seen, damage)) = open_bytes(&folder, &whole[..length]) else { continue };
            assert_eq!(seen, all[..seen.len()], "cut at {length}");
            assert!(damage.iter().any(|damage| matches!(damage, Damage::NoEnd { .. })), "cut at {length}");
            assert!(seen.len() >= most, "more bytes give no fewer messages (cut at {length})");
            most = seen.len();
        }
        assert_eq!(most, 12, "all messages are there before the summary is");
    }
}

#[test]
fn no_flipped_byte_makes_the_reader_panic_or_invent_contents() {
    let folder = Folder::new();
    for (layout, options) in layouts().into_iter().enumerate() {
        let whole = three_chunks(options);
        let all: BTreeSet<Vec<u8>> = read_damaged(&whole).0.into_iter().map(|seen| seen.3).collect();
        for place in (0..whole.len()).step_by(3) {
            for flip in [0x01, 0xff] {
                let mut bytes = whole.clone();
                bytes[place] ^= flip;
                let Ok((seen, _)) = open_bytes(&folder, &bytes) else { continue };
                // Only chunks have a checksum; a checksum flipped to zero disables the check, but then the data is
                // intact.
                if layout > 0 {
                    assert!(seen.len() <= 12 && seen.iter().all(|seen| all.contains(&seen.3)), "byte {place}");
                }
            }
        }
    }
}

#[test]
fn a_chunk_with_a_wrong_checksum_is_skipped_and_the_rest_is_read() {
    for options in &layouts()[1..2] {
        let mut bytes = three_chunks(options.clone());
        let place = bytes.windows(40).position(|window| window == [11; 40]).unwrap();
        bytes[place] ^= 1;
        let (seen, damage) = read_damaged(&bytes);
        assert_eq!(times(&seen), [0, 1, 2, 3, 20, 21, 22, 23]);
        assert_eq!(damage, [Damage::BadChunk { fault: ChunkFault::Checksum }]);
    }
}

#[test]
fn a_chunk_of_an_unknown_compression_is_skipped_with_its_name() {
    for options in &layouts()[2..] {
        let mut bytes = three_chunks(options.clone());
        let is_name = |window: &[u8]| window == b"\x04\0\0\0zstd" || window.starts_with(b"\x03\0\0\0lz4");
        let name = bytes.windows(8).position(is_name).unwrap() + 4;
        bytes[name] = b'x';
        let (seen, damage) = read_damaged(&bytes);
        assert_eq!(times(&seen), [10, 11, 12, 13, 20, 21, 22, 23]);
        assert!(
            matches!(&damage[..], [Damage::BadChunk { fault: ChunkFault::UnknownCompression(name) }] if name.starts_with('x'))
        );
    }
}

#[test]
fn a_broken_length_in_the_middle_loses_one_chunk_only() {
    for options in &layouts()[1..] {
        let whole = three_chunks(options.clone());
        let summary = summary_of(&whole);
        let [_, second, third] = summary.chunk_starts[..] else { panic!() };
        for length in [u64::MAX, 1 << 40, 20, 0] {
            let mut bytes = whole.clone();
            bytes[second + 1..second + 9].copy_from_slice(&length.to_le_bytes());
            let (seen, damage) = read_damaged(&bytes);
            assert_eq!(times(&seen)[..4], [0, 1, 2, 3], "{length}");
            assert_eq!(times(&seen)[seen.len() - 4..], [20, 21, 22, 23], "{length}");
            let reaches_third = |damage: &Damage| matches!(damage, Damage::Unreadable { position, length } if position + length == third);
            assert!(damage.iter().any(reaches_third), "{length}: {damage:?}");
        }
    }
}

#[test]
fn lengths_in_chunks_that_nothing_can_have_lose_these_chunks_only() {
    for options in &layouts()[1..] {
        let whole = three_chunks(options.clone());
        let summary = summary_of(&whole);
        let [_, second, third] = summary.chunk_starts[..] else { panic!() };
        // After the record's header: two times, the size of the contents, their checksum, the compression, their
        // length.
        let size = |chunk: usize| chunk + record::HEAD + 16;
        let name = |chunk: usize| size(chunk) + 12;
        let compression = |chunk: usize| u32::from_le_bytes(whole[name(chunk)..][..4].try_into().unwrap()) as usize;
        let length = |chunk: usize| name(chunk) + 4 + compression(chunk);
        for absurd in [u64::MAX, u64::MAX - 30, 1 << 40, 0xffff_ffff] {
            for (places, left) in [
                (vec![size(second)], vec![0, 1, 2, 3, 20, 21, 22, 23]),
                (vec![size(second), size(third)], vec![0, 1, 2, 3]),
                (vec![length(second)], vec![0, 1, 2, 3, 20, 21, 22, 23]),
            ] {
                let mut bytes = whole.clone();
                places.iter().for_each(|at| bytes[*at..at + 8].copy_from_slice(&absurd.to_le_bytes()));
                let (seen, damage) = read_damaged(&bytes);
                assert_eq!((times(&seen), damage.len()), (left, places.len()), "{absurd} at {places:?}: {damage:?}");
            }
        }
    }
}

#[test]
fn a_chunk_with_an_unusual_compression_ratio_is_read_whole() {
    for options in layouts() {
        let mut log = TestLog::new(options);
        log.raw("/a", "p/msg/A", 1, &vec![0; 3_000_000]);
        let (seen, damage) = read_damaged(&log.finish());
        assert_eq!((seen[0].3.len(), damage), (3_000_000, vec![]));
    }
}

#[test]
fn the_log_of_a_killed_recorder_is_read() {
    let folder = Folder::new();
    for options in layouts() {
        let path = folder.path().join("live.mcap");
        let mut writer = options.create(std::fs::File::create(&path).unwrap()).unwrap();
        let schema = writer.add_schema("p/msg/A", "ros2msg", b"").unwrap();
        let channel_id = writer.add_channel(schema, "/a", "cdr", &Default::default()).unwrap();
        for time in 0..200u64 {
            let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: 0 };
            let noise: Vec<u8> = (0..5000u64).map(|byte| ((byte * byte * (time + 7)) >> 5) as u8).collect();
            writer.write_to_known_channel(&header, &noise).unwrap();
            if time == 99 {
                writer.flush().unwrap();
            }
        }
        let copy = folder.path().join("copy.mcap");
        std::fs::copy(&path, &copy).unwrap();
        writer.finish().unwrap();
        let (seen, damage) = read_all(open(&[copy]).unwrap());
        assert!(seen.len() >= 100);
        assert_eq!(times(&seen), (0..seen.len() as u64).collect::<Vec<_>>());
        assert!(matches!(damage[..], [Damage::NoEnd { .. }]), "{damage:?}");
        assert_eq!(read_all(open(&[path]).unwrap()).0.len(), 200);
    }
}

#[test]
fn zeros_behind_a_file_that_lost_power_are_not_messages() {
    let mut bytes = three_chunks(layouts()[0].clone());
    let mut end = mcap::MAGIC.len();
    while end < bytes.len() / 2 {
        end = record::record_at(&bytes, end).unwrap().end();
    }
    bytes.truncate(end);
    let before = read_damaged(&bytes).0;
    bytes.extend([0; 5000]);
    let (seen, damage) = read_damaged(&bytes);
    assert_eq!(seen, before);
    assert!(matches!(damage[..], [Damage::NoEnd { .. }]));
}

#[test]
fn an_index_with_a_wrong_checksum_is_not_used() {
    let mut bytes = three_chunks(layouts()[3].clone());
    let place = bytes.len() - mcap::MAGIC.len() - 40;
    bytes[place] ^= 1;
    let (seen, damage) = read_damaged(&bytes);
    assert_eq!(seen.len(), 12);
    assert_eq!(damage, [Damage::BadIndex]);
}

#[test]
fn a_file_truncated_anywhere_while_it_is_read_is_reported() {
    for options in layouts() {
        let mut log = TestLog::new(options);
        // More blocks than are prefetched.
        for time in 0..40 {
            log.raw("/a", "p/msg/A", time, &noise(time, 1 << 20)).flush();
        }
        let bytes = log.finish();
        let folder = Folder::new();
        for left in [0, 10, bytes.len() / 2 + 77] {
            let path = folder.write("in.mcap", &bytes);
            let mut reader = LogReader::new(vec![LogFile::open(&path).unwrap()]);
            for _ in 0..3 {
                assert!(reader.next_message().is_some());
            }
            std::fs::File::options().write(true).open(&path).unwrap().set_len(left as u64).unwrap();
            let (seen, damage) = read_all(reader);
            assert!(seen.len() < 37 && times(&seen) == (3..seen.len() as u64 + 3).collect::<Vec<_>>());
            assert_eq!(damage, [Damage::Changed]);
        }
    }
}

#[test]
fn nothing_is_read_after_the_position_where_a_file_was_modified() {
    let [cut, whole] = ["/a", "/b"].map(|topic| {
        let mut log = TestLog::new(layouts()[0].clone());
        for time in 0..40 {
            log.raw(topic, "p/msg/A", time, &noise(time, 1 << 20)).flush();
        }
        log.finish()
    });
    let folder = Folder::new();
    let paths = [folder.write("cut.mcap", &cut), folder.write("whole.mcap", &whole)];
    let mut reader = open(&paths).unwrap();
    std::fs::write(&paths[0], b"").unwrap();
    let mut seen = [0, 0];
    while let Some(message) = reader.next_message() {
        let file = message.file;
        seen[file] += 1;
        if reader.take_damage() == [(0, Damage::Changed)] {
            assert_eq!(file, 1);
            std::fs::write(&paths[0], &cut).unwrap();
            seen[0] = 100;
        }
    }
    assert_eq!(seen, [100, 40]);
    assert!(reader.take_damage().is_empty());
}

/// Incompressible bytes.
fn noise(seed: u64, count: usize) -> Vec<u8> {
    let next =
        |state: &u64| Some(state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407));
    std::iter::successors(Some(seed), next).skip(1).map(|state| (state >> 33) as u8).take(count).collect()
}
