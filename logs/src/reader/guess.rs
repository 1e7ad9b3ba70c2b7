//! The type of a file that is not a log, by its first bytes.

/// The type of a file that is not a log, and how to make it readable.
pub(crate) fn looks_like(bytes: &[u8]) -> (&'static str, &'static str) {
    const KNOWN: [(&[u8], &str, &str); 7] = [
        (b"#ROSBAG V", "a ROS 1 bag of an old version of the format", "convert it with `rosbag fix`"),
        (b"\x1f\x8b", "a gzip file", "decompress it with `gunzip`"),
        (b"BZh", "a bzip2 file", "decompress it with `bunzip2`"),
        (b"PK\x03\x04", "a ZIP archive", "extract it with `unzip`"),
        (b"\x89PNG", "a PNG image", "give the map's .yaml file"),
        (b"\x89MCAP0\n", "an MCAP log that was copied as text", "copy it again in binary mode"),
        (b"\x89MCAP", "an MCAP log of another version of the format", "convert it with the program that wrote it"),
    ];
    if let Some((_, what, fix)) = KNOWN.iter().find(|(start, ..)| bytes.starts_with(start)) {
        return (what, fix);
    }
    let head = &bytes[..bytes.len().min(256)];
    if head.iter().all(|&byte| byte == 0) {
        return ("nothing but zeros", "the disk may have lost it; use another copy");
    }
    match head.iter().all(|&byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace()) {
        true => ("text", "give an .mcap file"),
        false => ("data of unknown type", "give an .mcap file"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_file_types_are_recognised_with_a_fix() {
        let (what, fix) = looks_like(b"#ROSBAG V1.2\n");
        assert!(what.starts_with("a ROS 1 bag of an old version") && fix.contains("rosbag fix"));
        assert_eq!(looks_like(b"image: map.pgm\nresolution: 0.05\n").0, "text");
        assert_eq!(looks_like(b"\x89MCAP0\n\x01").0, "an MCAP log that was copied as text");
        assert_eq!(looks_like(&[0; 20]).0, "nothing but zeros");
        assert_eq!(looks_like(b"\xff\xfe\x00").0, "data of unknown type");
    }
}
