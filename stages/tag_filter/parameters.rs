//! The parameters of the tag filter.

use gridweave_runtime::stage::{ParameterError, Parameters};
use schemars::JsonSchema;
use serde::Deserialize;

/// Parameters of `tag_filter`.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TagFilterParameters {
    /// A common tag needs this certainty in both maps. The paper has 0.75.
    pub certainty: f64,
    /// At least one common tag needs this certainty in both maps. The paper has 0.90.
    pub best_certainty: f64,
    /// So many common tags must agree, 2 or more. The paper has 3. What two say is provisional: the directions and the
    /// walls of the maps must confirm it.
    pub min_tags: usize,
    /// Two tags agree when they lie within so many standard deviations of each other.
    pub gate: f64,
    /// Standard deviation of a tag's place that comes from the bends of the maps, metres; it is added to that of the
    /// readings.
    pub map_stddev: f64,
    /// How maps drift, metres for the root of each metre: where tags do not agree, they are compared once more with a
    /// standard deviation that grows so from the middle of all. 0 does not.
    pub map_drift: f64,
    /// More than this share of the common tags must agree.
    pub min_agreement: f64,
    /// What the tags say is provisional when tags at random places would agree as well with more than this probability;
    /// and refused if, beside that, some of the common tags do not agree.
    pub max_chance: f64,
    /// Refused when tags at random places would agree as well with more than this probability, whatever may confirm it.
    /// With two tags that lie far apart it is about 0.7 m divided by their distance.
    pub max_provisional_chance: f64,
    /// Refused when the agreeing tags leave the rotation uncertain by more than this standard deviation, radians:
    /// they lie too near to each other.
    pub max_yaw_stddev: f64,
    /// Refused when another transform, which would put a tag elsewhere by more than `rival_distance`, has more than
    /// this share of the best one's tags.
    pub max_rival_share: f64,
    /// Two transforms are different when they put a tag so far apart, metres.
    pub rival_distance: f64,
    /// While the same tags agree, they are sent again only when one has moved by more than this, metres; what is left is sent
    /// at the end. 0 sends every change. Each change sent makes later stages align the maps anew.
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
    fn check(&self) -> Vec<ParameterError> {
        let mut errors = Vec::new();
        let mut expect = |good: bool, field: &'static str, problem: &str| {
            if !good {
                errors.push(ParameterError::new(field, problem));
            }
        };
        let share = |value: f64| (0.0..=1.0).contains(&value);
        let positive = |value: f64| value > 0.0 && value.is_finite();
        expect(share(self.certainty), "certainty", "must lie between 0 and 1");
        expect(
            share(self.best_certainty) && self.best_certainty >= self.certainty,
            "best_certainty",
            "must lie between `certainty` and 1",
        );
        expect(self.min_tags >= 2, "min_tags", "must be 2 or more: one tag does not tell a rotation");
        expect(positive(self.gate), "gate", "must be above 0");
        expect(positive(self.map_stddev), "map_stddev", "must be above 0 m");
        expect(self.map_drift >= 0.0 && self.map_drift.is_finite(), "map_drift", "must not be below 0 m");
        expect(share(self.min_agreement), "min_agreement", "must lie between 0 and 1");
        expect(self.max_chance > 0.0 && self.max_chance <= 1.0, "max_chance", "must be above 0, and at most 1");
        expect(
            self.max_provisional_chance >= self.max_chance && self.max_provisional_chance <= 1.0,
            "max_provisional_chance",
            "must lie between `max_chance` and 1",
        );
        expect(positive(self.max_yaw_stddev), "max_yaw_stddev", "must be above 0 rad");
        expect(share(self.max_rival_share), "max_rival_share", "must lie between 0 and 1");
        expect(positive(self.rival_distance), "rival_distance", "must be above 0 m");
        expect(self.min_change >= 0.0 && self.min_change.is_finite(), "min_change", "must not be below 0 m");
        errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_in_range() {
        assert_eq!(TagFilterParameters::default().check(), vec![]);
    }

    #[test]
    fn every_value_out_of_range_is_named() {
        let wrong = TagFilterParameters {
            certainty: 1.1,
            best_certainty: 0.5,
            min_tags: 1,
            gate: 0.0,
            map_stddev: f64::NAN,
            map_drift: -0.1,
            min_agreement: -0.1,
            max_chance: 0.0,
            max_provisional_chance: 1.5,
            max_yaw_stddev: f64::INFINITY,
            max_rival_share: 2.0,
            rival_distance: -1.0,
            min_change: f64::NAN,
        };
        assert_eq!(wrong.check().len(), 13);
    }
}
