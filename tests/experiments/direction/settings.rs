//! The parameters under which directions are measured.

use gridweave_stages::tags::line_extractor::{Fit, LineExtractorParameters, Sampling, Scoring};
use gridweave_stages::tags::quadrant_classifier::{Mean, QuadrantClassifierParameters, Weighting};

/// The side of a cell of the paper's map, metres.
const PIXEL: f64 = 0.02;

/// One set of parameters.
#[derive(Clone, Debug)]
pub(super) struct Settings {
    /// What it is called in tables.
    pub(super) name: &'static str,
    /// Whether it only shows what one part of the shipped parameters brings.
    pub(super) is_ablation: bool,
    /// From the map to its walls.
    pub(super) lines: LineExtractorParameters,
    /// From the walls to their direction.
    pub(super) classifier: QuadrantClassifierParameters,
}

impl Settings {
    /// The parameters that ship, the paper's, and some between.
    pub(super) fn all() -> Vec<Self> {
        vec![Self::shipped(), Self::paper(), Self::without_faces(), Self::by_length(), Self::without_both()]
    }

    /// What the pipeline `tag_merge` uses: the defaults, and walls weighted by their precision.
    pub(super) fn shipped() -> Self {
        let classifier = QuadrantClassifierParameters { weighting: Weighting::Precision, ..Default::default() };
        Self { name: "shipped", is_ablation: false, lines: Default::default(), classifier }
    }

    /// The paper's values (section 4.1). It gives none for the size of the sub-sample, the limit of iterations, and the
    /// two limits of merging; the first two are chosen for a time like that of the shipped parameters, the others are
    /// those that ship.
    pub(super) fn paper() -> Self {
        let lines = LineExtractorParameters {
            sampling: Sampling::Uniform,
            scoring: Scoring::Percentage,
            fit: Fit::Ends,
            max_points: 2000,
            inlier_distance: 2.0 * PIXEL,
            min_share: 0.15,
            stop_share: 0.5,
            candidates: 1,
            max_iterations: 1000,
            max_gap: 30.0 * PIXEL,
            min_length: 30.0 * PIXEL,
            min_reliability: 0.6,
            ..Default::default()
        };
        let classifier =
            QuadrantClassifierParameters { mean: Mean::Groups, weighting: Weighting::Equation4, ..Default::default() };
        Self { name: "the paper's parameters", is_ablation: false, lines, classifier }
    }

    /// Walls fitted as single lines.
    fn without_faces() -> Self {
        let shipped = Self::shipped();
        let lines = LineExtractorParameters { fit: Fit::LeastSquares, ..shipped.lines };
        Self { name: "fit = \"least_squares\"", is_ablation: true, lines, ..shipped }
    }

    /// Walls weighted by their length.
    fn by_length() -> Self {
        let shipped = Self::shipped();
        let classifier = QuadrantClassifierParameters { weighting: Weighting::Length, ..shipped.classifier };
        Self { name: "weighting = \"length\"", is_ablation: true, classifier, ..shipped }
    }

    fn without_both() -> Self {
        Self { name: "both", is_ablation: true, lines: Self::without_faces().lines, ..Self::by_length() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::stage::Parameters;

    #[test]
    fn what_is_measured_as_shipped_is_what_ships() {
        let pipeline = include_str!("../../../pipelines/tag_merge.toml");
        let section = |name: &str| {
            let start = pipeline.split(&format!("[stages.{name}]")).nth(1).unwrap();
            start.split("\n[").next().unwrap().to_owned()
        };
        assert!(section("quadrants").contains("\nweighting = \"precision\""));
        let keys = |section: String| -> Vec<String> {
            let keys = section.lines().filter_map(|line| line.split_once(" = ")).map(|(key, _)| key.to_owned());
            keys.filter(|key| !["kind", "inputs", "weighting", "rotation"].contains(&key.as_str())).collect()
        };
        assert!(keys(section("lines")).is_empty() && keys(section("quadrants")).is_empty(), "other parameters ship");
    }

    #[test]
    fn all_parameters_are_in_range_and_differ() {
        let all = Settings::all();
        for (index, settings) in all.iter().enumerate() {
            assert_eq!(settings.lines.check(), []);
            assert_eq!(settings.classifier.check(), []);
            let same = |other: &Settings| (&other.lines, &other.classifier) == (&settings.lines, &settings.classifier);
            assert!(!all[..index].iter().any(same), "{}", settings.name);
        }
    }
}
