//! Files that cannot be read at all give an error with the reason and a fix.

use super::*;

fn error(path: PathBuf) -> ReadError {
    match open(&[path]) {
        Err(error) => error,
        Ok(_) => panic!("it was opened"),
    }
}

#[test]
fn missing_and_empty_files_have_different_errors() {
    let folder = Folder::new();
    assert!(matches!(error(folder.path().join("none.mcap")), ReadError::Missing { .. }));
    assert!(matches!(error(folder.write("empty.mcap", b"")), ReadError::Empty { .. }));
    assert!(matches!(open(&[]), Err(ReadError::NothingGiven)));
    assert!(matches!(error(folder.path()), ReadError::Empty { .. }), "a folder is read as the logs in it");
    let bare = Folder::new();
    assert!(matches!(error(bare.path()), ReadError::NotABag { .. }));
}

#[test]
fn a_folder_of_maps_or_of_bags_is_an_error_that_names_them() {
    let folder = Folder::new();
    assert!(error(folder.path()).to_string().ends_with("give the log file itself"));
    let bag = folder.write("one.bag", b"");
    let inner = folder.path().join("two");
    std::fs::create_dir(&inner).unwrap();
    std::fs::write(inner.join("two_0.mcap"), b"").unwrap();
    let text = error(folder.path()).to_string();
    let expected = format!("give the bags in it: {} {}", bag.display(), inner.display());
    assert!(text.ends_with(&expected), "{text}");
    folder.write("params.yaml", b"a: 1");
    let maps: Vec<String> = (0..6)
        .map(|number| {
            let text = b"image: a.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
            folder.write(&format!("map{number}.yaml"), text).display().to_string()
        })
        .collect();
    let text = error(folder.path()).to_string();
    assert!(text.ends_with(&format!("give the maps in it: {} ...", maps[..5].join(" "))), "{text}");
}

#[test]
fn another_file_type_is_reported_with_a_fix() {
    let folder = Folder::new();
    let text = error(folder.write("a.bag", b"#ROSBAG V1.2\n\x45\0\0\0op=\x03")).to_string();
    assert!(text.contains("a.bag") && text.contains("ROS 1 bag"), "{text}");
    let text = error(folder.write("a.db3", b"SQLite format 3\0")).to_string();
    assert!(text.contains("cannot read the database"), "{text}");
}

#[test]
fn a_log_cut_before_its_first_message_is_an_error() {
    let folder = Folder::new();
    let whole = three_chunks(layouts()[3].clone());
    for length in [1, 5, 8, 12, 40, 60] {
        let error = error(folder.write("cut.mcap", &whole[..length]));
        assert!(matches!(error, ReadError::NothingLeft { .. }), "{length}: {error}");
    }
}

#[test]
fn a_log_without_messages_is_valid() {
    let folder = Folder::new();
    for options in layouts() {
        let (seen, damage) = read_all(open(&[folder.write("a.mcap", &TestLog::new(options).finish())]).unwrap());
        assert!(seen.is_empty() && damage.is_empty());
    }
}

#[test]
fn a_bag_folder_is_read_in_the_order_of_its_description() {
    let folder = Folder::new();
    let mut log = TestLog::new(layouts()[0].clone());
    let one = folder.write("bag_0.mcap", &{
        log.raw("/a", "p/msg/A", 3, b"0");
        log.finish()
    });
    let mut log = TestLog::new(layouts()[3].clone());
    log.raw("/a", "p/msg/A", 3, b"1");
    folder.write("bag_1.mcap", &log.finish());
    let seen = read_all(open(&[folder.path()]).unwrap()).0;
    assert_eq!(seen.iter().map(|seen| &seen.3[..]).collect::<Vec<_>>(), [b"0", b"1"], "by name without a description");
    let description = folder.write(
        "metadata.yaml",
        b"rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  relative_file_paths:\n    - bag_1.mcap\n    - bag_0.mcap\n",
    );
    for path in [folder.path(), description.clone()] {
        let seen = read_all(open(&[path]).unwrap()).0;
        assert_eq!(seen.iter().map(|seen| &seen.3[..]).collect::<Vec<_>>(), [b"1", b"0"]);
    }
    assert!(matches!(open(&[folder.path(), one]), Err(ReadError::Duplicate { .. })));
    for outside in ["../bag_0.mcap", "/etc/passwd", "bag/../../bag_0.mcap"] {
        let text = format!("rosbag2_bagfile_information: {{relative_file_paths: [{outside}]}}");
        std::fs::write(&description, text).unwrap();
        assert!(error(folder.path()).to_string().contains("is outside of the bag"), "{outside}");
    }
    for empty in ["", "\n", "\0\0\0"] {
        std::fs::write(&description, empty).unwrap();
        for path in [folder.path(), description.clone()] {
            let seen = read_all(open(&[path]).unwrap()).0;
            assert_eq!(seen.iter().map(|seen| &seen.3[..]).collect::<Vec<_>>(), [b"0", b"1"], "as without one");
        }
    }
    std::fs::write(&description, "hello: [").unwrap();
    assert!(matches!(error(folder.path()), ReadError::BagDescription { .. }));
}
