use super::*;
use gridweave_runtime::ros::{Point, Pose, Quaternion};
use image::{DynamicImage, ImageBuffer, Luma, LumaA, Rgba, RgbaImage};
use proptest::prelude::*;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

mod by_picture;

/// A folder with `map.yaml`, and the image `map.pgm` with the shades 0, 100, 205 above 254, 255, 50.
fn folder(yaml: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("map.pgm"), b"P5\n# made by hand\n3 2\n255\n\x00\x64\xcd\xfe\xff\x32").unwrap();
    let path = folder.path().join("map.yaml");
    fs::write(&path, yaml).unwrap();
    (folder, path)
}

fn yaml(more: &str) -> String {
    format!(
        "image: map.pgm\nresolution: 0.05\norigin: [1, -2.5, 0.5]\noccupied_thresh: 0.65\nfree_thresh: 0.25\n{more}"
    )
}

fn cells(yaml: &str) -> Vec<i8> {
    let (_folder, path) = folder(yaml);
    load(&path).unwrap().cells
}

fn error(yaml: &str) -> String {
    let (folder, path) = folder(yaml);
    load(&path).unwrap_err().to_string().replace(folder.path().to_str().unwrap(), "DIR")
}

#[test]
fn a_map_has_its_rows_from_bottom_to_top_and_an_origin_with_yaw() {
    let (_folder, path) = folder(&yaml("negate: 0"));
    let map = load(&path).unwrap();
    assert_eq!((map.info.width, map.info.height, map.info.resolution), (3, 2, 0.05));
    assert_eq!(map.info.origin.position, Point { x: 1.0, y: -2.5, z: 0.0 });
    assert!((map.info.origin.orientation.yaw() - 0.5).abs() < 1e-15);
    assert_eq!(map.cells, [0, 0, 100, 100, -1, 0]);
}

#[test]
fn modes_and_negation_read_shades_as_the_map_server_does() {
    // Occupancies: 254 -> 0.004, 255 -> 0, 50 -> 0.804; 0 -> 1, 100 -> 0.608, 205 -> 0.196.
    assert_eq!(cells(&yaml("mode: trinary\nnegate: false")), [0, 0, 100, 100, -1, 0]);
    assert_eq!(cells(&yaml("mode: scale")), [0, 0, 100, 100, 89, 0]);
    assert_eq!(cells(&yaml("mode: raw")), [-1, -1, 50, 0, 100, -1]);
    assert_eq!(cells(&yaml("negate: 1")), [100, 100, 0, 0, -1, 100]);
    assert_eq!(cells(&yaml("negate: true\nmode: scale")), [100, 100, 0, 0, 36, 100]);
}

#[test]
fn plain_text_and_other_depths_are_read() {
    let (folder, path) = folder(&yaml(""));
    let read = |name: &str, bytes: &[u8]| {
        fs::write(folder.path().join(name), bytes).unwrap();
        fs::write(&path, yaml("").replace("map.pgm", name)).unwrap();
        load(&path).unwrap().cells
    };
    assert_eq!(read("ascii.pgm", b"P2\n3 1\n255\n0 205 254\n"), [100, 0, 0]);
    assert_eq!(read("hundred.pgm", b"P2\n3 1\n100\n0 50 100\n"), [100, -1, 0]);
    assert_eq!(read("deep.pgm", b"P5\n2 1\n65535\n\x00\x00\xff\xff"), [100, 0]);
    assert_eq!(read("bits.pbm", b"P1\n2 1\n1 0\n"), [100, 0]);
    assert_eq!(read("packed.pbm", b"P4\n2 1\n\x80"), [100, 0]);
    assert_eq!(read("colour.ppm", b"P3\n2 1\n255\n0 0 255  255 255 255\n"), [100, 0]);
}

#[test]
fn png_is_read_with_its_opacity() {
    let (folder, path) = folder("");
    let read = |image: DynamicImage, more: &str| {
        image.save(folder.path().join("map.png")).unwrap();
        fs::write(&path, yaml(more).replace("map.pgm", "map.png")).unwrap();
        load(&path).unwrap().cells
    };
    let rgba = RgbaImage::from_fn(3, 1, |x, _| [[0, 0, 0, 255], [255; 4], [0, 0, 0, 0]].map(Rgba)[x as usize]);
    // Black and opaque: (0 + 0 + 0 + 255) / 4 is a shade of 0.25.
    assert_eq!(read(rgba.clone().into(), ""), [100, 0, 100]);
    assert_eq!(read(rgba.clone().into(), "mode: scale"), [100, 0, -1]);
    assert_eq!(read(rgba.into(), "mode: raw"), [0, -1, 0]);
    let grey = ImageBuffer::from_fn(3, 1, |x, _| [[100, 255], [255, 255], [100, 254]].map(LumaA)[x as usize]);
    // Three times grey and once opacity: (3 * 100 + 255) / 4 is a shade of 0.54.
    assert_eq!(read(DynamicImage::ImageLumaA8(grey.clone()), ""), [-1, 0, -1]);
    assert_eq!(read(DynamicImage::ImageLumaA8(grey), "mode: scale"), [89, 0, -1]);
    let deep = ImageBuffer::from_fn(2, 1, |x, _| Luma([x as u16 * 65535]));
    assert_eq!(read(DynamicImage::ImageLuma16(deep), ""), [100, 0]);
}

#[test]
fn opacity_does_not_change_what_a_picture_shows() {
    let (folder, path) = folder("");
    let read = |pixels: &[[u8; 4]]| {
        let image = RgbaImage::from_fn(pixels.len() as u32, 1, |x, _| Rgba(pixels[x as usize]));
        image.save(folder.path().join("map.png")).unwrap();
        fs::write(&path, yaml("").replace("map.pgm", "map.png")).unwrap();
        let (map, warning) = load_as(&path, Thresholds::ByPicture).unwrap();
        (map.cells, warning.map(|warning| warning.to_string()).unwrap_or_default())
    };
    let opaque = |grey: u8| [grey, grey, grey, 255];
    assert_eq!(read(&[opaque(0), opaque(70), opaque(254), opaque(254)]), (vec![100, 100, 0, 0], String::new()));
    assert_eq!(read(&[opaque(0), opaque(205), opaque(254)]).0, [100, -1, 0]);
    // Walls in grey, and in a colour.
    let (cells, warning) = read(&[opaque(110), opaque(254), opaque(254)]);
    assert_eq!(cells, [100, 0, 0]);
    assert!(warning.contains("the darkest cells, with occupancy 0.57, are read as occupied"), "{warning}");
    assert_eq!(read(&[[200, 60, 0, 255], opaque(254)]).0, [100, 0]);
    // Transparent black would be occupied.
    let (cells, warning) = read(&[[0, 0, 0, 0], [0, 0, 0, 0], opaque(0), opaque(254)]);
    assert_eq!(cells, [-1, -1, 100, 0]);
    assert!(warning.starts_with("2 transparent cells are read as unknown; --literal-thresholds"), "{warning}");
}

#[test]
fn numbers_may_be_quoted() {
    let quoted = "image: map.pgm\nresolution: '0.05'\norigin: ['1', \"-2.5\", 0.5]\noccupied_thresh: '0.65'\n\
                  free_thresh: \"0.25\"\nnegate: '0'";
    assert_eq!(cells(quoted), cells(&yaml("")));
    assert!(error(&yaml("").replace("0.05", "wide")).contains("expected a number, not `wide`"));
    for (wrong, right) in [("0,05", "0.05"), ("'-1,5'", "-1.5")] {
        let error = error(&yaml("").replace("0.05", wrong));
        assert!(error.contains(&format!("`; the decimal sign is a point: {right}")), "{error}");
    }
    assert!(error(&yaml("").replace("[1, -2.5, 0.5]", "[1,0, -2,5, 0,5]")).contains("the decimal sign is a point"));
}

#[test]
fn a_file_in_utf_16_is_read_as_its_byte_order_mark_says() {
    let (_folder, path) = folder("");
    let text = format!("\u{feff}{}", yaml("negate: 0"));
    fs::write(&path, text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>()).unwrap();
    assert_eq!(load(&path).unwrap().cells, [0, 0, 100, 100, -1, 0]);
}

#[test]
fn an_image_below_what_is_no_folder_here_is_read_beside_the_file() {
    let (folder, path) = folder(&yaml("").replace("map.pgm", "maps/map.pgm"));
    fs::write(folder.path().join("maps"), "").unwrap();
    assert!(load_as(&path, Thresholds::Literal).unwrap().1.unwrap().to_string().contains("cannot be reached"));
}

#[test]
fn a_saved_map_keeps_every_digit_of_its_origin() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a map: \"two\".yaml");
    let position = Point { x: -8.850000000000001, y: 1.0 / 3.0, z: 0.0 };
    let origin = Pose { position, orientation: Quaternion::from_yaw(-2.123456789012345) };
    let info = MapMetaData { resolution: 0.05, width: 3, height: 1, origin, ..Default::default() };
    save(&path, &GridMap { info, cells: vec![-1, 0, 100] }).unwrap();
    let map = load(&path).unwrap();
    assert_eq!((map.info.origin.position, map.info.resolution, map.cells), (position, 0.05, vec![-1, 0, 100]));
    assert!((map.info.origin.orientation.yaw() + 2.123456789012345).abs() < 1e-15);
    assert!(fs::read_to_string(&path).unwrap().contains("free_thresh: 0.196"));
}

#[test]
fn cells_between_are_saved_by_the_usual_thresholds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.yaml");
    let info = MapMetaData { resolution: 0.1, width: 4, height: 2, ..Default::default() };
    save(&path, &GridMap { info, cells: vec![0, 24, 25, 64, 65, 100, 101, -128] }).unwrap();
    assert_eq!(load(&path).unwrap().cells, [0, 0, -1, -1, 100, 100, -1, -1]);
}

proptest! {
    #[test]
    fn a_saved_map_is_loaded_unchanged(
        width in 1..20_usize,
        values in prop::collection::vec(prop::sample::select(vec![-1_i8, 0, 100]), 20..200),
        resolution in 0.001_f32..2.0,
        (x, y) in (-1e4..1e4, -1e4..1e4),
    ) {
        let height = values.len() / width;
        let cells = values[..width * height].to_vec();
        let position = Point { x, y, z: 0.0 };
        let (width, height) = (width as u32, height as u32);
        let origin = Pose { position, ..Default::default() };
        let map = GridMap { info: MapMetaData { resolution, width, height, origin, ..Default::default() }, cells };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("map.yaml");
        save(&path, &map).unwrap();
        prop_assert_eq!(load(&path).unwrap(), map);
    }
}

#[test]
fn invalid_values_are_reported_with_valid_ones() {
    assert!(error("").contains("DIR/map.yaml does not describe a map: missing field `image`"));
    assert!(error("image: [").contains("does not describe a map"));
    let without =
        |field: &str| error(&yaml("").lines().filter(|line| !line.starts_with(field)).collect::<Vec<_>>().join("\n"));
    for field in ["image", "resolution", "origin"] {
        assert!(without(field).contains(&format!("missing field `{field}`")), "{}", without(field));
    }
    let with = |from: &str, to: &str| error(&yaml("").replace(from, to));
    for value in ["\"\"", r#""a\nb.pgm""#, r#""\e[31m.pgm""#, &"a".repeat(5000)] {
        let text = with("map.pgm", value);
        assert!(text.contains("`image` is") && text.len() < 200 && !text.contains(char::is_control), "{text}");
    }
    for value in [".nan", "0", "-0.05", "1e-60", ".inf"] {
        assert!(with("0.05", value).contains("`resolution` is"), "{}", with("0.05", value));
    }
    for value in ["[0]", "[0, 0, 0, 0]", "[0, .nan, 0]", "[]"] {
        assert!(with("[1, -2.5, 0.5]", value).contains("`origin` must be three finite numbers"));
    }
    for value in ["[1e9, 0, 0]", "[0, -1e300, 0]"] {
        assert!(with("[1, -2.5, 0.5]", value).contains("`origin` is farther than 1e8 m"));
    }
    for value in ["1.5", "-0.1", "255", ".nan"] {
        assert!(with("0.65", value).contains("it must be between 0 and 1"), "{}", with("0.65", value));
    }
    assert!(with("0.65", "0.1").contains("`free_thresh` is 0.25; it must not be above `occupied_thresh`, 0.1"));
    assert!(error(&yaml("negate: perhaps")).contains("`negate` must be 0 or 1"));
    assert_eq!(
        error(&yaml("mode: trinery")),
        "DIR/map.yaml: `mode` is `trinery`, but only trinary, scale and raw exist; did you mean `trinary`?"
    );
}

#[test]
fn thresholds_and_a_yaw_that_are_left_out_and_thresholds_in_percent_are_read_with_a_warning() {
    let (_folder, path) = folder("image: map.pgm\nresolution: 0.05\norigin: [1, -2.5]");
    let (map, warning) = load_as(&path, Thresholds::Literal).unwrap();
    assert_eq!((map.info.origin.orientation.yaw(), map.cells), (0.0, cells(&yaml("").replace("0.25", "0.196"))));
    let expected = "its `origin` has no yaw, which is read as 0; it has no `occupied_thresh`, which is read as 0.65; it has no \
                    `free_thresh`, which is read as 0.196";
    assert_eq!(warning.unwrap().to_string(), expected);
    let percent = yaml("").replace("0.65", "65").replace("0.25", "25.0");
    assert_eq!(cells(&percent), cells(&yaml("")));
    let (_folder, path) = folder(&percent);
    let warning = load_as(&path, Thresholds::Literal).unwrap().1.unwrap().to_string();
    assert!(
        warning.starts_with("its `occupied_thresh`, 65, is read as percent: 0.65; its `free_thresh`, 25"),
        "{warning}"
    );
}

#[test]
fn missing_and_broken_files_are_reported() {
    let (folder, path) = folder(&yaml(""));
    let unreadable = load(&folder.path().join("other.yaml")).unwrap_err();
    let text = unreadable.to_string();
    assert!(text.starts_with("cannot read the map file") && text.contains("other.yaml: No such file"), "{text}");
    assert!(std::error::Error::source(&unreadable).is_none(), "its text says all");
    for bytes in [b"P5\n3 2\n255\n\x00".as_slice(), b"no image", b""] {
        fs::write(folder.path().join("map.pgm"), bytes).unwrap();
        let text = load(&path).unwrap_err().to_string();
        assert!(text.contains("map.pgm, the image of the map"), "{text}");
    }
    fs::remove_file(folder.path().join("map.pgm")).unwrap();
    assert!(load(&path).unwrap_err().to_string().contains("No such file"));
}

#[test]
fn an_image_that_claims_more_than_its_bytes_can_hold_is_an_error() {
    for header in ["P5\n20000 20000\n255\n", "P4 60000 60000\n", "P2 20000 20000 255\n", "P6\n9000 9000\n255\n"] {
        let (folder, path) = folder(&yaml(""));
        fs::write(folder.path().join("map.pgm"), format!("{header}abc")).unwrap();
        let error = load(&path).unwrap_err().to_string();
        assert!(error.contains("cannot hold the"), "{header}: {error}");
    }
}

/// A PNG image with a colour profile of so many zeros, and none if that is 0.
fn png(width: u32, height: u32, grey: u8, profile: usize) -> Vec<u8> {
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |kind: &[u8; 4], data: &[u8]| {
        bytes.extend((data.len() as u32).to_be_bytes());
        let body = [kind.as_slice(), data].concat();
        bytes.extend(&body);
        bytes.extend(crc32fast::hash(&body).to_be_bytes());
    };
    let packed = |length: usize, byte: u8| {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
        std::io::copy(&mut std::io::Read::take(std::io::repeat(byte), length as u64), &mut encoder).unwrap();
        encoder.finish().unwrap()
    };
    chunk(b"IHDR", &[&width.to_be_bytes()[..], &height.to_be_bytes(), &[8, 0, 0, 0, 0]].concat());
    if profile > 0 {
        chunk(b"iCCP", &[b"p\0\0", &packed(profile, 0)[..]].concat());
    }
    // Rows of a filter byte and pixels; of one byte repeated, the filter 1 (the difference to the pixel before).
    let row = [&[1][..], &[grey], &vec![0; width as usize - 1]].concat();
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    (0..height).for_each(|_| std::io::Write::write_all(&mut encoder, &row).unwrap());
    chunk(b"IDAT", &encoder.finish().unwrap());
    chunk(b"IEND", &[]);
    bytes
}

#[test]
fn an_image_is_limited_by_its_pixels_by_those_that_are_known_and_by_its_profile() {
    let (folder, path) = folder(&yaml("").replace("map.pgm", "map.png"));
    let read = |bytes: &[u8]| {
        fs::write(folder.path().join("map.png"), bytes).unwrap();
        load(&path)
    };
    // A profile that is too large is left out.
    for profile in [0, 1 << 20, 20 << 20] {
        assert!(read(&png(30, 20, 254, profile)).unwrap().cells.iter().all(|cell| *cell == 0));
    }
    let error = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
    // Decided before decoding: the pixels are not there.
    let mut claimed = png(100, 40_000, 254, 0);
    claimed[16..20].copy_from_slice(&30_000_u32.to_be_bytes());
    claimed[20..24].copy_from_slice(&30_000_u32.to_be_bytes());
    let checksum = crc32fast::hash(&claimed[12..29]);
    claimed[29..33].copy_from_slice(&checksum.to_be_bytes());
    claimed.extend(vec![0; 200_000]);
    let text = error(&claimed);
    assert!(text.contains("30000 x 30000 pixels, more than the maximum"), "{text}");
    let text = error(&png(5000, 4000, 150, 0));
    assert!(text.contains("only 0 of its 5000 x 4000 pixels are known"), "{text}");
    assert_eq!(read(&png(5000, 4000, 254, 0)).unwrap().cells.len(), 20_000_000);
}

#[test]
fn an_image_of_one_shade_is_read_however_small_its_file() {
    let (folder, path) = folder(&yaml("").replace("map.pgm", "map.png"));
    let image = DynamicImage::ImageLuma8(ImageBuffer::from_pixel(3000, 3000, Luma([150u8])));
    image.save(folder.path().join("map.png")).unwrap();
    assert!(fs::metadata(folder.path().join("map.png")).unwrap().len() < 9_000_000 / 10);
    assert!(load(&path).unwrap().cells.iter().all(|cell| *cell == -1));
}

#[test]
fn a_map_that_cannot_be_written_leaves_the_one_that_was_there() {
    let (folder, path) = folder(&yaml(""));
    let before = load(&path).unwrap();
    let names = || fs::read_dir(folder.path()).unwrap().count();
    // The image can be written, and the YAML file cannot.
    fs::create_dir(folder.path().join("map.yaml.part")).unwrap();
    let other = GridMap { cells: vec![0; before.cells.len()], ..before.clone() };
    assert!(save(&path, &other).unwrap_err().to_string().contains("map.yaml"));
    assert_eq!((load(&path).unwrap(), names()), (before, 3));
    fs::remove_dir(folder.path().join("map.yaml.part")).unwrap();
    save(&path, &other).unwrap();
    assert_eq!((load(&path).unwrap().cells, names()), (other.cells, 2));
}

#[test]
fn an_invalid_map_is_not_saved() {
    let folder = tempfile::tempdir().unwrap();
    let info = MapMetaData { resolution: 0.05, width: 2, height: 2, ..Default::default() };
    let map = GridMap { info, cells: vec![0; 4] };
    let error = |name: &str, map: &GridMap| save(&folder.path().join(name), map).unwrap_err().to_string();
    assert!(error("a.yaml", &GridMap { cells: vec![0; 3], ..map.clone() }).contains("width x height cells"));
    let info = MapMetaData { resolution: f32::NAN, ..map.info };
    assert!(error("a.yaml", &GridMap { info, ..map.clone() }).contains("resolution must be above 0"));
    assert!(error("a.pgm", &map).contains("give the YAML file"));
    assert!(error("missing/a.yaml", &map).contains("missing/a."));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn a_byte_order_mark_and_a_mode_in_capitals_are_read() {
    assert_eq!(cells(&format!("\u{feff}{}", yaml("mode: Trinary"))), cells(&yaml("mode: trinary")));
    assert_eq!(cells(&yaml("mode: RAW")), cells(&yaml("mode: raw")));
}

#[test]
fn an_image_beside_the_file_is_read_where_the_path_is_one_of_another_machine() {
    for named in ["/no/such/folder/map.pgm", "../elsewhere/map.pgm", "C:\\maps\\map.pgm", "office.pgm"] {
        let (folder, path) = folder(&yaml("").replace("map.pgm", named));
        let (map, warning) = load_as(&path, Thresholds::Literal).unwrap();
        assert_eq!(map.cells, cells(&yaml("")), "{named}");
        let beside = folder.path().join("map.pgm");
        assert_eq!(image_of(&path).unwrap(), beside);
        let warning = warning.unwrap().to_string();
        assert!(warning.ends_with(&format!("cannot be reached; {} is read", beside.display())), "{warning}");
    }
    // One that exists is read whatever lies beside the file, and what is missing everywhere is an error.
    let (folder, path) = folder(&yaml("").replace("map.pgm", "sub/map.pgm"));
    fs::create_dir(folder.path().join("sub")).unwrap();
    fs::write(folder.path().join("sub/map.pgm"), b"P5\n1 1\n255\n\xff").unwrap();
    assert_eq!(load_as(&path, Thresholds::Literal).unwrap(), (load(&path).unwrap(), None));
    assert_eq!(load(&path).unwrap().cells, [0]);
    fs::remove_file(folder.path().join("map.pgm")).unwrap();
    fs::remove_file(folder.path().join("sub/map.pgm")).unwrap();
    assert!(load(&path).unwrap_err().to_string().contains("sub/map.pgm"), "the image that the file names");
}

#[test]
fn an_image_of_another_format_says_what_it_is_and_one_in_other_case_is_found() {
    let (folder, path) = folder(&yaml(""));
    let image = folder.path().join("map.pgm");
    let whole = fs::read(&image).unwrap();
    for (bytes, reason) in [
        (&b"II*\0..."[..], "it is a TIFF image; PGM, PPM, PBM, PNG, BMP and JPEG are read"),
        (b"GIF89a", "it is a GIF image"),
        (b"RIFF\x10\0\0\0WEBP", "it is a WebP image"),
        (b"version https://git-lfs.github.com/spec/v1\n", "`git lfs pull`"),
        (b"\n<!DOCTYPE html><html>", "it is a page of HTML"),
    ] {
        fs::write(&image, bytes).unwrap();
        let error = load(&path).unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    }
    fs::remove_file(&image).unwrap();
    fs::write(folder.path().join("Map.PGM"), whole).unwrap();
    let (map, warning) = load_as(&path, Thresholds::Literal).unwrap();
    assert_eq!(map.cells.len(), 6);
    assert!(warning.unwrap().to_string().contains("Map.PGM"));
}
