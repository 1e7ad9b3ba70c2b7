//! Maps that are not read literally, but as their images show.

use super::*;

#[test]
fn the_image_overrides_the_thresholds_with_a_note() {
    let read = |bytes: &[u8], more: &str| {
        let (folder, path) = folder(&yaml(more));
        fs::write(folder.path().join("map.pgm"), bytes).unwrap();
        let (map, warning) = load_as(&path, Thresholds::ByPicture).unwrap();
        (map.cells, warning.map(|warning| warning.to_string()).unwrap_or_default())
    };
    let (cells, warning) = read(b"P5\n4 1\n255\n\x00\xcd\xcd\xfe", "");
    assert_eq!(cells, [100, -1, -1, 0]);
    assert!(
        warning.starts_with("2 cells in grey 205 are read as unknown; with free_thresh 0.25 they would be free"),
        "{warning}"
    );
    assert!(warning.ends_with("--literal-thresholds reads the file literally"), "{warning}");
    // A file in shades of grey without opacity has no other sign of what is unknown.
    assert_eq!(read(b"P5\n4 1\n255\n\x00\xcd\xcd\xfe", "mode: scale").0, [100, -1, -1, 0]);
    // With nav2's own threshold it is a small occupancy, which is free space as well.
    let (folder, path) = folder(&yaml("mode: scale").replace("free_thresh: 0.25", "free_thresh: 0.196"));
    fs::write(folder.path().join("map.pgm"), b"P5\n4 1\n255\n\x00\xcd\xcd\xfe").unwrap();
    assert_eq!(load_as(&path, Thresholds::ByPicture).unwrap().0.cells, [100, -1, -1, 0]);
    // Where white is occupied, 205 is nearly so, and 50 is unknown.
    let (cells, warning) = read(b"P5\n4 1\n255\n\x00\xcd\xcd\xfe", "negate: 1");
    assert_eq!(cells, [0, 100, 100, 100]);
    assert!(warning.starts_with("3 cells are occupied and 1 are free: if its image is inverted"), "{warning}");
    let (cells, warning) = read(b"P5\n4 1\n255\n\xff\x32\x32\x01", "negate: 1");
    assert_eq!(cells, [100, -1, -1, 0]);
    assert!(warning.starts_with("2 cells in grey 50 are read as unknown"), "{warning}");
    // 16 bits of which each is 256 times one of 8: 205 becomes 204.
    let (cells, warning) = read(b"P5\n4 1\n65535\n\x00\x00\xcd\x00\xcd\x00\xfe\x00", "");
    assert_eq!(cells, [100, -1, -1, 0]);
    assert!(warning.starts_with("2 cells in grey 204 are read as unknown"), "{warning}");
    // A shade of a gradient.
    assert_eq!(read(b"P5\n4 1\n255\n\x00\xcc\xcd\xce", "").0, [100, 0, 0, 0]);
    let (cells, warning) = read(b"P5\n4 1\n255\n\x6e\x6e\xcd\xfe", "");
    assert_eq!(cells, [100, 100, -1, 0]);
    assert!(warning.contains("the darkest cells, with occupancy 0.57, are read as occupied"), "{warning}");
}

#[test]
fn the_mode_raw_of_an_image_in_other_shades_is_warned_of() {
    let read = |bytes: &[u8]| {
        let (folder, path) = folder(&yaml("mode: raw"));
        fs::write(folder.path().join("map.pgm"), bytes).unwrap();
        let (map, warning) = load_as(&path, Thresholds::ByPicture).unwrap();
        (map.cells, warning.map(|warning| warning.to_string()).unwrap_or_default())
    };
    let (cells, warning) = read(b"P5\n4 1\n255\n\x00\xcd\xfe\xfe");
    assert_eq!(cells, [0, -1, -1, -1]);
    let expected = "3 pixels have shades from 101 to 254, which `mode: raw` reads as unknown, and 1 are occupancies";
    assert!(warning.starts_with(expected) && warning.ends_with("set `mode: trinary`"), "{warning}");
    assert_eq!(read(b"P5\n4 1\n255\n\x00\x64\xff\xff"), (vec![0, 100, -1, -1], String::new()));
}

#[test]
fn an_image_that_was_a_jpeg_is_read_by_its_clear_shades() {
    // Per level: 200 pixels of the clear shade, and some beside it.
    let levels = [(0u8, 0..=6u8), (205, 201..=209), (254, 249..=255)];
    let shades: Vec<u8> = levels.into_iter().flat_map(|(clear, near)| [clear; 200].into_iter().chain(near)).collect();
    let mut image = format!("P5\n{} 1\n255\n", shades.len()).into_bytes();
    image.extend(&shades);
    let (folder, path) = folder(&yaml("negate: 0"));
    fs::write(folder.path().join("map.pgm"), image).unwrap();
    let (map, warning) = load_as(&path, Thresholds::ByPicture).unwrap();
    let count = |value: i8| map.cells.iter().filter(|cell| **cell == value).count();
    assert_eq!([100, -1, 0].map(count), [207, 209, 207]);
    let warning = warning.unwrap().to_string();
    assert!(warning.starts_with("209 cells in grey 201 to 209 are read as unknown") && warning.contains("JPEG"));
}

#[test]
fn bmp_and_jpeg_are_read() {
    let (folder, path) = folder("");
    // Blocks of eight pixels, as in a JPEG.
    let shades = [0u8, 205, 254];
    let image = ImageBuffer::from_fn(24, 8, |x, _| Luma([shades[x as usize / 8]]));
    for name in ["map.bmp", "map.jpg"] {
        DynamicImage::ImageLuma8(image.clone()).save(folder.path().join(name)).unwrap();
        fs::write(&path, yaml("").replace("map.pgm", name)).unwrap();
        let (map, warning) = load_as(&path, Thresholds::ByPicture).unwrap();
        let middle: Vec<i8> = [4, 12, 20].map(|column| map.cells[3 * 24 + column]).into();
        assert_eq!(middle, [100, -1, 0], "{name}: {warning:?}");
    }
}
