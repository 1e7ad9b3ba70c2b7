//! An input argument: a path, or a robot and a path.

use std::path::{Path, PathBuf};

/// A log, with its robot if given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// The robot that its topics and frames are put under.
    pub robot: Option<String>,
    /// The path.
    pub path: PathBuf,
}

impl Input {
    /// Parses `PATH` or `ROBOT=PATH`. If a file with the whole name exists, it is a path.
    pub fn new(typed: &Path) -> Self {
        let unnamed = || Self { robot: None, path: typed.to_owned() };
        let Some((robot, path)) = typed.to_str().and_then(|text| text.split_once('=')) else { return unnamed() };
        let is_name = !robot.is_empty() && !robot.contains(|char: char| char == '/' || char.is_control());
        match is_name && !path.is_empty() && !typed.exists() {
            true => Self { robot: Some(robot.to_owned()), path: path.into() },
            false => unnamed(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(typed: &str) -> (Option<String>, String) {
        let Input { robot, path } = Input::new(Path::new(typed));
        (robot, path.to_str().unwrap().to_owned())
    }

    #[test]
    fn a_robot_and_its_path_are_separated() {
        assert_eq!(input("robot1=bags/a"), (Some("robot1".into()), "bags/a".into()));
        assert_eq!(input("robot1=a=b.mcap"), (Some("robot1".into()), "a=b.mcap".into()));
        for path in ["bags/a", "bags/x=1/a.mcap", "=a", "robot1="] {
            assert_eq!(input(path), (None, path.into()));
        }
    }

    #[test]
    fn a_file_whose_name_looks_like_a_robot_and_a_path_is_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a=b.mcap");
        std::fs::write(&path, "").unwrap();
        assert_eq!(Input::new(&path), Input { robot: None, path });
    }
}
