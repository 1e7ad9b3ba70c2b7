//! Which places of two maps are the same.

use super::library::{MapOfBuilding, files, maps_of_log};
use crate::statistics::quantile;
use anyhow::{Context, Result};
use gridweave_stages::geometry::Pose2;
use nalgebra::Point2;
use serde::Deserialize;
use std::path::Path;

/// Two maps of one building or of two, and the places that they have in common.
#[derive(Debug)]
pub(super) struct Pair {
    pub(super) name: String,
    pub(super) maps: [MapOfBuilding; 2],
    truth: Truth,
}

/// Which places are the same.
#[derive(Clone, Debug, Deserialize)]
struct Truth {
    /// In map b and in map a: x and y of each, metres.
    common: Vec<[f64; 4]>,
    /// What the best rigid transform leaves there, as the maps are bent: the median and the 90th percentile, metres.
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
    #[serde(flatten)]
    truth: Truth,
}

/// The pairs that a folder has a truth of: those of its `pairs.json`, and the last maps of the first two robots of each log whose
/// `LOG.truth.json` names common places. None if it has neither.
pub(super) fn pairs(folder: &Path) -> Result<Vec<Pair>> {
    let mut pairs = Vec::new();
    let listed = folder.join("pairs.json");
    if listed.exists() {
        for PairOfFiles { pair, a, b, truth } in read::<Vec<PairOfFiles>>(&listed)? {
            let map = |name: &str| MapOfBuilding::of_file(&folder.join(format!("{name}.yaml")));
            pairs.push(Pair { name: pair, maps: [map(&a)?, map(&b)?], truth });
        }
    }
    for log in files(folder)?.into_iter().filter(|file| file.extension().is_some_and(|extension| extension == "mcap")) {
        let truth = log.with_extension("truth.json");
        let Some(truth) = truth.exists().then(|| read::<TruthOfLog>(&truth)).transpose()?.and_then(TruthOfLog::of_pair)
        else {
            continue;
        };
        let mut maps = maps_of_log(&log)?.into_iter();
        if let (Some(a), Some(b)) = (maps.next(), maps.next()) {
            let name = log.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            pairs.push(Pair { name, maps: [a, b], truth });
        }
    }
    Ok(pairs)
}

/// The truth of a log, which has common places where its maps are bent.
#[derive(Debug, Deserialize)]
struct TruthOfLog {
    common: Option<Vec<[f64; 4]>>,
    #[serde(default)]
    rigid_median: f64,
    #[serde(default)]
    rigid_p90: f64,
}

impl TruthOfLog {
    fn of_pair(self) -> Option<Truth> {
        let Self { common, rigid_median, rigid_p90 } = self;
        Some(Truth { common: common?, rigid_median, rigid_p90 })
    }
}

fn read<T: serde::de::DeserializeOwned>(file: &Path) -> Result<T> {
    let text = std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
    serde_json::from_slice(&text).with_context(|| format!("cannot read {}", file.display()))
}

impl Pair {
    /// Whether the maps have nothing in common.
    pub(super) fn is_unrelated(&self) -> bool {
        self.truth.common.is_empty()
    }

    /// Whether `T_a_b` lays the common places within 0.5 m of each other in the median and nine of ten within 1 m, beyond what the
    /// best rigid transform leaves.
    pub(super) fn is_right(&self, transform_a_b: &Pose2) -> bool {
        let Truth { common, rigid_median, rigid_p90 } = &self.truth;
        let errors = common
            .iter()
            .map(|[x_b, y_b, x_a, y_a]| (transform_a_b * Point2::new(*x_b, *y_b) - Point2::new(*x_a, *y_a)).norm());
        let errors: Vec<f64> = errors.collect();
        !errors.is_empty() && quantile(&errors, 0.5) < 0.5 + rigid_median && quantile(&errors, 0.9) < 1.0 + rigid_p90
    }
}
