//! The scale between two maps, where the resolution of one of them is wrong.
//!
//! A map whose resolution is some percent off fits nowhere. So maps that were refused are searched once more with the
//! cells of map b smaller and larger, in steps so small that the ends of a building move by less than the search
//! tolerates.

use super::judgement::{Decision, UserKnowledge};
use super::search::{MapAlignerParameters, PreparedMap, peak_significance};
use super::{PreparedPair, RegistrationParameters, register};
use crate::shared::geometry::{Grid, GridGeometry};
use rayon::prelude::*;

/// Bounds of the step between the factors that are tried: with fewer the time of large maps is bounded, whose ends then
/// move by a cell of the wider search.
const STEPS: (f64, f64) = (0.025, 0.05);
/// Probability that one of the scales that are looked at closely stands out by chance.
const BY_CHANCE: f64 = 0.05;
/// Step at which the search for the best factor ends.
const FINEST_STEP: f64 = 0.002;
/// An error of the resolution below this is a deformation.
const LEAST_ERROR: f64 = 0.01;
/// Shifts of regions that are the noise of drawing, metres.
const NOISE: f64 = 0.01;
/// Factors of a resolution that was halved or doubled with the image, or taken from another file.
const DOUBLINGS: [f64; 2] = [0.5, 2.0];
/// Number of the best factors that are looked at closely.
const LOOKED_AT: usize = 2;
/// Least probability at which a scale is reported, which is not a merge.
pub(super) const LEAST_PROBABILITY: f64 = 0.5;

/// A scale at which two maps agree.
#[derive(Clone, Debug)]
pub struct Scale {
    /// Size of map b as a share of the size that it has by its resolution.
    pub factor: f64,
    /// Decision on the maps with map b at that size.
    pub decision: Decision,
}

impl Scale {
    /// Finds the scale at which two maps agree, from `1 / (1 + range)` to `1 + range`, or else at a half or two. `None`
    /// if there is no scale other than 1 at which that is more probable than not.
    pub fn search(a: Grid<'_>, b: Grid<'_>, range: f64, parameters: &RegistrationParameters) -> Option<Self> {
        let rasters = Rasters::new(a, b, 1.0 + range, &parameters.search)?;
        let step = rasters.step();
        let most = ((1.0 + range).ln() / step).floor() as i32;
        let factors: Vec<f64> = (-most..=most).map(|number| (f64::from(number) * step).exp()).collect();
        Self::near(a, b, range, &rasters, &factors, parameters)
            .or_else(|| Self::doubled(a, b, factors.len() + DOUBLINGS.len(), parameters))
    }

    /// Finds the scale at which two maps agree within the range, near one of `factors`.
    fn near(
        a: Grid<'_>,
        b: Grid<'_>,
        range: f64,
        rasters: &Rasters<'_>,
        factors: &[f64],
        parameters: &RegistrationParameters,
    ) -> Option<Self> {
        let significances: Vec<f64> = factors.par_iter().map(|factor| rasters.significance(*factor)).collect();
        // By chance a peak is as significant with probability `exp(-significance)`.
        let least = (factors.len() as f64 / BY_CHANCE).ln();
        let mut order: Vec<usize> = (0..factors.len()).filter(|number| significances[*number] >= least).collect();
        // The sort is stable: of equals the smaller comes first.
        order.sort_by(|one, other| significances[*other].total_cmp(&significances[*one]));
        let tried = factors.len();
        let is_within = |factor: f64| factor.ln().abs() <= (1.0 + range).ln();
        let at = |factor: f64| is_within(factor).then(|| Self::at(a, b, factor, tried, parameters))?;
        let sharper = |one: Self, other: Self| if other.precision() > one.precision() { other } else { one };
        let mut best =
            order.iter().take(LOOKED_AT).filter_map(|number| at(factors[*number])).reduce(Self::more_probable)?;
        let mut step = 0.5 * rasters.step();
        // Where it was sharper on one side, the other is the factor that it comes from.
        let mut is_known = [false; 2];
        while step > FINEST_STEP {
            let beside = |side: usize, step: f64| (!is_known[side]).then(|| at(best.factor * step.exp()))?;
            let (smaller, larger) = rayon::join(|| beside(0, -step), || beside(1, step));
            let last = best.factor;
            best = [smaller, larger].into_iter().flatten().fold(best, sharper);
            is_known = [best.factor > last, best.factor < last];
            step = if best.factor == last { 0.5 * step } else { step };
        }
        // A deformation makes up for what is left, and shows it.
        let left = best.decision.candidate.deformed.map(|deformed| best.factor * deformed.scale);
        let best = left.and_then(at).unwrap_or(best);
        // At the end of the range the maps may agree better beyond it.
        let is_inside = is_within(best.factor * (1.0 + LEAST_ERROR)) && is_within(best.factor / (1.0 + LEAST_ERROR));
        (is_inside && best.factor.ln().abs() > LEAST_ERROR).then_some(best)
    }

    /// Finds whether two maps agree with map b at half or at twice its size, which is not searched for the factors
    /// beside these.
    fn doubled(a: Grid<'_>, b: Grid<'_>, tried: usize, parameters: &RegistrationParameters) -> Option<Self> {
        let least = (DOUBLINGS.len() as f64 / BY_CHANCE).ln();
        let is_significant = |factor: &f64| {
            let rasters = Rasters::new(a, b, *factor, &parameters.search);
            rasters.is_some_and(|rasters| rasters.significance(*factor) >= least)
        };
        let significant = DOUBLINGS.into_iter().filter(is_significant);
        significant.filter_map(|factor| Self::at(a, b, factor, tried, parameters)).reduce(Self::more_probable)
    }

    /// The more probable of two scales; of equals the first.
    fn more_probable(self, other: Self) -> Self {
        if other.log_odds() > self.log_odds() { other } else { self }
    }

    /// Log-odds of the maps at this scale, before they are compared with those of other poses.
    fn log_odds(&self) -> f64 {
        self.decision.candidate.terms().log_odds()
    }

    /// Precision of the walls that agree: their length over the variance of where they are drawn.
    fn precision(&self) -> f64 {
        let agreement = &self.decision.candidate.agreement;
        agreement.inlier_length / (NOISE.powi(2) + agreement.residual.powi(2))
    }

    /// Registers the maps with map b larger by a factor. `None` if it is not more probable than not that they agree,
    /// where one of all factors that were tried may fit by chance.
    fn at(a: Grid<'_>, b: Grid<'_>, factor: f64, tried: usize, parameters: &RegistrationParameters) -> Option<Self> {
        let pair = PreparedPair::new(a, scaled(b, factor), &parameters.search).ok()?;
        let decision = register(&pair, &UserKnowledge::default(), parameters).ok()??;
        let odds = decision.probability / (1.0 - decision.probability).max(f64::EPSILON) / tried as f64;
        let is_probable = odds / (1.0 + odds) >= LEAST_PROBABILITY;
        (is_probable && !decision.candidate.hypothesis.is_refused).then_some(Self { factor, decision })
    }
}

/// A map with cells larger by a factor.
fn scaled(map: Grid<'_>, factor: f64) -> Grid<'_> {
    let geometry = GridGeometry { resolution: factor * map.geometry.resolution, ..map.geometry };
    Grid { geometry, ..map }
}

/// Two maps as they are searched at each scale.
struct Rasters<'a> {
    a: PreparedMap,
    b: Grid<'a>,
    /// Half the diagonal of the smaller map, metres.
    radius: f64,
    search: MapAlignerParameters,
}

impl<'a> Rasters<'a> {
    /// For factors up to the largest. `None` if a map has no walls, or is too large.
    fn new(a: Grid<'_>, b: Grid<'a>, largest: f64, search: &MapAlignerParameters) -> Option<Self> {
        let search = MapAlignerParameters { max_hypotheses: 1, ..search.clone() };
        // As wide for all scales.
        let least = PreparedMap::least_cell(&a).max(largest * PreparedMap::least_cell(&b));
        let search = MapAlignerParameters { cell: search.cell.max(2.0 * least), ..search };
        let prepare = |map: &Grid<'_>| PreparedMap::new("", map, 0.5 * search.cell, search.max_extent).ok();
        let (a, of_b) = (prepare(&a)?, prepare(&b)?);
        let radius = a.radius().min(of_b.radius());
        Some(Self { a, b, radius, search })
    }

    /// Step between factors of which half moves the ends of the smaller map by half a cell of the search, which are
    /// twice as wide as those in which poses are scored.
    fn step(&self) -> f64 {
        (2.0 * self.search.cell / self.radius).clamp(STEPS.0, STEPS.1)
    }

    /// Peak significance of the best pose with map b larger by a factor; 0 where the maps fit nowhere.
    fn significance(&self, factor: f64) -> f64 {
        let b = PreparedMap::new("", &scaled(self.b, factor), 0.5 * self.search.cell, self.search.max_extent);
        b.map_or(0.0, |b| peak_significance(&self.a, &b, &self.search))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::test_world::floor_plan::{DrawnMap, FloorPlan, drawing, seen};

    /// Two parts of an office.
    fn office() -> [DrawnMap; 2] {
        let plan = FloorPlan::office();
        let a = plan.draw(seen(-1.0, -1.0, 15.0, 13.0), drawing(3.0, 2.0, 0.4));
        [a, plan.draw(seen(4.0, -1.0, 21.0, 13.0), drawing(12.0, 6.0, -2.1))]
    }

    #[test]
    fn the_scale_of_a_map_with_a_wrong_resolution_is_found() {
        let [a, b] = office();
        let parameters = RegistrationParameters::default();
        let (a, b) = (a.view().grid, b.view().grid);
        let found = Scale::search(a, scaled(b, 1.0 / 0.88), 0.2, &parameters).unwrap();
        assert!((found.factor - 0.88).abs() < 0.005, "{}", found.factor);
        assert!(found.decision.candidate.agreement.inlier_length > 20.0);
        let beyond = Scale::search(a, scaled(b, 1.0 / 0.88), 0.05, &parameters);
        assert!(beyond.is_none_or(|scale| scale.factor.ln().abs() <= 1.05_f64.ln()), "not beyond the range");
        assert!(Scale::search(a, b, 0.2, &parameters).is_none(), "the resolution is right");
        for factor in DOUBLINGS {
            let found = Scale::search(a, scaled(b, 1.0 / factor), 0.2, &parameters).unwrap();
            assert_eq!(found.factor, factor);
        }
        let another = FloorPlan::another_office().draw(seen(-1.0, -1.0, 21.0, 13.0), drawing(0.0, 0.0, 0.0));
        assert!(Scale::search(a, another.view().grid, 0.2, &parameters).is_none(), "another building");
        let doubled = scaled(another.view().grid, 2.0);
        assert!(Scale::search(a, doubled, 0.2, &parameters).is_none(), "another building at twice its size");
    }

    #[test]
    fn a_map_that_is_deformed_to_another_size_puts_its_resolution_in_doubt() {
        let [a, b] = office();
        let parameters = RegistrationParameters::default();
        let decision = |factor: f64| {
            let pair = PreparedPair::new(a.view().grid, scaled(b.view().grid, factor), &parameters.search).unwrap();
            register(&pair, &UserKnowledge::default(), &parameters).unwrap().unwrap()
        };
        assert_eq!(decision(1.0).other_scale(), None);
        let larger = decision(1.06);
        let scale = larger.other_scale().unwrap();
        assert!((scale * 1.06 - 1.0).abs() < 0.02, "{scale}");
        assert!(larger.reason(0.98, "verifier", "a", "b").contains("which makes b 0.9"));
    }
}
