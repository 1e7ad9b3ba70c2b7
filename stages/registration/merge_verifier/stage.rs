//! The stage: keeps each robot's map and all hypotheses of each pair, and judges a pair when any of them changes.

use super::knowledge::{Knowledge, by_initial_poses};
use super::map_searches::MapSearches;
use super::self_similarities::SelfSimilarities;
use crate::registration::comparison::{Agreement, Deformed, MapView};
use crate::registration::hypotheses::{HypothesisGatherer, Origin};
use crate::registration::judgement::{Comparisons, JudgementParameters, UserKnowledge, Verdict, judge_again};
use crate::registration::scale::{LEAST_PROBABILITY, Scale};
use crate::registration::{Hypothesis, RegistrationParameters};
use crate::shared::geometry::row_by_row;
use crate::shared::robot_maps::{RobotMap, RobotMaps};
use crate::shared::robot_pair::RobotPair;
use crate::shared::walls::{NORMAL_RADIUS, WallsOnDemand};
use gridweave_runtime::ros::{Alignment, Evidence, Header, OccupancyGrid};
use gridweave_runtime::stage::{Context, Out, Output, OutputPorts, Outputs, Received, StageError};
use nalgebra::Matrix3;
use std::collections::BTreeMap;

/// The scale is searched if no more pairs are to be.
const MOST_SCALED: usize = 6;

/// Outputs of the stage.
pub(super) struct Judgements {
    alignment: Out<Alignment>,
    evidence: Out<Evidence>,
}

impl Outputs for Judgements {
    fn declare(ports: &mut OutputPorts) -> Self {
        Self {
            alignment: ports.output(
                "alignment",
                "One alignment for each pair of robots, accepted or refused; its score is the probability that it is right.",
            ),
            evidence: ports.side_output(
                "evidence",
                "The evidence of the maps for the most probable and the second most probable hypothesis of each pair of robots.",
            ),
        }
    }
}

/// Judges the hypotheses of pairs of robots.
pub(super) struct MergeVerifier {
    /// Name of the stage, by which the user sets its parameters.
    name: String,
    parameters: JudgementParameters,
    knowledge: Knowledge,
    maps: RobotMaps<WallsOnDemand>,
    gatherer: HypothesisGatherer,
    /// By pair and source.
    hypotheses: BTreeMap<RobotPair, BTreeMap<String, Vec<Alignment>>>,
    /// Comparisons of the maps of each pair, with the numbers of both maps.
    comparisons: BTreeMap<RobotPair, ((u64, u64), Comparisons)>,
    /// Peaks of a search, for pairs whose hypotheses come from other sources.
    map_searches: MapSearches,
    /// Self-similarity of maps that were accepted without tags.
    self_similarities: SelfSimilarities,
    sent: BTreeMap<RobotPair, Alignment>,
    /// Size of map b of accepted pairs, as a share of its size by its resolution, where that is in doubt.
    other_scales: BTreeMap<RobotPair, f64>,
    /// Evidence that was sent last, without headers.
    evidence: BTreeMap<RobotPair, Evidence>,
}

impl MergeVerifier {
    pub(super) fn new(parameters: JudgementParameters, context: &Context) -> Self {
        Self {
            name: context.stage.clone(),
            knowledge: Knowledge::new(&parameters, context),
            parameters,
            maps: RobotMaps::default(),
            gatherer: HypothesisGatherer::default(),
            hypotheses: BTreeMap::new(),
            comparisons: BTreeMap::new(),
            map_searches: MapSearches::default(),
            self_similarities: SelfSimilarities::default(),
            sent: BTreeMap::new(),
            other_scales: BTreeMap::new(),
            evidence: BTreeMap::new(),
        }
    }

    pub(super) fn receive_map(
        &mut self,
        map: Received<'_, OccupancyGrid<'_>>,
        output: &Output<Judgements>,
    ) -> Result<(), StageError> {
        if !self.maps.keep(&map, output, |_| WallsOnDemand::new()) {
            return Ok(());
        }
        let pairs: Vec<RobotPair> = self.pairs().filter(|pair| pair.concerns(map.robot())).cloned().collect();
        pairs.iter().try_for_each(|pair| self.update(pair, output))
    }

    pub(super) fn receive_alignment(
        &mut self,
        alignment: Received<'_, Alignment>,
        output: &Output<Judgements>,
    ) -> Result<(), StageError> {
        match self.gatherer.add(alignment.into_content()) {
            Ok(None) => Ok(()),
            Ok(Some((Origin { pair, source }, hypotheses))) => {
                self.hypotheses.entry(pair.clone()).or_default().insert(source, hypotheses);
                self.update(&pair, output)
            }
            Err(missing) => {
                output.warn(missing.to_string());
                Ok(())
            }
        }
    }

    /// Judges accepted pairs once more if the maps have changed since they were searched for self-similarity. Refuses
    /// pairs that still wait for a map, so that they are reported.
    pub(super) fn finish(&mut self, output: &Output<Judgements>) -> Result<(), StageError> {
        let changed = self.self_similarities.forget_former(|robot| self.maps.get(robot).map(|map| map.number));
        let is_concerned = |pair: &&RobotPair| changed.iter().any(|robot| pair.concerns(robot));
        let concerned: Vec<RobotPair> = self.pairs().filter(is_concerned).cloned().collect();
        concerned.iter().try_for_each(|pair| self.update(pair, output))?;
        let pairs: Vec<RobotPair> = self.pairs().cloned().collect();
        for pair in pairs {
            let Some(missing) = self.maps.missing(&pair) else { continue };
            let proposed = proposed(&self.hypotheses, &pair);
            if proposed.iter().all(|alignment| !alignment.accepted) {
                continue;
            }
            let reason = format!("{missing}, so the alignment cannot be verified");
            let alignment = Alignment { reason, ..refused(&proposed) };
            self.send(&pair, alignment, output)?;
        }
        self.search_scales(output)?;
        for (RobotPair { a, b }, scale) in &self.other_scales {
            output.warn(format!(
                "{b} fits {a} if it is {scale:.2} times as large: are the resolutions of both maps right?"
            ));
        }
        self.knowledge.unused().for_each(|unused| output.warn(unused));
        Ok(())
    }

    /// Searches the scale between maps of robots that are merged with no other, and reports it in the reason.
    fn search_scales(&mut self, output: &Output<Judgements>) -> Result<(), StageError> {
        let range = self.parameters.scale_range;
        let accepted: Vec<&RobotPair> =
            self.sent.iter().filter(|(_, alignment)| alignment.accepted).map(|(pair, _)| pair).collect();
        let is_alone = |robot: &str| !accepted.iter().any(|pair| pair.concerns(robot));
        let is_improbable = |alignment: &Alignment| !alignment.accepted && alignment.score < LEAST_PROBABILITY;
        let refused = self.sent.iter().filter(|(_, alignment)| is_improbable(alignment)).map(|(pair, _)| pair);
        let alone: Vec<RobotPair> = refused.filter(|pair| is_alone(&pair.a) || is_alone(&pair.b)).cloned().collect();
        if range == 0.0 || alone.len() > MOST_SCALED {
            return Ok(());
        }
        let parameters = RegistrationParameters { judgement: self.parameters.clone(), ..Default::default() };
        for pair in alone {
            let is_known = self.knowledge.of(&pair, self.maps.iter().count()) != UserKnowledge::default();
            let Some((a, b)) = self.maps.pair(&pair).filter(|_| !is_known) else { continue };
            let Some(scale) = Scale::search(a.grid(), b.grid(), range, &parameters) else { continue };
            let Some(alignment) = self.sent.get(&pair).cloned() else { continue };
            let reason = scale_reason(&scale, &pair, b.grid().geometry.resolution) + &alignment.reason;
            self.send(&pair, Alignment { reason, ..alignment }, output)?;
        }
        Ok(())
    }

    /// The pairs with any hypothesis.
    fn pairs(&self) -> impl Iterator<Item = &RobotPair> {
        self.hypotheses.keys()
    }

    /// Judges a pair, and sends the verdict and the evidence if they have changed.
    fn update(&mut self, pair: &RobotPair, output: &Output<Judgements>) -> Result<(), StageError> {
        let known = self.knowledge.of(pair, self.maps.iter().count());
        let proposed = proposed(&self.hypotheses, pair);
        let maps = self.maps.pair(pair);
        if let Some(alignment) = maps.and_then(|(a, _)| by_initial_poses(pair, &known, &a.frame_id)) {
            return self.send(pair, alignment, output);
        }
        if maps.is_none() && proposed.iter().any(|alignment| alignment.accepted) {
            return Ok(());
        }
        let verdict = maps.and_then(|(a, b)| {
            let mut hypotheses: Vec<Hypothesis> = proposed.iter().filter_map(|one| Hypothesis::of(one)).collect();
            let (view_a, view_b) = (view(a), view(b));
            let (numbers, comparisons) = self.comparisons.entry(pair.clone()).or_default();
            if *numbers != (a.number, b.number) {
                (*numbers, *comparisons) = ((a.number, b.number), Comparisons::default());
            }
            let mut judge = |hypotheses: &[Hypothesis]| {
                judge_again(&view_a, &view_b, hypotheses, &known, &self.parameters, comparisons)
            };
            let mut verdict = judge(&hypotheses)?;
            if MapSearches::is_due(&hypotheses, &verdict) {
                let grids = ((a.number, a.grid()), (b.number, b.grid()));
                hypotheses.extend_from_slice(self.map_searches.of(pair, grids, &known));
                verdict = judge(&hypotheses)?;
            }
            if !verdict.rests_on_maps_alone() {
                return Some(verdict);
            }
            let maps = ((a.number, &view_a), (b.number, &view_b));
            let alias = self.self_similarities.alias(&verdict, pair, maps, known.window.as_ref(), &self.parameters);
            Some(verdict.against(alias.as_ref(), &self.parameters))
        });
        let judged_of: Vec<&Alignment> = proposed.iter().copied().filter(|one| Hypothesis::of(one).is_some()).collect();
        self.other_scales.remove(pair);
        let Some(verdict) = &verdict else { return self.send(pair, refused(&proposed), output) };
        if let (Some(scale), None) = (verdict.other_scale(), &verdict.refusal) {
            self.other_scales.insert(pair.clone(), scale);
        }
        let (evidence, alignment) = (
            evidence(verdict, pair, proposed.len()),
            judged(
                verdict,
                &judged_of,
                &proposed,
                verdict.reason(self.parameters.accept, &self.name, &pair.a, &pair.b),
            ),
        );
        if self.evidence.get(pair) != Some(&evidence) {
            let header = Header::new(output.log_time(), alignment.header.frame_id.clone());
            output.evidence.send("", &Evidence { header, ..evidence.clone() })?;
            self.evidence.insert(pair.clone(), evidence);
        }
        self.send(pair, alignment, output)
    }

    fn send(
        &mut self,
        pair: &RobotPair,
        mut alignment: Alignment,
        output: &Output<Judgements>,
    ) -> Result<(), StageError> {
        alignment.header = Header::new(output.log_time(), alignment.header.frame_id);
        if let Some(sent) = self.sent.get_mut(pair) {
            sent.header = alignment.header.clone();
            if *sent == alignment {
                return Ok(());
            }
        }
        output.alignment.send("", &alignment)?;
        self.sent.insert(pair.clone(), alignment);
        Ok(())
    }
}

/// First paragraph of the reason for a pair whose maps agree at another scale, where the cells of map b are `cell`
/// metres wide by its resolution.
fn scale_reason(scale: &Scale, pair: &RobotPair, cell: f64) -> String {
    let Scale { factor, verdict } = scale;
    let RobotPair { a, b } = pair;
    let Agreement { inlier_length, conflict_length, .. } = verdict.candidate.agreement;
    format!(
        "the maps may fit if {b} is {factor:.3} times as large: {inlier_length:.0} m of wall agree, {conflict_length:.0} m do not\n\
         missing: the right resolution of {b}, or of {a}\n\
         try: cells of {side:.5} m instead of {cell:.5} m, if {a} is right; for map files --resolution {b}={side:.5}\n\n",
        side = factor * cell,
    )
}

/// All hypotheses of a pair, by source and rank.
fn proposed<'a>(
    hypotheses: &'a BTreeMap<RobotPair, BTreeMap<String, Vec<Alignment>>>,
    pair: &RobotPair,
) -> Vec<&'a Alignment> {
    hypotheses.get(pair).into_iter().flat_map(BTreeMap::values).flatten().collect()
}

fn view(map: &RobotMap<WallsOnDemand>) -> MapView<'_> {
    MapView::rigid(map.grid(), map.walls(NORMAL_RADIUS))
}

/// Evidence of a verdict on a pair, with the number of hypotheses, without a header.
fn evidence(verdict: &Verdict, pair: &RobotPair, hypotheses: usize) -> Evidence {
    let Agreement { overlap, inlier_length, conflict_length, evidence, .. } = verdict.candidate.agreement;
    let elsewhere = verdict.second_best.as_ref().map_or(0.0, |second| second.agreement.evidence.max(0.0));
    Evidence {
        header: Header::default(),
        a: pair.a.clone(),
        b: pair.b.clone(),
        hypotheses: hypotheses as u32,
        overlap,
        wall_on_wall: inlier_length,
        wall_on_free: conflict_length,
        evidence_elsewhere: (elsewhere / evidence.max(1.0)).min(2.0),
    }
}

/// Verdict for a pair with a pose: `judged_of` are the alignments that were judged, in the order of the hypotheses.
fn judged(verdict: &Verdict, judged_of: &[&Alignment], proposed: &[&Alignment], reason: String) -> Alignment {
    let accepted = verdict.refusal.is_none();
    let source = &verdict.candidate.hypothesis.source;
    let mut alignment = judged_of.get(verdict.candidate.number).map_or_else(Alignment::default, |one| (*one).clone());
    if let Some(Deformed { transform_a_b, .. }) = &verdict.candidate.deformed {
        alignment.set_transform_a_b(transform_a_b);
    }
    if let Some(covariance) = &verdict.candidate.left_by_deformation {
        alignment.covariance = row_by_row(&(Matrix3::from_row_slice(&alignment.covariance) + covariance));
    }
    Alignment {
        accepted,
        provisional: false,
        rank: 0,
        hypotheses: 0,
        score: verdict.probability,
        reason: if accepted { reason } else { with_other_sources(reason, source, proposed) },
        ..alignment
    }
}

/// Verdict for a pair without a pose.
fn refused(proposed: &[&Alignment]) -> Alignment {
    let Some(first) = proposed.first() else { return Alignment::default() };
    let reason = with_other_sources(first.reason.clone(), &first.source, proposed);
    Alignment { accepted: false, provisional: false, rank: 0, hypotheses: 0, reason, ..(*first).clone() }
}

/// Adds the reasons of the other sources to a refusal, so that the user sees why none of them helped.
fn with_other_sources(reason: String, source: &str, proposed: &[&Alignment]) -> String {
    let others = proposed.iter().filter(|alignment| alignment.source != source && alignment.rank == 0);
    let others: Vec<String> =
        others.map(|other| format!("by the {}: {}", other.source, one_line(&other.reason))).collect();
    if others.is_empty() {
        return reason;
    }
    // Details follow after the empty line.
    let gap = if reason.contains("\n\n") { "\n" } else { "\n\n" };
    format!("{reason}{gap}{}", others.join("\n"))
}

fn one_line(reason: &str) -> String {
    reason.split('\n').filter(|line| !line.is_empty()).collect::<Vec<_>>().join("; ")
}
