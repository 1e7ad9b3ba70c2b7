//! The judgement on all hypotheses for a pair of robots, and what is said of it.

use super::refusal::Hypotheses;
use super::{Agreement, Alias, BentPlace, Origin, Refusal, Rival};
use crate::geometry::Pose2;
use gridweave_runtime::ros::Alignment;
use nalgebra::Matrix3;
use std::fmt::Write;

/// A hypothesis, and what the maps say of each other there.
#[derive(Clone, Copy, Debug)]
pub struct Candidate<'a> {
    /// The hypothesis.
    pub alignment: &'a Alignment,
    /// What the maps say, as they are bent if they are.
    pub agreement: Agreement,
    /// Where map b lies if it is bent; none if it is rigid.
    pub bent: Option<BentPlace>,
    /// How far the place of a part of the map may be from where this one has it: the covariance of (x, y, yaw) that the bend of
    /// the maps leaves, whether it is worth its cost or not; none if it was not looked at.
    pub left_by_bend: Option<Matrix3<f64>>,
}

impl<'a> Candidate<'a> {
    /// A hypothesis with map b as it came.
    pub(super) fn rigid(alignment: &'a Alignment, agreement: Agreement) -> Self {
        Self { alignment, agreement, bent: None, left_by_bend: None }
    }

    /// Where map b lies: `T_a_b`.
    pub fn transform_a_b(&self) -> Pose2 {
        self.bent.map_or_else(|| self.alignment.transform_a_b(), |bent| bent.transform_a_b)
    }
}

/// The judgement on all hypotheses for a pair.
#[derive(Clone, Debug)]
pub struct Verdict<'a> {
    /// The hypothesis that is right, or came nearest to it.
    pub candidate: Candidate<'a>,
    /// Why it is not accepted; none if it is.
    pub refusal: Option<Refusal>,
    /// The place elsewhere that is most like it, if there is one.
    pub rival: Option<Rival>,
    /// The evidence for the other place that is most like it, as a share of that for this one.
    pub evidence_elsewhere: f64,
    /// The probability that it is right, 0 to 1, see [`Odds`](super::Odds).
    pub score: f64,
    /// Another source that has found the same place.
    pub found_too_by: Option<&'a str>,
    /// If the user has chosen it: its number, and of how many.
    pub chosen: Option<(usize, usize)>,
    /// All hypotheses that took part, in the order in which the user can choose one.
    pub hypotheses: Hypotheses,
}

impl Verdict<'_> {
    /// Whether it accepts a place for which the walls of the two maps alone speak.
    pub fn rests_on_walls_alone(&self) -> bool {
        let is_by_search = matches!(Origin::of(self.candidate.alignment), Origin::Search { .. });
        self.refusal.is_none() && self.chosen.is_none() && self.found_too_by.is_none() && is_by_search
    }

    /// The same, where the building looks alike at another place if there is one.
    pub fn against(self, alias: Option<&Alias>, accept: f64) -> Self {
        let Some(alias) = alias else { return self };
        let score = 1.0 / (1.0 / self.score + (-alias.log_odds).exp());
        let Rival { shift, turn, agreement: there, .. } = alias.rival;
        let aliased = Refusal::Aliased { shift, turn: turn.to_degrees(), itself: alias.itself, there };
        let refusal = if score < accept { Some(aliased) } else { self.refusal };
        Self { score, refusal, ..self }
    }

    /// What speaks for it, or against it, in plain words: a paragraph of short lines for all, and behind an empty line the
    /// whole for those who ask. `accept` is the probability that is asked for, and `stage` the name of this stage.
    pub fn reason(&self, accept: f64, stage: &str) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = match &self.refusal {
            None => self.write_acceptance(&mut text),
            Some(Refusal::Before(reason)) => write!(text, "{reason}"),
            Some(refusal) => self.write_refusal(refusal, accept, stage, &mut text),
        };
        text
    }

    fn write_acceptance(&self, text: &mut String) -> std::fmt::Result {
        let Agreement { wall_on_wall, wall_on_free, overlap, .. } = self.candidate.agreement;
        let agree = format!("{wall_on_wall:.0} m of wall agree and {wall_on_free:.0} m contradict, in {overlap:.0} m2");
        match self.chosen {
            Some((number, count)) => writeln!(text, "hypothesis {number} of {count}, which was asked for: {agree}")?,
            None => writeln!(text, "{agree} that both know")?,
        }
        if let Some(BentPlace { bend, .. }) = self.candidate.bent {
            writeln!(text, "as the maps are bent by {bend:.2} m against each other")?;
        }
        write!(text, "\n{}", self.candidate.alignment.reason)?;
        if let Some(source) = self.found_too_by {
            write!(text, ", found by the {source}, too")?;
        }
        if self.chosen.is_none() {
            write!(text, "; the maps confirm it")?;
        }
        if let Some(Rival { agreement, .. }) = &self.rival {
            let share = 100.0 * agreement.wall_agreement();
            write!(text, "; at the best of other places {share:.0} % of {:.0} m agree", agreement.wall_seen())?;
        }
        Ok(())
    }

    fn write_refusal(&self, refusal: &Refusal, accept: f64, stage: &str, text: &mut String) -> std::fmt::Result {
        writeln!(text, "{}", refusal.headline())?;
        if !matches!(refusal, Refusal::Unexpected { .. } | Refusal::NoSuchHypothesis { .. }) {
            // Rounded down, so that what is too little is not shown as enough.
            let probability = (1000.0 * self.score).floor() / 1000.0;
            writeln!(text, "missing: a probability of {accept} (--set {stage}.accept); this is {probability:.3}")?;
        }
        if let Some(advice) = refusal.advice(&self.candidate.alignment.b) {
            writeln!(text, "try: {advice}")?;
        }
        let hypotheses = self.hypotheses.to_string();
        if matches!(refusal, Refusal::Ambiguous { .. }) && self.hypotheses.0.len() > 1 {
            write!(text, "{hypotheses}")?;
        }
        write!(text, "\n{}; the maps do not confirm it: {refusal}", self.candidate.alignment.reason)?;
        if !hypotheses.is_empty() {
            let Alignment { a, b, .. } = self.candidate.alignment;
            write!(text, "\nplaces of the map of {b} on that of {a}:\n{}", hypotheses.trim_end())?;
        }
        Ok(())
    }
}
