//! Parameters of the tag filter.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Parameters of `tag_filter`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TagFilterParameters {
    /// Least certainty of a common tag in both maps. The paper has 0.75.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub certainty: f64,
    /// Least certainty of the best common tag in both maps. The paper has 0.90.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub best_certainty: f64,
    /// Least number of common tags that agree, 2 or more. The paper has 3. Two are provisional: the directions and
    /// the walls of the maps must confirm them.
    #[schemars(range(min = 2))]
    pub min_tags: usize,
    /// Gate of two tags, in standard deviations.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub gate: f64,
    /// Standard deviation of a tag's position by the deformation of the maps, metres; it is added to that of the
    /// readings.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub map_stddev: f64,
    /// Drift of maps, metres per square root of a metre: where tags do not agree, they are compared once more with a
    /// standard deviation that grows with the distance from the centroid of all. 0 does not.
    #[schemars(range(min = 0.0))]
    pub map_drift: f64,
    /// Least share of the common tags that agree.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub min_agreement: f64,
    /// Largest probability that tags at random positions would agree as well. Above it the tags are provisional; and
    /// refused if, besides, some of the common tags do not agree.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub max_chance: f64,
    /// The same bound for provisional tags, above which they are refused. With two tags far apart the probability is
    /// about 0.7 m divided by their distance.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_provisional_chance: f64,
    /// Largest standard deviation of the rotation by the agreeing tags, radians; greater where they are too near to
    /// each other.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_yaw_stddev: f64,
    /// Refused when another transform, which moves a tag by more than `rival_distance`, has more than this share of
    /// the best one's tags.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub max_rival_share: f64,
    /// Two transforms are different when they move a tag by more than this, metres.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub rival_distance: f64,
    /// While the same tags agree, they are sent again only when one has moved by more than this, metres; the rest is
    /// sent at the end. 0 sends every change. Each change makes later stages align the maps again.
    #[schemars(range(min = 0.0))]
    pub min_change: f64,
}

impl Default for TagFilterParameters {
    fn default() -> Self {
        Self {
            certainty: 0.75,
            best_certainty: 0.90,
            min_tags: 2,
            gate: 3.5,
            map_stddev: 0.05,
            map_drift: 0.05,
            min_agreement: 0.5,
            max_chance: 1e-3,
            max_provisional_chance: 0.3,
            max_yaw_stddev: 0.05,
            max_rival_share: 0.7,
            rival_distance: 0.5,
            min_change: 0.02,
        }
    }
}

impl Parameters for TagFilterParameters {
    fn check_together(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        if self.best_certainty < self.certainty {
            errors.push(ParameterError::new("best_certainty", "must be at least `certainty`"));
        }
        if self.max_provisional_chance < self.max_chance {
            errors.push(ParameterError::new("max_provisional_chance", "must be at least `max_chance`"));
        }
        errors
    }
}
