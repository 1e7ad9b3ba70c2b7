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

#[test]
fn the_grey_of_unknown_cells_of_cartographer_is_unknown_whatever_the_thresholds() {
    // Black walls, white free space and grey 128 between, with a few cells that were seen once.
    let cartographer = |unknown: u8| {
        let shades = [[0].repeat(4), [254].repeat(12), [unknown].repeat(40), vec![unknown - 10, unknown + 10]].concat();
        [b"P5\n# Cartographer map; 0.05 m/pixel\n58 1\n255\n".as_slice(), &shades].concat()
    };
    let read = |image: &[u8], more: &str| {
        let (folder, path) = folder(&format!("image: map.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n{more}"));
        fs::write(folder.path().join("map.pgm"), image).unwrap();
        let (map, warning) = load_as(&path, Thresholds::ByPicture).unwrap();
        let of = |cells: &[i8]| cells.first().copied().filter(|first| cells.iter().all(|cell| cell == first));
        let cells = [&map.cells[..4], &map.cells[4..16], &map.cells[16..56]].map(of);
        (cells, warning.map(|warning| warning.to_string()).unwrap_or_default())
    };
    let expected = [Some(100), Some(0), Some(-1)];
    let thresholds = |occupied: f64, free: f64| format!("occupied_thresh: {occupied}\nfree_thresh: {free}");
    assert_eq!(read(&cartographer(128), &thresholds(0.65, 0.196)), (expected, String::new()));
    for unknown in [127, 128] {
        let (cells, warning) = read(&cartographer(unknown), &thresholds(0.65, 0.6));
        assert_eq!(cells, expected);
        let start = format!("40 cells in grey {unknown} are read as unknown; with free_thresh 0.6 they would be free");
        assert!(warning.starts_with(&start), "{warning}");
        let (cells, warning) = read(&cartographer(unknown), &thresholds(0.4, 0.3));
        assert_eq!(cells, expected);
        assert!(warning.contains("with occupied_thresh 0.4 they would be occupied"), "{warning}");
        let scale = format!("mode: scale\n{}", thresholds(0.65, 0.196));
        assert_eq!(read(&cartographer(unknown), &scale).0, expected);
    }
    let inverted: Vec<u8> = cartographer(128).iter().rev().take(58).rev().map(|shade| 255 - shade).collect();
    let image = [b"P5\n58 1\n255\n".as_slice(), &inverted].concat();
    assert_eq!(read(&image, &format!("negate: 1\n{}", thresholds(0.4, 0.3))).0, expected);
    // Grey furniture on a floor plan, rarer than the walls, is as the thresholds say.
    let plan = [[0].repeat(30), [254].repeat(20), [128].repeat(8)].concat();
    let image = [b"P5\n58 1\n255\n".as_slice(), &plan].concat();
    let [walls, floor, furniture] = [0..30, 30..50, 50..58];
    let (folder, path) = folder(&yaml("").replace("0.65", "0.4"));
    fs::write(folder.path().join("map.pgm"), image).unwrap();
    let cells = load_as(&path, Thresholds::ByPicture).unwrap().0.cells;
    assert!(cells[walls].iter().chain(&cells[furniture]).all(|cell| *cell == 100));
    assert!(cells[floor].iter().all(|cell| *cell == 0));
}
