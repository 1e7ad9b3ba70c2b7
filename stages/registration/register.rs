//! Registration of two maps, from the cells to a decision.

use super::comparison::MapView;
use super::icp::{IcpParameters, IcpRefusal, InitialGuess, refine};
use super::judgement::{Alias, Decision, JudgementParameters, SelfSimilarity, UserKnowledge, judge};
use super::search::{MapAlignerParameters, MapAlignment, PreparedMap, SearchRefusal, align_prepared};
use super::{Basis, Hypothesis};
use crate::shared::geometry::Grid;
use crate::shared::walls::{NORMAL_RADIUS, WallMap};

/// Two maps, prepared once for all steps.
pub struct PreparedPair<'a> {
    grids: [Grid<'a>; 2],
    rasters: [PreparedMap; 2],
    walls: [WallMap; 2],
}

impl<'a> PreparedPair<'a> {
    /// Prepares two maps.
    ///
    /// # Errors
    /// A map without walls, or larger than what is searched.
    pub fn new(a: Grid<'a>, b: Grid<'a>, parameters: &MapAlignerParameters) -> Result<Self, SearchRefusal> {
        let least = PreparedMap::least_cell(&a).max(PreparedMap::least_cell(&b));
        let cell = least.max(0.5 * parameters.cell);
        let prepare = |robot: &str, grid: &Grid<'_>| PreparedMap::new(robot, grid, cell, parameters.max_extent);
        let (raster_a, raster_b) = rayon::join(|| prepare("a", &a), || prepare("b", &b));
        let (walls_a, walls_b) = rayon::join(|| WallMap::new(&a, NORMAL_RADIUS), || WallMap::new(&b, NORMAL_RADIUS));
        Ok(Self { grids: [a, b], rasters: [raster_a?, raster_b?], walls: [walls_a, walls_b] })
    }

    /// Cells and walls of both maps, for the comparison.
    pub fn views(&self) -> [MapView<'_>; 2] {
        [0, 1].map(|index| MapView::rigid(self.grids[index], &self.walls[index]))
    }

    /// Searches all relative poses, or those that the user allows, and refines the peaks.
    ///
    /// # Errors
    /// The maps fit nowhere.
    pub fn hypotheses(
        &self,
        known: &UserKnowledge,
        parameters: &MapAlignerParameters,
        icp: &IcpParameters,
    ) -> Result<Vec<Hypothesis>, SearchRefusal> {
        let [a, b] = &self.rasters;
        let found = align_prepared(a, b, known.window.as_ref(), parameters)?;
        let guesses = found.hypotheses.iter().enumerate();
        Ok(guesses.map(|(rank, guess)| self.refined(guess, found.reason(rank), icp)).collect())
    }

    /// Refines a peak of the search.
    fn refined(&self, guess: &MapAlignment, reason: String, icp: &IcpParameters) -> Hypothesis {
        let start = InitialGuess::new(guess.transform_a_b, guess.covariance, icp);
        let [a, b] = &self.walls;
        let refinement = refine(a, b, &start, icp);
        let registration = &refinement.registration;
        let refusal = refinement.refusal.clone().or_else(|| IcpRefusal::of_search(&start, registration, icp));
        Hypothesis {
            transform_a_b: registration.transform_a_b,
            covariance: registration.covariance,
            basis: Basis::Search { significance: guess.significance.max(0.0), margin: guess.margin },
            source: "maps".to_owned(),
            reason: refusal.as_ref().map_or(reason, ToString::to_string),
            is_refused: refusal.is_some(),
            is_alternative_only: false,
        }
    }
}

/// Parameters of all steps.
#[derive(Clone, Debug, Default)]
pub struct RegistrationParameters {
    /// Search.
    pub search: MapAlignerParameters,
    /// Refinement.
    pub icp: IcpParameters,
    /// Comparison and judgement.
    pub judgement: JudgementParameters,
}

/// Registers two maps: estimates the pose of map b in map a, and judges it.
///
/// # Errors
/// The maps fit nowhere.
pub fn register(
    pair: &PreparedPair<'_>,
    known: &UserKnowledge,
    parameters: &RegistrationParameters,
) -> Result<Option<Decision>, SearchRefusal> {
    let RegistrationParameters { search, icp, judgement } = parameters;
    let hypotheses = pair.hypotheses(known, search, icp)?;
    let [a, b] = pair.views();
    let Some(decision) = judge(&a, &b, &hypotheses, known, judgement) else { return Ok(None) };
    if !decision.rests_on_maps_alone() {
        return Ok(Some(decision));
    }
    let [similar_a, similar_b] = [&a, &b].map(|view| SelfSimilarity::new(view, judgement));
    let alias = Alias::likeliest(&decision, (&a, &similar_a), (&b, &similar_b), known.window.as_ref(), judgement);
    Ok(Some(decision.against(alias.as_ref(), judgement)))
}
