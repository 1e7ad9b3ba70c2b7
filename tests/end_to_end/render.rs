//! Pictures of logs and map files.

use crate::support::{MARKUP, gridweave, merged_folder};
use gridweave_logs::picture::robot_colour;
use std::fs;

#[test]
fn a_picture_is_written_in_the_format_of_its_name_and_is_the_same_every_time() {
    let folder = merged_folder();
    for (name, magic) in [("a.png", &b"\x89PNG"[..]), ("a.SVG", b"<svg"), ("a.pdf", b"%PDF")] {
        let args = ["render", "merged.mcap", "-o", name, "--show", "all", "--grid", "1"];
        let says = "robot1 and robot2 aligned, and <script>alert(1)<&'\" beside them";
        gridweave(folder.path(), &args).assert(0, &[says]);
        let first = fs::read(folder.path().join(name)).unwrap();
        assert!(first.starts_with(magic), "{name}");
        gridweave(folder.path(), &args).assert(0, &[]);
        assert!(fs::read(folder.path().join(name)).unwrap() == first, "{name}");
    }
    let svg = fs::read_to_string(folder.path().join("a.SVG")).unwrap();
    assert!(!svg.contains(MARKUP) && !svg.contains("<script"));
    for title in
        ["walls found", "tags, 2 sigma", "drives", "directions of the walls", "ways and places", "deformation, "]
    {
        assert!(svg.contains(&format!("<title>{title}")), "{title}");
    }
}

#[test]
fn maps_are_drawn_merged_apart_and_one_by_one() {
    let folder = merged_folder();
    let width = |args: &[&str]| {
        gridweave(folder.path(), &[&["render", "merged.mcap", "-o", "a.png"], args].concat()).assert(0, &[]);
        let picture = image::open(folder.path().join("a.png")).unwrap().to_rgb8();
        let count = |robot| picture.pixels().filter(|pixel| pixel.0 == robot_colour(robot)).count();
        // Names are by the alphabet: the strange one is the first.
        (picture.width(), [0, 1, 2].map(|robot| count(robot) > 400))
    };
    assert_eq!(width(&["--robot", "robot2"]).1, [false, false, true]);
    assert_eq!(width(&["--merged"]).1, [false, false, false]);
    assert_eq!(width(&["--apart"]).1, [true, true, true]);
    assert_eq!(width(&["--at", "1"]).1, [true, true, true], "nothing is merged yet");
}

#[test]
fn inputs_that_cannot_be_drawn_are_errors() {
    let folder = merged_folder();
    let refused = |args: &[&str], words: &str| {
        gridweave(folder.path(), &[&["render", "merged.mcap"], args].concat()).assert(2, &[words]);
    };
    refused(&["-o", "a.jpg"], "a.jpg has an unsupported extension; use .png, .svg or .pdf");
    refused(&["-o", "a.png", "--robot", "robot3"], "there is no map of a robot `robot3`");
    refused(&["-o", "a.png", "--grid", "0"], "--grid: a line every 0 m cannot be drawn");
    refused(&["-o", "a.png", "--at=-1"], "--at must be 0 s or more");
    refused(&["-o", "a.png", "--show", "everything"], "invalid value 'everything'");
    assert!(!folder.path().join("a.png").exists());
    gridweave(folder.path(), &["render", "nothing.mcap", "-o", "a.png"]).assert(1, &["nothing.mcap"]);
}
