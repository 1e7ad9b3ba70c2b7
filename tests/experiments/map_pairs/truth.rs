//! Which places of two maps are the same.

use super::library::MapOfBuilding;
use crate::statistics::quantile;
use anyhow::{Context, Result};
use gridweave_stages::geometry::Pose2;
use nalgebra::Point2;
use serde::Deserialize;
use std::path::Path;

/// A pair of `pairs.json`.
#[derive(Debug, Deserialize)]
pub(super) struct Pair {
    pair: String,
    a: String,
    b: String,
    /// Places that are the same, in map b and in map a: x and y of each, metres.
    common: Vec<[f64; 4]>,
    /// What the best rigid transform leaves there, as the maps are bent: the median and the 90th percentile, metres.
    #[serde(default)]
    rigid_median: f64,
    #[serde(default)]
    rigid_p90: f64,
}

/// The pairs that a folder has a truth of; none if it has no `pairs.json`.
pub(super) fn pairs(folder: &Path) -> Result<Vec<Pair>> {
    let file = folder.join("pairs.json");
    if !file.exists() {
        return Ok(Vec::new());
    }
    let text = std::fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
    serde_json::from_slice(&text).with_context(|| format!("cannot read {}", file.display()))
}

impl Pair {
    pub(super) fn name(&self) -> &str {
        &self.pair
    }

    /// Its maps.
    pub(super) fn maps(&self, folder: &Path) -> Result<[MapOfBuilding; 2]> {
        let map = |name: &str| MapOfBuilding::of_file(&folder.join(format!("{name}.yaml")));
        Ok([map(&self.a)?, map(&self.b)?])
    }

    /// Whether the maps have nothing in common.
    pub(super) fn is_unrelated(&self) -> bool {
        self.common.is_empty()
    }

    /// Whether `T_a_b` lays the common places within 0.5 m of each other in the median and nine of ten within 1 m, beyond what the
    /// best rigid transform leaves.
    pub(super) fn is_right(&self, transform_a_b: &Pose2) -> bool {
        let errors = self
            .common
            .iter()
            .map(|[x_b, y_b, x_a, y_a]| (transform_a_b * Point2::new(*x_b, *y_b) - Point2::new(*x_a, *y_a)).norm());
        let errors: Vec<f64> = errors.collect();
        !errors.is_empty()
            && quantile(&errors, 0.5) < 0.5 + self.rigid_median
            && quantile(&errors, 0.9) < 1.0 + self.rigid_p90
    }
}
