//! Robot names from the names of files.

use super::Input;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

/// The error when files cannot be used as robot names.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FileNameError {
    /// A file is given twice.
    #[error("{0} is given twice; give each file once")]
    GivenTwice(PathBuf),
    /// Two robots would have the same name.
    #[error(
        "{one} and {other} would both be named `{name}`; rename one of these files or folders, or give ROBOT={other}",
        one = one.display(), other = other.display()
    )]
    SameName {
        /// The name.
        name: String,
        /// The first file.
        one: PathBuf,
        /// The second.
        other: PathBuf,
    },
}

/// A robot name for each file of a map or log, in the order of the files: the file name without its extension, or where
/// several files have the same name, the name of the innermost folders that differ. A folder's name has no extension.
/// Characters that are not allowed in a topic are replaced by `_`.
///
/// # Errors
///
/// A file is given twice, or two robots would have the same name.
pub fn robot_names(files: &[PathBuf]) -> Result<Vec<String>, FileNameError> {
    check_once(files)?;
    let stems: Vec<String> = files.iter().map(|file| own_name(file)).collect();
    let name = |(file, stem): (&PathBuf, &String)| {
        let named_alike = files.iter().zip(&stems).filter(|(_, other)| *other == stem).map(|(file, _)| file);
        match named_alike.clone().count() {
            1 => stem.clone(),
            _ => folder_name(file, height_of_difference(named_alike)).unwrap_or_default(),
        }
    };
    let names: Vec<String> = files.iter().zip(&stems).map(name).collect();
    check_distinct(names.iter().zip(files))?;
    Ok(names)
}

/// Map files with their robots: `ROBOT=FILE` names one, and a robot without a name gets it as by [`robot_names`].
///
/// # Errors
///
/// A file without a robot is given twice, or two robots would have the same name.
pub fn name_map_files(typed: &[PathBuf]) -> Result<Vec<(String, PathBuf)>, FileNameError> {
    let inputs: Vec<Input> = typed.iter().map(|typed| Input::new(typed)).collect();
    let unnamed: Vec<PathBuf> =
        inputs.iter().filter(|input| input.robot.is_none()).map(|input| input.path.clone()).collect();
    let mut names = robot_names(&unnamed)?.into_iter();
    let named = inputs.into_iter().filter_map(|Input { robot, path }| Some((robot.or_else(|| names.next())?, path)));
    let named: Vec<(String, PathBuf)> = named.collect();
    check_distinct(named.iter().map(|(name, file)| (name, file)))?;
    Ok(named)
}

fn check_distinct<'a>(files: impl Iterator<Item = (&'a String, &'a PathBuf)>) -> Result<(), FileNameError> {
    let mut owners: BTreeMap<&str, &PathBuf> = BTreeMap::new();
    for (name, file) in files {
        if let Some(one) = owners.insert(name, file) {
            return Err(FileNameError::SameName { name: name.clone(), one: one.clone(), other: file.clone() });
        }
    }
    Ok(())
}

fn check_once(files: &[PathBuf]) -> Result<(), FileNameError> {
    // A missing file is reported when it is read.
    let mut places: Vec<PathBuf> =
        files.iter().map(|file| file.canonicalize().unwrap_or_else(|_| file.clone())).collect();
    places.sort();
    match places.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(FileNameError::GivenTwice(pair[0].clone())),
        None => Ok(()),
    }
}

fn own_name(file: &Path) -> String {
    match file.is_dir() {
        true => topic_part(file.canonicalize().unwrap_or_else(|_| file.to_owned()).file_name()),
        false => topic_part(file.file_stem()),
    }
}

/// How many folders up the folders of all files have different names, 0 for the innermost, which it is where they have
/// nowhere.
fn height_of_difference<'a>(files: impl Iterator<Item = &'a PathBuf> + Clone) -> usize {
    let names_at = |height: usize| files.clone().map(|file| folder_name(file, height)).collect::<Option<Vec<_>>>();
    let differ = |names: &[String]| names.iter().collect::<BTreeSet<_>>().len() == names.len();
    let mut known = (0..).map_while(|height| Some((height, names_at(height)?)));
    known.find(|(_, names)| differ(names)).map_or(0, |(height, _)| height)
}

/// The name of the folder of a file, or of one so many folders up, as far as it was typed.
fn folder_name(file: &Path, height: usize) -> Option<String> {
    if height == 0 {
        return Some(topic_part(folder_of(file).file_name()));
    }
    let typed = file.parent()?.components().rev().filter_map(|part| match part {
        Component::Normal(name) => Some(name),
        _ => None,
    });
    typed.skip(height).map(|name| topic_part(Some(name))).next()
}

/// The absolute folder of a file, since `map.yaml` and `../map.yaml` do not contain its name.
fn folder_of(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned())
}

/// A name as one part of a topic. ROS 2 allows only letters, digits and `_`, but logs may contain others, and a name
/// that differs from the file's would be hard to guess.
fn topic_part(name: Option<&std::ffi::OsStr>) -> String {
    let name = name.map(|name| name.to_string_lossy()).unwrap_or_default();
    let part: String = name
        .chars()
        .map(|char| if char == '/' || char.is_control() || char == char::REPLACEMENT_CHARACTER { '_' } else { char })
        .collect();
    if part.is_empty() { "map".to_owned() } else { part }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn names(files: &[&str]) -> Result<Vec<String>, FileNameError> {
        robot_names(&files.iter().map(PathBuf::from).collect::<Vec<_>>())
    }

    #[test]
    fn a_robot_is_named_after_its_file() {
        assert_eq!(names(&["maps/robot2.yaml", "robot1.yml", "/x/r3"]).unwrap(), ["robot2", "robot1", "r3"]);
    }

    #[test]
    fn files_with_equal_names_are_distinguished_by_their_folders() {
        assert_eq!(names(&["r1/map.yaml", "a/r2/map.yaml", "hall.yaml"]).unwrap(), ["r1", "r2", "hall"]);
        let far = ["robot1/maps/map.yaml", "/data/robot2/maps/map.yaml", "b/robot3/maps/map.yaml"];
        assert_eq!(names(&far).unwrap(), ["robot1", "robot2", "robot3"]);
        assert_eq!(names(&["a/r1/map.yaml", "b/r1/map.yaml"]).unwrap(), ["a", "b"]);
    }

    #[test]
    fn a_folder_has_the_same_name_through_any_path() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("r1/maps");
        std::fs::create_dir_all(&inner).unwrap();
        let files = [inner.join("../map.yaml"), folder.path().join("r2/map.yaml")];
        assert_eq!(robot_names(&files).unwrap(), ["r1", "r2"]);
    }

    #[test]
    fn a_name_is_not_changed() {
        assert_eq!(
            names(&["ground floor.v2.yaml", "2.yaml", "küche-1.yaml", "a\tb.yaml"]).unwrap(),
            ["ground floor.v2", "2", "küche-1", "a_b"]
        );
    }

    #[test]
    fn names_that_stay_equal_are_an_error_with_a_fix() {
        for files in [["r1/map.yaml", "b/r1/map.yaml"], ["a/map.yaml", "a/map.yml"]] {
            let error = names(&files).unwrap_err().to_string();
            assert!(files.iter().all(|file| error.contains(file)) && error.contains("rename"), "{error}");
        }
        // A folder with the name of another file.
        assert!(matches!(names(&["r1.yaml", "r1/map.yaml", "r2/map.yaml"]), Err(FileNameError::SameName { .. })));
    }

    #[test]
    fn a_map_file_may_be_given_with_its_robot() {
        let files = |typed: &[&str]| name_map_files(&typed.iter().map(PathBuf::from).collect::<Vec<_>>());
        let named = |name: &str, file: &str| (name.to_owned(), PathBuf::from(file));
        let found = files(&["a/map.yaml", "r2=b/map.yaml", "c/map.yaml"]).unwrap();
        assert_eq!(found, [named("a", "a/map.yaml"), named("r2", "b/map.yaml"), named("c", "c/map.yaml")]);
        assert!(matches!(files(&["r1=a.yaml", "r1=b.yaml"]), Err(FileNameError::SameName { .. })));
        assert!(matches!(files(&["r1.yaml", "r1=b.yaml"]), Err(FileNameError::SameName { .. })));
    }

    #[test]
    fn a_file_given_twice_is_an_error_through_any_path() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.yaml");
        std::fs::write(&file, "").unwrap();
        let error = robot_names(&[file.clone(), folder.path().join("./a.yaml")]).unwrap_err();
        assert!(matches!(error, FileNameError::GivenTwice(_)), "{error}");
    }

    proptest! {
        #[test]
        fn every_name_is_a_part_of_a_topic(name in "\\PC*") {
            let part = topic_part(Some(std::ffi::OsStr::new(&name)));
            prop_assert!(!part.is_empty() && part.chars().all(|char| char != '/' && !char.is_control()));
        }
    }
}
