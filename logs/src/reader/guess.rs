//! What a file that is not an MCAP log looks like.

/// What the first bytes of a file that is not MCAP say, and what would mend it.
pub(crate) fn looks_like(bytes: &[u8]) -> (&'static str, &'static str) {
    const CONVERT: &str = "convert it: `ros2 bag convert -i BAG -o out.yaml` with `storage_id: mcap` in out.yaml";
    const KNOWN: [(&[u8], &str, &str); 9] = [
        (b"#ROSBAG V", "a ROS 1 bag", "convert it to a ROS 2 bag in MCAP, for example with `rosbags-convert`"),
        (b"SQLite format 3", "a ROS 2 bag in SQLite (.db3)", CONVERT),
        (b"\x28\xb5\x2f\xfd", "a file packed with zstd", "unpack it with `zstd -d`"),
        (b"\x1f\x8b", "a file packed with gzip", "unpack it with `gunzip`"),
        (b"BZh", "a file packed with bzip2", "unpack it with `bunzip2`"),
        (b"PK\x03\x04", "a ZIP archive", "unpack it with `unzip`"),
        (b"\x89PNG", "a PNG image", "name the map's .yaml file"),
        (b"\x89MCAP0\n", "an MCAP log that was copied as text", "copy it again in binary mode"),
        (b"\x89MCAP", "an MCAP log of another version of the format", "convert it with the program that wrote it"),
    ];
    if let Some((_, what, cure)) = KNOWN.iter().find(|(start, ..)| bytes.starts_with(start)) {
        return (what, cure);
    }
    let head = &bytes[..bytes.len().min(256)];
    if head.iter().all(|&byte| byte == 0) {
        return ("nothing but zeros", "the disk may have lost it; take another copy");
    }
    match head.iter().all(|&byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace()) {
        true => ("text", "name an .mcap file"),
        false => ("data of another kind", "name an .mcap file"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bags_of_other_kinds_are_named_with_a_cure() {
        assert_eq!(looks_like(b"#ROSBAG V2.0\n").0, "a ROS 1 bag");
        let (what, cure) = looks_like(b"SQLite format 3\0\x10");
        assert!(what.contains(".db3") && cure.contains("ros2 bag convert"));
        assert_eq!(looks_like(b"image: map.pgm\nresolution: 0.05\n").0, "text");
        assert_eq!(looks_like(b"\x89MCAP0\n\x01").0, "an MCAP log that was copied as text");
        assert_eq!(looks_like(&[0; 20]).0, "nothing but zeros");
        assert_eq!(looks_like(b"\xff\xfe\x00").0, "data of another kind");
    }
}
