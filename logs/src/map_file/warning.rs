//! The warning about a map file that is not read literally.

use std::fmt;
use std::path::PathBuf;

/// The deviations from a map file's literal content.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapFileWarning {
    /// The missing image of the file, and the one that was read instead.
    pub image: Option<(PathBuf, PathBuf)>,
    /// The number of cells in grey 205 that are unknown, and the `free_thresh` that would make them free.
    pub unknown: Option<(u64, f64)>,
    /// The minimum occupancy of occupied cells, and the `occupied_thresh` that no cell reaches.
    pub walls: Option<(f64, f64)>,
}

impl MapFileWarning {
    /// The warning; `None` if the file was read literally.
    pub(super) fn if_any(self) -> Option<Self> {
        (self != Self::default()).then_some(self)
    }
}

impl fmt::Display for MapFileWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = Vec::new();
        if let Some((missing, read)) = &self.image {
            parts.push(format!("its image {} does not exist; {} is read", missing.display(), read.display()));
        }
        if let Some((cells, free_thresh)) = self.unknown {
            parts.push(format!(
                "{cells} cells in grey 205 are read as unknown; with free_thresh {free_thresh} they would be free"
            ));
        }
        if let Some((from, occupied_thresh)) = self.walls {
            parts.push(format!(
                "the darkest cells, with occupancy {from:.2}, are read as occupied, since no cell reaches occupied_thresh \
                 {occupied_thresh}"
            ));
        }
        if self.unknown.is_some() || self.walls.is_some() {
            parts.push("--literal-thresholds reads the file literally".to_owned());
        }
        f.write_str(&parts.join("; "))
    }
}
