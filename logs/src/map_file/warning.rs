//! The warning about a map file that is not read literally.

use std::fmt;
use std::path::PathBuf;

/// The deviations from a map file's literal content.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MapFileWarning {
    /// What the YAML file leaves out or writes in other units, and how that was read.
    pub assumed: Vec<String>,
    /// The image of the file that cannot be reached, and the one that was read instead.
    pub image: Option<(PathBuf, PathBuf)>,
    /// The cells in the grey of unknown ones.
    pub unknown: Option<UnknownGrey>,
    /// The minimum occupancy of occupied cells, and the `occupied_thresh` that no cell reaches.
    pub walls: Option<(f64, f64)>,
    /// The number of transparent cells, which are unknown.
    pub transparent: Option<u64>,
    /// The numbers of pixels in shades that are no occupancy in the mode `raw`, and of others, where most are of the
    /// former.
    pub shaded: Option<(u64, u64)>,
    /// The numbers of occupied and of free cells, where there are more occupied ones: the image may be inverted.
    pub inverted: Option<(u64, u64)>,
}

/// What the thresholds of a file would make of cells in the grey of unknown ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Misread {
    /// Free, by this `free_thresh`.
    Free(f64),
    /// Occupied, by this `occupied_thresh`.
    Occupied(f64),
}

impl fmt::Display for Misread {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Free(threshold) => write!(f, "with free_thresh {threshold} they would be free"),
            Self::Occupied(threshold) => write!(f, "with occupied_thresh {threshold} they would be occupied"),
        }
    }
}

/// Cells in the grey of unknown ones that the thresholds would make free or occupied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnknownGrey {
    /// The number of these cells.
    pub cells: u64,
    /// The first and the last shade; both are 205 from a map saver, and 128 from Cartographer.
    pub shades: (usize, usize),
    /// What they would be.
    pub misread: Misread,
    /// Whether the image has noise about its shades as a JPEG has, and is none.
    pub is_noisy: bool,
}

impl fmt::Display for UnknownGrey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { cells, shades: (first, last), misread, is_noisy } = self;
        write!(f, "{cells} cells in grey {first}")?;
        if last > first {
            write!(f, " to {last}")?;
        }
        write!(f, " are read as unknown; {misread}")?;
        match is_noisy {
            true => f.write_str(" (its shades are as noisy as those of an image that was a JPEG)"),
            false => Ok(()),
        }
    }
}

impl MapFileWarning {
    /// The warning; `None` if the file was read literally.
    pub(super) fn if_any(self) -> Option<Self> {
        (self != Self::default()).then_some(self)
    }
}

impl fmt::Display for MapFileWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = self.assumed.clone();
        if let Some((missing, read)) = &self.image {
            parts.push(format!("its image {} cannot be reached; {} is read", missing.display(), read.display()));
        }
        if let Some(unknown) = self.unknown {
            parts.push(unknown.to_string());
        }
        if let Some((from, occupied_thresh)) = self.walls {
            parts.push(format!(
                "the darkest cells, with occupancy {from:.2}, are read as occupied, since no cell reaches occupied_thresh \
                 {occupied_thresh}"
            ));
        }
        if let Some(cells) = self.transparent {
            parts.push(format!("{cells} transparent cells are read as unknown"));
        }
        if self.unknown.is_some() || self.walls.is_some() || self.transparent.is_some() {
            parts.push("--literal-thresholds reads the file literally".to_owned());
        }
        if let Some((shades, occupancies)) = self.shaded {
            parts.push(format!(
                "{shades} pixels have shades from 101 to 254, which `mode: raw` reads as unknown, and {occupancies} are \
                 occupancies from 0 to 100: if black is occupied and white is free in its image, set `mode: trinary`"
            ));
        }
        if let Some((occupied, free)) = self.inverted {
            parts.push(format!(
                "{occupied} cells are occupied and {free} are free: if its image is inverted, so that white is occupied, set \
                 `negate: 1`, or 0 where it is 1"
            ));
        }
        f.write_str(&parts.join("; "))
    }
}
