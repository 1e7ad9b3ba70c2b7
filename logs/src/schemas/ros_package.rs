//! `logs/msg/gridweave_msgs` is a colcon package: it must list all its messages, and all packages that these use.

use super::*;
use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

fn package() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("msg/gridweave_msgs")
}

fn messages() -> BTreeSet<String> {
    let files = fs::read_dir(package().join("msg")).unwrap().map(|entry| entry.unwrap().file_name());
    files.map(|name| name.to_str().unwrap().to_owned()).collect()
}

/// All texts between two others.
fn between<'a>(text: &'a str, before: &'a str, after: &'a str) -> BTreeSet<String> {
    text.split(before).skip(1).filter_map(|rest| Some(rest.split_once(after)?.0.to_owned())).collect()
}

#[test]
fn the_package_lists_all_its_messages_which_are_those_that_are_written() {
    let list = fs::read_to_string(package().join("CMakeLists.txt")).unwrap();
    assert_eq!(between(&list, "\"msg/", "\""), messages());
    let ours = schema_names().filter_map(|name| Some(format!("{}.msg", name.strip_prefix("gridweave_msgs/msg/")?)));
    assert_eq!(ours.collect::<BTreeSet<_>>(), messages());
}

#[test]
fn the_package_depends_on_the_packages_of_its_fields() {
    let mut used = BTreeSet::new();
    for message in messages() {
        let text = fs::read_to_string(package().join("msg").join(message)).unwrap();
        used.extend(text.lines().filter_map(|line| Some(line.split_once('/')?.0.to_owned())).filter(|package| {
            package.chars().all(|letter| letter.is_ascii_lowercase() || letter == '_') && package != "gridweave_msgs"
        }));
    }
    assert!(used.contains("std_msgs"), "{used:?}");
    let manifest = fs::read_to_string(package().join("package.xml")).unwrap();
    assert_eq!(between(&manifest, "<depend>", "</depend>"), used);
    let list = fs::read_to_string(package().join("CMakeLists.txt")).unwrap();
    let named = between(&list, "DEPENDENCIES ", "\n")
        .into_iter()
        .flat_map(|names| names.split(' ').map(str::to_owned).collect::<Vec<_>>());
    assert_eq!(named.collect::<BTreeSet<_>>(), used);
    let found = between(&list, "find_package(", " ");
    assert!(used.iter().all(|package| found.contains(package)), "{found:?}");
}

#[test]
fn the_package_has_the_version_of_the_crates_and_fields_that_ros_takes() {
    let manifest = fs::read_to_string(package().join("package.xml")).unwrap();
    assert_eq!(between(&manifest, "<version>", "</version>"), BTreeSet::from([env!("CARGO_PKG_VERSION").to_owned()]));
    for message in messages() {
        let text = fs::read_to_string(package().join("msg").join(&message)).unwrap();
        for line in
            text.lines().map(|line| line.split('#').next().unwrap_or_default().trim()).filter(|line| !line.is_empty())
        {
            let [_, name] = line.split_whitespace().collect::<Vec<_>>()[..] else { panic!("{message}: {line}") };
            let is_plain =
                name.chars().all(|letter| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '_');
            let is_named = name.starts_with(|letter: char| letter.is_ascii_lowercase()) && !name.ends_with('_');
            assert!(is_plain && is_named && !name.contains("__"), "{message}: {line}");
        }
    }
}
