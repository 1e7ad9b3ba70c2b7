//! What the stages of `map_merge` make of two maps, without messages.

use super::library::MapOfBuilding;
use gridweave_stages::mapping::map_cleaner::{MapCleanerParameters, clean};
use gridweave_stages::registration::judgement::{Alias, Candidate, SelfSimilarity, UserKnowledge, candidates, judge};
use gridweave_stages::registration::{PreparedPair, RegistrationParameters, register};
use gridweave_stages::shared::geometry::{Grid, Pose2};

/// The outcome for a pair.
pub(super) struct Judged {
    /// The pose `T_a_b`, if the maps are merged.
    merged: Option<Pose2>,
    /// The probability of the best hypothesis.
    pub(super) probability: f64,
    /// Why they are not, in a line.
    pub(super) refusal: Option<String>,
}

impl Judged {
    fn refused(reason: &str) -> Self {
        Self { merged: None, probability: 0.0, refusal: Some(first_line(reason)) }
    }

    pub(super) fn is_merged(&self) -> bool {
        self.merged.is_some()
    }

    /// `T_a_b`, if the maps are merged.
    pub(super) fn place(&self) -> Option<&Pose2> {
        self.merged.as_ref()
    }
}

/// Merges two maps.
pub(super) fn judge_maps(a: &MapOfBuilding, b: &MapOfBuilding) -> Judged {
    let parameters = RegistrationParameters::default();
    let outcome =
        with_prepared(a, b, &parameters, |pair| match register(pair, &UserKnowledge::default(), &parameters) {
            Ok(Some(decision)) => Judged {
                merged: decision.refusal.is_none().then(|| decision.candidate.transform_a_b()),
                probability: decision.probability,
                refusal: decision.refusal.as_ref().map(|refusal| first_line(&refusal.headline())),
            },
            Ok(None) => Judged::refused("no place was proposed"),
            Err(refusal) => Judged::refused(&refusal.to_string()),
        });
    outcome.unwrap_or_else(|problem| Judged::refused(&problem))
}

/// The places that are judged for two maps, and the aliases of the most probable one if it is more probable than
/// `likely`.
pub(crate) fn candidates_of(a: &MapOfBuilding, b: &MapOfBuilding, likely: f64) -> (Vec<Candidate>, Vec<Alias>) {
    let parameters = RegistrationParameters::default();
    let RegistrationParameters { search, icp, judgement } = &parameters;
    let known = UserKnowledge::default();
    let found = with_prepared(a, b, &parameters, |pair| {
        let Ok(hypotheses) = pair.hypotheses(&known, search, icp) else { return Default::default() };
        let [a, b] = pair.views();
        let decision = judge(&a, &b, &hypotheses, &known, judgement).filter(|decision| decision.probability > likely);
        let aliases = decision.map(|decision| {
            let [similar_a, similar_b] = [&a, &b].map(|view| SelfSimilarity::new(view, judgement));
            Alias::all(&decision, (&a, &similar_a), (&b, &similar_b), None, judgement)
        });
        (candidates(&a, &b, &hypotheses, &judgement.comparison()), aliases.unwrap_or_default())
    });
    found.unwrap_or_default()
}

/// Does something with two maps, cleaned and prepared; or says why they cannot be used.
fn with_prepared<T>(
    a: &MapOfBuilding,
    b: &MapOfBuilding,
    parameters: &RegistrationParameters,
    work: impl FnOnce(&PreparedPair<'_>) -> T,
) -> Result<T, String> {
    let cleaned = |map: &MapOfBuilding| {
        let grid = map.grid().map_err(|problem| format!("{problem:#}"))?;
        let mut cells = grid.cells.to_vec();
        clean(&grid, &MapCleanerParameters::default(), &mut cells);
        Ok::<_, String>((grid.geometry, cells))
    };
    let [(geometry_a, cells_a), (geometry_b, cells_b)] = [cleaned(a)?, cleaned(b)?];
    let [a, b] = [(geometry_a, &cells_a), (geometry_b, &cells_b)].map(|(geometry, cells)| Grid { geometry, cells });
    PreparedPair::new(a, b, &parameters.search).map(|pair| work(&pair)).map_err(|refusal| refusal.to_string())
}

fn first_line(text: &str) -> String {
    text.lines().next().unwrap_or_default().to_owned()
}
