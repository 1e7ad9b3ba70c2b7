//! What the verifier's score means.

use super::trial::{Judged, PairTrial};
use crate::plot::{Axis, Plot, Series, Shape};
use crate::results::Results;
use crate::statistics::{mean, wilson_interval};
use anyhow::Result;
use gridweave::table::Table;

/// Borders of the bins of scores.
const BORDERS: [f64; 9] = [0.0, 0.1, 0.5, 0.9, 0.95, 0.99, 0.999, 0.9999, 1.0];

/// Everything that was judged.
pub(super) struct Calibration(Vec<Judged>);

impl Calibration {
    pub(super) fn of(trials: &[&PairTrial]) -> Self {
        Self(trials.iter().filter_map(|trial| trial.judged).collect())
    }

    /// How often the best hypothesis of a pair is right, by its score.
    pub(super) fn report(&self, results: &mut Results) -> Result<()> {
        let mut table = Table::new(["score", "best hypotheses", "mean score", "right", "right, 95 % interval"]);
        for bin in BORDERS.windows(2) {
            let holds = |score: f64| (bin[0]..bin[1]).contains(&score) || (bin[1] == 1.0 && score >= 1.0);
            let judged: Vec<&Judged> = self.0.iter().filter(|judged| holds(judged.score)).collect();
            let right = judged.iter().filter(|judged| judged.is_right).count();
            let (low, high) = wilson_interval(right, judged.len());
            let scores: Vec<f64> = judged.iter().map(|judged| judged.score).collect();
            let mean = if scores.is_empty() { "-".to_owned() } else { format!("{:.5}", mean(&scores)) };
            let interval = format!("{:.1} % to {:.1} %", 100.0 * low, 100.0 * high);
            let range = format!("{} to {}", bin[0], bin[1]);
            table.row([range, judged.len().to_string(), mean, right.to_string(), interval]);
        }
        results.table("align_score", "What the verifier's score means", &table)?;
        self.curve(results)
    }

    /// The share that is right by the mean score of each bin of odds, each bin ten times the odds of the one before or,
    /// in the middle, three times.
    fn curve(&self, results: &mut Results) -> Result<()> {
        let odds = |score: f64| (score / (1.0 - score).max(1e-12)).log10();
        let borders: Vec<f64> = (-8..=8).map(|half| 0.5 * f64::from(half)).collect();
        let (mut points, mut band) = (Vec::new(), Vec::new());
        for (number, bin) in borders.windows(2).enumerate() {
            let (is_first, is_last) = (number == 0, number + 2 == borders.len());
            let holds = |score: f64| (is_first || odds(score) >= bin[0]) && (is_last || odds(score) < bin[1]);
            let judged: Vec<&Judged> = self.0.iter().filter(|judged| holds(judged.score)).collect();
            if judged.is_empty() {
                continue;
            }
            let right = judged.iter().filter(|judged| judged.is_right).count();
            let (low, high) = wilson_interval(right, judged.len());
            let middle = 0.5 * (bin[0] + bin[1]);
            points.push((middle, right as f64 / judged.len() as f64));
            band.push((middle, low, high));
        }
        let exact = (-40..=40).map(|tenth| 0.1 * f64::from(tenth)).map(|odds| (odds, 1.0 / (1.0 + 10f64.powf(-odds))));
        let plot = Plot {
            title: "How often the best hypothesis is right".to_owned(),
            x: Axis::new("odds that the verifier reports, power of ten"),
            y: Axis::new("share that is right, with the 95 % interval").range(0.0, 1.0),
            shape: Shape::Lines(vec![
                Series::new("measured", points).with_band(band),
                Series::new("if the odds were exact", exact.collect()),
            ]),
        };
        results.plot("align_score", &plot)
    }
}
