//! What the stages of `map_merge` make of two maps, without messages.

use super::library::MapOfBuilding;
use gridweave_runtime::ros::Alignment;
use gridweave_stages::geometry::{Grid, Pose2, row_by_row};
use gridweave_stages::icp_refiner::{FirstGuess, IcpParameters, refine};
use gridweave_stages::map_aligner::{MapAlignerParameters, NamedMap, align_maps};
use gridweave_stages::map_cleaner::{MapCleanerParameters, clean};
use gridweave_stages::merge_verifier::{
    Agreement, Alias, BentPlace, MapView, MergeVerifierParameters, SelfSimilarity, UserKnowledge, compare, judge,
};
use gridweave_stages::walls::{NORMAL_RADIUS, WallMap};

/// What is told of a hypothesis beside what the maps say there.
const HEADS: [&str; 8] = ["x", "y", "yaw", "registered", "lead", "share", "bend m", "bend cost"];
/// What the maps say of each other, as they came and as they are bent.
const AGREEMENT_HEADS: [&str; 9] = [
    "evidence",
    "wall on wall m",
    "wall on free m",
    "wall across m",
    "confirming",
    "walls either way",
    "slide m",
    "overlap m2",
    "agreement",
];

/// The heads of the columns in which a hypothesis is told.
pub(super) fn heads() -> impl Iterator<Item = String> {
    let bent = AGREEMENT_HEADS.iter().map(|head| format!("bent {head}"));
    HEADS.iter().chain(&AGREEMENT_HEADS).map(ToString::to_string).chain(bent).chain(["why not".to_owned()])
}

/// The outcome for a pair.
pub(super) struct Judged {
    /// Where map b lies, if the maps are merged.
    merged: Option<Pose2>,
    /// The probability of the best hypothesis.
    pub(super) probability: f64,
    /// Why they are not, in a line.
    pub(super) refusal: Option<String>,
    /// All that was proposed.
    pub(super) hypotheses: Vec<Hypothesis>,
}

impl Judged {
    fn refused(reason: String) -> Self {
        Self { merged: None, probability: 0.0, refusal: Some(reason), hypotheses: Vec::new() }
    }

    pub(super) fn is_merged(&self) -> bool {
        self.merged.is_some()
    }

    /// `T_a_b`, if the maps are merged.
    pub(super) fn place(&self) -> Option<&Pose2> {
        self.merged.as_ref()
    }
}

/// What was proposed, and what the maps say of each other there.
pub(super) struct Hypothesis {
    pub(super) transform_a_b: Pose2,
    is_registered: bool,
    lead: f64,
    share: f64,
    agreement: Agreement,
    bent: Option<BentPlace>,
    reason: String,
}

impl Hypothesis {
    pub(super) fn cells(&self) -> Vec<String> {
        let place = &self.transform_a_b;
        let number = |value: f64| format!("{value:.3}");
        let of_bend =
            |value: fn(&BentPlace) -> f64| self.bent.as_ref().map_or_else(String::new, |bent| number(value(bent)));
        let mut cells = vec![
            number(place.translation.x),
            number(place.translation.y),
            number(place.rotation.angle()),
            self.is_registered.to_string(),
            number(self.lead),
            number(self.share),
            of_bend(|bent| bent.bend),
            of_bend(|bent| bent.cost),
        ];
        for agreement in [Some(&self.agreement), self.bent.as_ref().map(|bent| &bent.agreement)] {
            let told = agreement.map(|agreement| agreement_values(agreement).map(number));
            cells.extend(told.unwrap_or_default());
        }
        cells.push(self.reason.clone());
        cells
    }
}

/// What stands under [`AGREEMENT_HEADS`].
fn agreement_values(agreement: &Agreement) -> [f64; AGREEMENT_HEADS.len()] {
    let Agreement { evidence, wall_on_wall, wall_on_free, wall_across, confirming, slide, overlap, .. } = *agreement;
    let either_way = agreement.walls_either_way as f64;
    let share = agreement.wall_agreement();
    [evidence, wall_on_wall, wall_on_free, wall_across, confirming, either_way, slide, overlap, share]
}

/// Merges two maps; `with_bends` bends map b onto map a at every hypothesis that was registered, to tell of it.
pub(super) fn judge_maps(a: &MapOfBuilding, b: &MapOfBuilding, with_bends: bool) -> Judged {
    let (a, b) = match (a.grid(), b.grid()) {
        (Ok(a), Ok(b)) => (a, b),
        (Err(problem), _) | (_, Err(problem)) => return Judged::refused(format!("{problem:#}")),
    };
    let cleaned = [&a, &b].map(|grid| {
        let mut cells = grid.cells.to_vec();
        clean(grid, &MapCleanerParameters::default(), &mut cells);
        cells
    });
    let [a, b] = [(&a, &cleaned[0]), (&b, &cleaned[1])].map(|(grid, cells)| Grid { cells, ..*grid });
    let [named_a, named_b] = [("a", a), ("b", b)].map(|(robot, grid)| NamedMap { robot, grid });
    let found = match align_maps(&named_a, &named_b, &MapAlignerParameters::default()) {
        Ok(found) => found,
        Err(refusal) => return Judged::refused(first_line(&refusal.to_string())),
    };
    let [walls_a, walls_b] = [&a, &b].map(|grid| WallMap::new(grid, NORMAL_RADIUS));
    let (icp, verifier) = (IcpParameters::default(), MergeVerifierParameters::default());
    let count = found.hypotheses.len() as u32;
    let refined = (0..).zip(&found.hypotheses).map(|(rank, guess)| {
        let start = FirstGuess::new(guess.transform_a_b, guess.covariance, &icp);
        let refinement = refine(&walls_a, &walls_b, &start, &icp);
        let mut alignment = Alignment {
            a: "a".into(),
            b: "b".into(),
            source: "maps".into(),
            covariance: row_by_row(&refinement.registration.covariance),
            score: 1.0 - (-guess.lead.max(0.0)).exp(),
            accepted: refinement.refusal.is_none(),
            provisional: true,
            rank,
            hypotheses: count,
            reason: refinement.reason(),
            ..Alignment::default()
        };
        alignment.set_transform_a_b(&refinement.registration.transform_a_b);
        alignment
    });
    let alignments: Vec<Alignment> = refined.collect();
    let (view_a, view_b) = (MapView::rigid(a, &walls_a), MapView::rigid(b, &walls_b));
    let proposed: Vec<&Alignment> = alignments.iter().collect();
    let verdict = judge(&view_a, &view_b, &proposed, &UserKnowledge::default(), &verifier).map(|verdict| {
        if !verdict.rests_on_walls_alone() {
            return verdict;
        }
        let [similar_a, similar_b] = [&view_a, &view_b].map(|view| SelfSimilarity::new(view, &verifier));
        let alias = Alias::of(&verdict, (&view_a, &similar_a), (&view_b, &similar_b), None, &verifier);
        verdict.against(alias.as_ref(), verifier.accept)
    });
    let hypotheses = alignments.iter().zip(&found.hypotheses).map(|(alignment, guess)| {
        let transform_a_b = alignment.transform_a_b();
        let may_bend = with_bends && alignment.accepted;
        Hypothesis {
            transform_a_b,
            is_registered: alignment.accepted,
            lead: guess.lead,
            share: guess.share,
            agreement: compare(&view_a, &view_b, &transform_a_b, &verifier),
            bent: may_bend.then(|| BentPlace::new(&view_a, &view_b, &transform_a_b, &verifier)).flatten(),
            reason: if alignment.accepted { String::new() } else { first_line(&alignment.reason) },
        }
    });
    let hypotheses: Vec<Hypothesis> = hypotheses.collect();
    let Some(verdict) = verdict else {
        return Judged { hypotheses, ..Judged::refused("no place was proposed".into()) };
    };
    Judged {
        merged: verdict.refusal.is_none().then(|| verdict.candidate.transform_a_b()),
        probability: verdict.score,
        refusal: verdict.refusal.as_ref().map(|refusal| first_line(&refusal.headline())),
        hypotheses,
    }
}

fn first_line(text: &str) -> String {
    text.lines().next().unwrap_or_default().to_owned()
}
