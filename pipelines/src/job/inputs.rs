//! What the files on a command line are: logs, map files, or topological maps.

use crate::status::BadUse;
use gridweave_logs::names::Input;
use std::path::{Path, PathBuf};

/// What the inputs of a run are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Inputs {
    /// Logs of all kinds, and maps of robots that have none.
    Logs,
    /// YAML files of nav2's map server.
    MapFiles,
    /// JSON files of topological maps.
    TopologyFiles,
}

impl Inputs {
    /// Tells by the names of the files. An error if there are images of maps, or JSON files beside others.
    pub(crate) fn of(paths: &[PathBuf]) -> Result<Self, BadUse> {
        if let Some(image) =
            paths.iter().find(|path| has_ending(path, &["pgm", "png", "pbm", "ppm", "bmp", "jpg", "jpeg"]))
        {
            let text = format!("{} is an image: give the YAML file that describes the map", image.display());
            return Err(BadUse(text));
        }
        if let Some(topology) = paths.iter().find(|path| is_topology(path)) {
            return match paths.iter().find(|path| !is_topology(path)) {
                None => Ok(Self::TopologyFiles),
                Some(other) => Err(BadUse(format!(
                    "{} is a topological map, and {} is none: what reads the one does not read the other",
                    topology.display(),
                    other.display()
                ))),
            };
        }
        // A rosbag2 folder may have any name; and a map that is said to be a robot's is read as a log of it.
        let is_map_file = |typed: &PathBuf| {
            let Input { robot, path } = Input::new(typed);
            robot.is_none() && is_yaml(&path) && !path.is_dir()
        };
        match paths.iter().all(is_map_file) && !paths.is_empty() {
            true => Ok(Self::MapFiles),
            false => Ok(Self::Logs),
        }
    }

    /// The kind of the stage that reads them.
    pub(crate) fn source_kind(self) -> &'static str {
        match self {
            Self::Logs => "mcap_source",
            Self::MapFiles => "map_file_source",
            Self::TopologyFiles => "topology_file_source",
        }
    }

    /// The same for a command that does nothing with topological maps.
    ///
    /// # Errors
    /// That is what the files are.
    pub(crate) fn of_maps_or_logs(paths: &[PathBuf], command: &str) -> Result<Self, BadUse> {
        match Self::of(paths)? {
            Self::TopologyFiles => Err(BadUse(format!(
                "`{command}` reads no topological maps: `gridweave run topology_file_merge` lays those of JSON files on each other"
            ))),
            inputs => Ok(inputs),
        }
    }
}

/// Whether a file is called as the YAML file of a map.
pub(crate) fn is_yaml(path: &Path) -> bool {
    has_ending(path, &["yaml", "yml"])
}

/// Whether a file is called as a topological map. A rosbag2 folder may have any name.
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
    fn inputs_are_told_by_their_names() {
        assert_eq!(of(&["a.mcap", "bag"]), Ok(Inputs::Logs));
        assert_eq!(of(&["a.yaml", "b.YML"]), Ok(Inputs::MapFiles));
        assert_eq!(of(&["a.json", "b.JSON"]), Ok(Inputs::TopologyFiles));
        assert!(of(&["a.json", "b.mcap"]).unwrap_err().contains("a.json is a topological map, and b.mcap is none"));
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag.yaml");
        std::fs::create_dir(&bag).unwrap();
        assert_eq!(of(&[bag.to_str().unwrap()]), Ok(Inputs::Logs));
    }

    #[test]
    fn a_map_beside_a_log_or_said_to_be_a_robots_is_read_as_a_log() {
        assert_eq!(of(&["a.yaml", "b.mcap"]), Ok(Inputs::Logs));
        assert_eq!(of(&["robot1=a.yaml", "robot2=b.yaml"]), Ok(Inputs::Logs));
        assert!(of(&["a.yaml", "b.pgm"]).unwrap_err().contains("b.pgm is an image"));
    }
}
