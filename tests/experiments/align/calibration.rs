//! What the verifier's score means.

use super::trial::{Judged, PairTrial};
use crate::results::Results;
use crate::statistics::{mean, wilson_interval};
use anyhow::Result;
use gridweave::table::Table;

/// Borders of the bins of scores.
const BORDERS: [f64; 8] = [0.0, 0.1, 0.5, 0.9, 0.95, 0.99, 0.999, 1.0];

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
        Ok(())
    }
}
