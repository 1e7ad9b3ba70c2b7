//! What the files on a command line are: logs, or map files.

use crate::status::BadUse;
use std::path::{Path, PathBuf};

/// What the inputs of a run are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Inputs {
    /// MCAP files and rosbag2 folders.
    Logs,
    /// YAML files of nav2's map server.
    MapFiles,
}

impl Inputs {
    /// Tells by the names of the files. An error if there are some of both, or images of maps.
    pub(crate) fn of(paths: &[PathBuf]) -> Result<Self, BadUse> {
        if let Some(image) =
            paths.iter().find(|path| has_ending(path, &["pgm", "png", "pbm", "ppm", "bmp", "jpg", "jpeg"]))
        {
            let text = format!("{} is an image: give the YAML file that describes the map", image.display());
            return Err(BadUse(text));
        }
        // A rosbag2 folder may have any name.
        let is_map_file = |path: &&PathBuf| is_yaml(path) && !path.is_dir();
        match (paths.iter().find(is_map_file), paths.iter().find(|path| !is_map_file(path))) {
            (Some(map), Some(log)) => {
                let (map, log) = (map.display(), log.display());
                Err(BadUse(format!("{map} is a map file and {log} is a log: give files of one sort only")))
            }
            (Some(_), None) => Ok(Self::MapFiles),
            (None, _) => Ok(Self::Logs),
        }
    }

    /// The kind of the stage that reads them.
    pub(crate) fn source_kind(self) -> &'static str {
        match self {
            Self::Logs => "mcap_source",
            Self::MapFiles => "map_file_source",
        }
    }
}

/// Whether a file is called as the YAML file of a map.
pub(crate) fn is_yaml(path: &Path) -> bool {
    has_ending(path, &["yaml", "yml"])
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
        let folder = tempfile::tempdir().unwrap();
        let bag = folder.path().join("bag.yaml");
        std::fs::create_dir(&bag).unwrap();
        assert_eq!(of(&[bag.to_str().unwrap()]), Ok(Inputs::Logs));
    }

    #[test]
    fn what_cannot_be_read_together_is_refused() {
        let error = of(&["a.yaml", "b.mcap"]).unwrap_err();
        assert!(error.contains("a.yaml is a map file") && error.contains("b.mcap is a log"), "{error}");
        assert!(of(&["a.yaml", "b.pgm"]).unwrap_err().contains("b.pgm is an image"));
    }
}
