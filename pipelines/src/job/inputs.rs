//! Kinds of input files on the command line: logs, map files, or topological maps.

use crate::status::BadUse;
use gridweave_logs::names::Input;
use gridweave_runtime::message::{FixedText, LONGEST_ROBOT_NAME};
use std::path::{Path, PathBuf};

/// Kind of the inputs of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Inputs {
    /// Logs of all formats, and map files of robots without a log.
    Logs,
    /// YAML files of nav2's map server.
    MapFiles,
    /// JSON files of topological maps.
    TopologyFiles,
}

impl Inputs {
    /// Finds the kind by the names of the files. Images of maps, JSON files beside others, and robots with names that
    /// are too long are errors.
    pub(crate) fn of(paths: &[PathBuf]) -> Result<Self, BadUse> {
        let mut robots = paths.iter().filter_map(|path| Input::new(path).robot);
        if let Some(error) = robots.find_map(|robot| FixedText::<LONGEST_ROBOT_NAME>::new(&robot).err()) {
            return Err(BadUse(format!("the robot {error}")));
        }
        if let Some(image) =
            paths.iter().find(|path| has_ending(path, &["pgm", "png", "pbm", "ppm", "bmp", "jpg", "jpeg"]))
        {
            let text = format!("{} is an image: give the YAML file of the map instead", image.display());
            return Err(BadUse(text));
        }
        if let Some(topology) = paths.iter().find(|path| is_topology(path)) {
            return match paths.iter().find(|path| !is_topology(path)) {
                None => Ok(Self::TopologyFiles),
                Some(other) => Err(BadUse(format!(
                    "{} is a topological map, and {} is not: no pipeline reads both",
                    topology.display(),
                    other.display()
                ))),
            };
        }
        // A rosbag2 folder may have any name.
        let is_map_file = |typed: &PathBuf| {
            let path = Input::new(typed).path;
            is_yaml(&path) && !path.is_dir()
        };
        match paths.iter().all(is_map_file) && !paths.is_empty() {
            true => Ok(Self::MapFiles),
            false => Ok(Self::Logs),
        }
    }

    /// The same for a pipeline that the user has chosen: a map file of the form `ROBOT=FILE` is a log of that robot,
    /// which any pipeline of logs reads.
    pub(crate) fn of_run(paths: &[PathBuf]) -> Result<Self, BadUse> {
        let is_named = |typed: &PathBuf| Input::new(typed).robot.is_some();
        Ok(match Self::of(paths)? {
            Self::MapFiles if paths.iter().any(is_named) => Self::Logs,
            inputs => inputs,
        })
    }

    /// The kind of stage that reads the inputs.
    pub(crate) fn source_kind(self) -> &'static str {
        match self {
            Self::Logs => "mcap_source",
            Self::MapFiles => "map_file_source",
            Self::TopologyFiles => "topology_file_source",
        }
    }

    /// Finds the kind for a command that does not read topological maps.
    ///
    /// # Errors
    /// The files are topological maps, or [`of`](Self::of) fails.
    pub(crate) fn of_maps_or_logs(paths: &[PathBuf], command: &str) -> Result<Self, BadUse> {
        match Self::of(paths)? {
            Self::TopologyFiles => Err(BadUse(format!(
                "`{command}` does not read topological maps (JSON): `gridweave run topology_file_merge` merges them"
            ))),
            inputs => Ok(inputs),
        }
    }
}

/// Whether the name of a file is that of a map (YAML).
pub(crate) fn is_yaml(path: &Path) -> bool {
    has_ending(path, &["yaml", "yml"])
}

/// Whether the name of a file is that of a topological map (JSON). A rosbag2 folder may have any name.
fn is_topology(path: &Path) -> bool {
    has_ending(path, &["json"]) && !path.is_dir()
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    path.extension().is_some_and(|own| endings.iter().any(|ending| own.eq_ignore_ascii_case(ending)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(paths: &[&str]) -> Result<Inputs, String> {
        Inputs::of(&paths.iter().map(PathBuf::from).collect::<Vec<_>>()).map_err(|error| error.to_string())
    }

    #[test]
    fn the_kind_of_inputs_follows_from_their_names() {
        assert_eq!(of(&["a.mcap", "bag"]), Ok(Inputs::Logs));
        assert_eq!(of(&["a.yaml", "b.YML"]), Ok(Inputs::MapFiles));
        assert_eq!(of(&["a.json", "b.JSON"]), Ok(Inputs::TopologyFiles));
        assert!(of(&["a.json", "b.mcap"]).unwrap_err().contains("a.json is a topological map, and b.mcap is not"));
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag.yaml");
        std::fs::create_dir(&bag).unwrap();
        assert_eq!(of(&[bag.to_str().unwrap()]), Ok(Inputs::Logs));
    }

    #[test]
    fn a_name_of_a_robot_that_is_too_long_is_an_error_for_logs_and_for_map_files() {
        let (fits, longer) = ("r".repeat(64), "r".repeat(65));
        for file in ["a.mcap", "a.yaml"] {
            assert!(of(&[&format!("{fits}={file}"), file]).is_ok());
            let error = of(&[file, &format!("{longer}={file}")]).unwrap_err();
            assert!(error.contains(&longer) && error.contains("has 65 bytes, and at most 64 fit"), "{error}");
        }
    }

    #[test]
    fn a_map_file_beside_a_log_is_read_as_a_log() {
        assert_eq!(of(&["a.yaml", "b.mcap"]), Ok(Inputs::Logs));
        assert_eq!(of(&["robot1=a.yaml", "b.mcap"]), Ok(Inputs::Logs));
        let named = ["robot1=a.yaml", "robot2=b.yaml"];
        assert_eq!(of(&named), Ok(Inputs::MapFiles));
        assert!(matches!(Inputs::of_run(&named.map(PathBuf::from)), Ok(Inputs::Logs)));
        assert!(of(&["a.yaml", "b.pgm"]).unwrap_err().contains("b.pgm is an image"));
    }
}
