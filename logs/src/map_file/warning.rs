//! Warning of a map file that is read otherwise than it says.

use std::fmt;
use std::path::PathBuf;

/// What was read otherwise than a map file says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapFileWarning {
    /// The image that the file names and that does not exist, and the one that was read.
    pub image: Option<(PathBuf, PathBuf)>,
    /// Cells of grey 205 that are unknown though `free_thresh`, which follows, would make them free.
    pub unknown: Option<(u64, f64)>,
    /// The occupancy from which cells are walls, though `occupied_thresh`, which follows, leaves none.
    pub walls: Option<(f64, f64)>,
}

impl MapFileWarning {
    /// The warning; `None` if the file was read as it says.
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
                "{cells} cells of grey 205 are read as unknown, not as free as free_thresh {free_thresh} has it"
            ));
        }
        if let Some((from, occupied_thresh)) = self.walls {
            parts.push(format!(
                "the darkest cells, of occupancy {from:.2}, are read as walls, as none reaches occupied_thresh \
                 {occupied_thresh}"
            ));
        }
        if self.unknown.is_some() || self.walls.is_some() {
            parts.push("--literal-thresholds reads the file literally".to_owned());
        }
        f.write_str(&parts.join("; "))
    }
}
