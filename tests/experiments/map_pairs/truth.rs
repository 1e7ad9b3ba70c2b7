//! Which places of two maps are the same.

use super::library::{MapOfBuilding, maps_of_log};
use crate::statistics::quantile;
use crate::trial::files;
use anyhow::{Context, Result};
use gridweave_stages::shared::geometry::Pose2;
use nalgebra::Point2;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A hypothesis within this of the truth, metres, is the right one, but not exact: maps that drift differ so much.
/// Hypotheses at similar places are farther from each other.
pub(crate) const NEAR: f64 = 1.5;
/// And turned by less than this, degrees.
pub(crate) const NEAR_DEGREES: f64 = 5.0;

/// How near a place is to the truth.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Closeness {
    Right,
    /// The right place, too inexactly to count as right.
    Near,
    Wrong,
}

/// Two maps of one building or of two, and the places that they have in common.
#[derive(Debug)]
pub(crate) struct Pair {
    pub(crate) name: String,
    /// Confidence of the truth, if it is given.
    pub(crate) quality: Option<String>,
    pub(crate) maps: [MapOfBuilding; 2],
    truth: PairTruth,
}

/// Which places are the same.
#[derive(Clone, Debug, Deserialize)]
struct PairTruth {
    /// In map b and in map a: x and y of each, metres. The truth of a log has them where its maps are deformed.
    common: Option<Vec<[f64; 4]>>,
    /// Residuals of the best rigid transform, which the deformation of the maps causes: the median and the 90th
    /// percentile, metres.
    #[serde(default)]
    rigid_median: f64,
    #[serde(default)]
    rigid_p90: f64,
}

/// A pair of `pairs.json`.
#[derive(Debug, Deserialize)]
struct PairOfFiles {
    pair: String,
    a: String,
    b: String,
    quality: Option<String>,
    #[serde(flatten)]
    truth: PairTruth,
}

/// The pairs that a folder has a truth of: those of its `pairs.json`, and the last maps of the first two robots of each
/// log whose `LOG.truth.json` names common places. None if it has neither.
pub(crate) fn pairs(folder: &Path) -> Result<Vec<Pair>> {
    let mut pairs = Vec::new();
    let listed = folder.join("pairs.json");
    if listed.exists() {
        for PairOfFiles { pair, a, b, quality, truth } in read::<Vec<PairOfFiles>>(&listed)? {
            let maps = if folder.join("maps").is_dir() { folder.join("maps") } else { folder.to_owned() };
            let map = |name: &str| MapOfBuilding::of_file(&maps.join(format!("{name}.yaml")));
            pairs.push(Pair { name: pair, quality, maps: [map(&a)?, map(&b)?], truth });
        }
    }
    for log in files(folder)?.into_iter().filter(|file| file.extension().is_some_and(|extension| extension == "mcap")) {
        let truth = log.with_extension("truth.json");
        let truth = truth.exists().then(|| read::<PairTruth>(&truth)).transpose()?;
        let Some(truth) = truth.filter(|truth| truth.common.is_some()) else { continue };
        let mut maps = maps_of_log(&log)?.into_iter();
        if let (Some(a), Some(b)) = (maps.next(), maps.next()) {
            let name = log.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            pairs.push(Pair { name, quality: None, maps: [a, b], truth });
        }
    }
    Ok(pairs)
}

fn read<T: serde::de::DeserializeOwned>(file: &Path) -> Result<T> {
    let text = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    serde_json::from_slice(&text).with_context(|| format!("cannot read {}", file.display()))
}

impl Pair {
    /// Whether the maps have nothing in common.
    pub(crate) fn is_unrelated(&self) -> bool {
        self.common().is_empty()
    }

    /// Whether `T_a_b` aligns the common places within 0.5 m of each other in the median and nine of ten within 1 m,
    /// beyond what the best rigid transform leaves.
    pub(crate) fn is_right(&self, transform_a_b: &Pose2) -> bool {
        let PairTruth { rigid_median, rigid_p90, .. } = &self.truth;
        let errors = self.errors(transform_a_b);
        !errors.is_empty() && quantile(&errors, 0.5) < 0.5 + rigid_median && quantile(&errors, 0.9) < 1.0 + rigid_p90
    }

    /// How near `T_a_b` is to the truth.
    pub(crate) fn closeness(&self, transform_a_b: &Pose2) -> Closeness {
        let errors = self.errors(transform_a_b);
        match self.is_right(transform_a_b) {
            true => Closeness::Right,
            false if !errors.is_empty() && quantile(&errors, 0.5) < NEAR + self.truth.rigid_median => Closeness::Near,
            false => Closeness::Wrong,
        }
    }

    /// Distances of the common places by `T_a_b`, metres.
    fn errors(&self, transform_a_b: &Pose2) -> Vec<f64> {
        let error = |[x_b, y_b, x_a, y_a]: &[f64; 4]| {
            (transform_a_b * Point2::new(*x_b, *y_b) - Point2::new(*x_a, *y_a)).norm()
        };
        self.common().iter().map(error).collect()
    }

    fn common(&self) -> &[[f64; 4]] {
        self.truth.common.as_deref().unwrap_or_default()
    }
}
