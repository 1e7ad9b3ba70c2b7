//! The decision on all hypotheses for a pair of maps, and its reason as text.

use super::weights::{INTERCEPT, TYPICAL, WEIGHTS};
use super::{Alias, Candidate, JudgementParameters, Listed, Refusal, Term};
use crate::registration::comparison::{Agreement, Deformed};
use crate::registration::{Basis, Hypothesis};
use std::fmt::Write;

/// Change of the size of a map from which on its resolution is in doubt: lidars and odometry are right to a percent or
/// two.
const RESOLUTION_ERROR: f64 = 0.02;

/// The second most probable candidate.
#[derive(Clone, Debug, PartialEq)]
pub struct SecondBest {
    /// Shift of the centroid of the inliers to it, metres.
    pub shift: f64,
    /// Rotation of map b to it, radians.
    pub turn: f64,
    /// Agreement of the maps there.
    pub agreement: Agreement,
    /// Its probability.
    pub probability: f64,
    /// Its source, for the user.
    pub source: String,
    /// Whether it rests on tags.
    pub is_by_tags: bool,
}

impl SecondBest {
    /// Describes one candidate relative to the best.
    pub(super) fn new(best: &Candidate, other: &Candidate, probability: f64) -> Self {
        let (shift, turn) = best.change(&other.transform_a_b());
        Self {
            shift,
            turn,
            agreement: other.agreement,
            probability,
            source: other.hypothesis.source.clone(),
            is_by_tags: other.rests_on(Basis::is_by_tags),
        }
    }
}

/// The decision on all hypotheses for a pair.
#[derive(Clone, Debug)]
pub struct Decision {
    /// The candidate that is accepted, or that is most probable.
    pub candidate: Candidate,
    /// Why it is refused; none if it is accepted.
    pub refusal: Option<Refusal>,
    /// The second most probable candidate, if there is one.
    pub second_best: Option<SecondBest>,
    /// Probability that the candidate is right, 0 to 1.
    pub probability: f64,
    /// Prior log-odds of the candidate, from tags and from initial poses.
    pub prior: f64,
    /// If the user has chosen it: its number, and the number of hypotheses.
    pub chosen: Option<(usize, usize)>,
    /// All hypotheses that competed, in the order in which the user can choose one.
    pub listed: Listed,
}

impl Decision {
    /// Decision on a candidate that was not judged.
    pub(super) fn of(candidate: Candidate) -> Self {
        Self {
            candidate,
            refusal: None,
            second_best: None,
            probability: 0.0,
            prior: 0.0,
            chosen: None,
            listed: Listed::default(),
        }
    }

    /// Whether it accepts a candidate that rests on the maps only.
    pub fn rests_on_maps_alone(&self) -> bool {
        self.refusal.is_none() && self.chosen.is_none() && !self.candidate.rests_on(Basis::is_by_tags)
    }

    /// The same decision with an alias as a further hypothesis, if there is one.
    pub fn against(self, alias: Option<&Alias>, parameters: &JudgementParameters) -> Self {
        let Some(alias) = alias else { return self };
        // The odds of all others against the candidate, and those of the alias.
        let others = (1.0 - self.probability) / self.probability;
        let probability = 1.0 / (1.0 + others + alias.log_odds.exp());
        let refusal = match probability < parameters.accept {
            true => Some(Refusal::Aliased { alias: alias.clone() }),
            false => self.refusal,
        };
        Self { probability, refusal, ..self }
    }

    /// Size of map b under the deformation, as a share of its size, where that puts the resolution of a map in doubt.
    pub fn other_scale(&self) -> Option<f64> {
        let scale = self.candidate.deformed.map(|deformed| deformed.scale);
        scale.filter(|scale| (scale - 1.0).abs() > RESOLUTION_ERROR)
    }

    /// The term by which the candidate is most below a usual right hypothesis.
    pub(super) fn weakest_term(&self) -> Term {
        let terms = self.candidate.terms();
        // A hypothesis that is not from a search has no peak.
        let is_by_search = self.candidate.rests_on(|basis| matches!(basis, Basis::Search { .. }));
        let counts = |index: &usize| {
            is_by_search || !matches!(Term::ALL[*index], Term::PeakSignificance | Term::MarginOverChance)
        };
        let shortfall = |index: &usize| WEIGHTS[*index] * (TYPICAL[*index] - terms.0[*index]);
        let weakest =
            (0..WEIGHTS.len()).filter(counts).max_by(|one, other| shortfall(one).total_cmp(&shortfall(other)));
        Term::ALL[weakest.unwrap_or_default()]
    }

    /// A hypothesis of another source at the same pose.
    pub fn also_found_by(&self) -> Option<&Hypothesis> {
        let source = &self.candidate.hypothesis.source;
        self.candidate.others.iter().find(|other| other.source != *source)
    }

    /// Reason of the decision: a short paragraph, and after an empty line all details. `accept` is the required
    /// probability, and `stage` the name of the stage that has this parameter.
    pub fn reason(&self, accept: f64, stage: &str, robot_a: &str, robot_b: &str) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = match &self.refusal {
            None => self.write_acceptance(robot_b, &mut text),
            Some(Refusal::RefusedUpstream(reason)) => write!(text, "{reason}"),
            Some(refusal) => self.write_refusal(refusal, accept, stage, (robot_a, robot_b), &mut text),
        };
        text
    }

    fn write_acceptance(&self, robot_b: &str, text: &mut String) -> std::fmt::Result {
        let Agreement { inlier_length, conflict_length, overlap, .. } = self.candidate.agreement;
        let agree =
            format!("{inlier_length:.0} m of wall agree and {conflict_length:.0} m contradict, in {overlap:.0} m2");
        match self.chosen {
            Some((number, count)) => writeln!(text, "hypothesis {number} of {count}, chosen by the user: {agree}")?,
            None => writeln!(text, "{agree} of common area")?,
        }
        if let Some(Deformed { rms, .. }) = self.candidate.deformed {
            writeln!(text, "with a deformation of {rms:.2} m between the maps")?;
        }
        if let Some(scale) = self.other_scale() {
            writeln!(text, "which makes {robot_b} {scale:.2} times as large: are the resolutions right?")?;
        }
        write!(text, "\n{}", self.candidate.hypothesis.reason)?;
        if let Some(other) = self.also_found_by() {
            write!(text, ", found by the {}, too", other.source)?;
        }
        if self.chosen.is_some() {
            return Ok(());
        }
        write!(text, "; the maps confirm it")?;
        if let Some(SecondBest { agreement, .. }) = &self.second_best {
            let share = 100.0 * agreement.inlier_ratio();
            write!(text, "; at the second-best pose {share:.0} % of {:.0} m agree", agreement.compared_length())?;
        }
        self.write_sum(text)
    }

    fn write_refusal(
        &self,
        refusal: &Refusal,
        accept: f64,
        stage: &str,
        (robot_a, robot_b): (&str, &str),
        text: &mut String,
    ) -> std::fmt::Result {
        writeln!(text, "{}", refusal.headline())?;
        let is_judged = !matches!(refusal, Refusal::OutsideWindow { .. } | Refusal::NoSuchHypothesis { .. });
        let lacks_probability = is_judged && !matches!(refusal, Refusal::Deformed { .. });
        if lacks_probability {
            // Rounded down, so that a value below the bound is not shown as the bound.
            let probability = (1000.0 * self.probability).floor() / 1000.0;
            writeln!(text, "missing: a probability of {accept} (--set {stage}.accept); this is {probability:.3}")?;
        }
        if let Some(advice) = refusal.advice(robot_b) {
            writeln!(text, "try: {advice}")?;
        }
        let listed = self.listed.to_string();
        if matches!(refusal, Refusal::Ambiguous { .. }) && self.listed.0.len() > 1 {
            write!(text, "{listed}")?;
        }
        write!(text, "\n{}; the maps do not confirm it: {refusal}", self.candidate.hypothesis.reason)?;
        if is_judged {
            self.write_sum(text)?;
        }
        if !listed.is_empty() {
            write!(
                text,
                "\nhypotheses, as poses of the map of {robot_b} in that of {robot_a}:\n{}",
                listed.trim_end()
            )?;
        }
        Ok(())
    }

    /// Writes the sum term by term.
    fn write_sum(&self, text: &mut String) -> std::fmt::Result {
        let terms = self.candidate.terms();
        write!(text, "\nlog-odds that it is right:")?;
        write!(text, "\n  {:<36} {INTERCEPT:>7.1}", "intercept")?;
        if self.prior != 0.0 {
            write!(text, "\n  {:<36} {:>7.1}", "tags and initial poses", self.prior)?;
        }
        for ((term, value), contribution) in Term::ALL.iter().zip(terms.0).zip(terms.contributions()) {
            write!(text, "\n  {:<36} {contribution:>7.1}   ({value:.2})", term.name())?;
        }
        write!(text, "\n  {:<36} {:>7.1}", "sum", terms.log_odds() + self.prior)?;
        if let Some(SecondBest { probability, .. }) = &self.second_best {
            write!(text, "\n  probability {:.6}, of the second-best hypothesis {probability:.6}", self.probability)?;
        }
        Ok(())
    }
}
