//! What the verifier's score means, and the weights that it is made from.

use super::trial::{Judged, PairTrial};
use crate::results::Results;
use crate::statistics::{mean, wilson_interval};
use anyhow::Result;
use gridweave::table::Table;
use nalgebra::{Matrix4, Vector4};

/// Borders of the bins of scores.
const BORDERS: [f64; 7] = [0.0, 0.1, 0.5, 0.9, 0.95, 0.99, 1.0];
/// Keeps the weights finite where the outcomes can be parted without error.
const RIDGE: f64 = 0.02;

/// Everything that was judged.
pub(super) struct Calibration(Vec<Judged>);

impl Calibration {
    pub(super) fn of(trials: &[&PairTrial]) -> Self {
        Self(trials.iter().filter_map(|trial| trial.judged).collect())
    }

    /// How often the best hypothesis of a pair is right, by its score; and with `fit`, the weights that suit best.
    pub(super) fn report(&self, fit: bool, results: &mut Results) -> Result<()> {
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
        if fit {
            let [intercept, length, agreement, elsewhere]: [f64; 4] = self.fit().into();
            println!(
                "weights: intercept {intercept:.3}, length {length:.3}, agreement {agreement:.3}, evidence \
                 elsewhere {elsewhere:.3}\n"
            );
        }
        Ok(())
    }

    /// Logistic regression by Newton's method.
    fn fit(&self) -> Vector4<f64> {
        let mut weights = Vector4::zeros();
        for _ in 0..50 {
            let (mut gradient, mut hessian) = (weights * -RIDGE, Matrix4::identity() * RIDGE);
            for judged in &self.0 {
                let features = features(judged);
                let probability = 1.0 / (1.0 + (-weights.dot(&features)).exp());
                gradient += features * (f64::from(u8::from(judged.is_right)) - probability);
                hessian += features * features.transpose() * (probability * (1.0 - probability));
            }
            let Some(step) = hessian.cholesky().map(|cholesky| cholesky.solve(&gradient)) else { break };
            weights += step;
            if step.norm() < 1e-9 {
                break;
            }
        }
        weights
    }
}

/// 1, and what the score is made from, as `merge_verifier` takes it.
fn features(judged: &Judged) -> Vector4<f64> {
    let seen = judged.wall_on_wall + judged.wall_on_free;
    let agreement = if seen > 0.0 { judged.wall_on_wall / seen } else { 0.0 };
    let length = judged.wall_on_wall.max(1.0).ln();
    Vector4::new(1.0, length, agreement - 0.8, judged.evidence_elsewhere)
}
