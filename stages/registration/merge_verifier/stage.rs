//! The stage: keeps each robot's map and all hypotheses of each pair, and judges a pair when any of them changes.

use super::knowledge::{Knowledge, by_initial_poses};
use super::map_searches::MapSearches;
use super::messages::{evidence, judged, refused, scale_reason};
use super::numbered_map::NumberedMap;
use super::self_similarities::SelfSimilarities;
use crate::registration::hypotheses::{HypothesisGatherer, Origin};
use crate::registration::judgement::{Comparisons, Decision, JudgementParameters, UserKnowledge, judge_again};
use crate::registration::scale::{LEAST_PROBABILITY, Scale};
use crate::registration::{Hypothesis, RegistrationParameters};
use crate::shared::robot_maps::RobotMaps;
use crate::shared::robot_pair::RobotPair;
use crate::shared::walls::WallsOnDemand;
use gridweave_runtime::ros::{Alignment, Evidence, Header, OccupancyGrid};
use gridweave_runtime::stage::{Context, Out, Output, OutputPorts, Outputs, Received, StageError};
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
    /// Size of map b under the deformation, as a share of its size by its resolution, where that is in doubt.
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
        let is_accepted = |pair: &RobotPair| self.sent.get(pair).is_some_and(|alignment| alignment.accepted);
        for (RobotPair { a, b }, scale) in self.other_scales.iter().filter(|(pair, _)| is_accepted(pair)) {
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
        let is_doubted = |(pair, alignment): &(&RobotPair, &Alignment)| {
            let is_improbable = alignment.score < LEAST_PROBABILITY || self.other_scales.contains_key(pair);
            !alignment.accepted && is_improbable
        };
        let refused = self.sent.iter().filter(is_doubted).map(|(pair, _)| pair);
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

    /// Judges a pair, and publishes the decision. A pair that waits for a map is judged once that has come.
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
        let decision = self.judge_pair(pair, &known);
        self.publish(pair, decision.as_ref(), output)
    }

    /// Judges the hypotheses of a pair, with those of a search if that is due, and against self-similarity of the maps
    /// if nothing but the maps confirms them. `None` without both maps, or without hypotheses.
    fn judge_pair(&mut self, pair: &RobotPair, known: &UserKnowledge) -> Option<Decision> {
        let (a, b) = self.maps.pair(pair)?;
        let maps = [NumberedMap::of(a), NumberedMap::of(b)];
        let proposed = proposed(&self.hypotheses, pair);
        let mut hypotheses: Vec<Hypothesis> = proposed.into_iter().filter_map(Hypothesis::of).collect();
        let (numbers, comparisons) = self.comparisons.entry(pair.clone()).or_default();
        if *numbers != (a.number, b.number) {
            (*numbers, *comparisons) = ((a.number, b.number), Comparisons::default());
        }
        let [view_a, view_b] = maps.each_ref().map(|map| &map.view);
        let mut judge =
            |hypotheses: &[Hypothesis]| judge_again(view_a, view_b, hypotheses, known, &self.parameters, comparisons);
        let mut decision = judge(&hypotheses)?;
        if MapSearches::is_due(&hypotheses, &decision) {
            hypotheses.extend_from_slice(self.map_searches.of(pair, &maps, known));
            decision = judge(&hypotheses)?;
        }
        if !decision.rests_on_maps_alone() {
            return Some(decision);
        }
        let alias = self.self_similarities.alias(&decision, pair, &maps, known.window.as_ref(), &self.parameters);
        Some(decision.against(alias.as_ref(), &self.parameters))
    }

    /// Sends the decision on a pair and its evidence if they have changed; without a decision a refusal.
    fn publish(
        &mut self,
        pair: &RobotPair,
        decision: Option<&Decision>,
        output: &Output<Judgements>,
    ) -> Result<(), StageError> {
        self.other_scales.remove(pair);
        let proposed = proposed(&self.hypotheses, pair);
        let Some(decision) = decision else { return self.send(pair, refused(&proposed), output) };
        if let Some(scale) = decision.other_scale() {
            self.other_scales.insert(pair.clone(), scale);
        }
        let evidence = evidence(decision, pair, proposed.len());
        let reason = decision.reason(self.parameters.accept, &self.name, &pair.a, &pair.b);
        let alignment = judged(decision, &proposed, reason);
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

/// All hypotheses of a pair, by source and rank.
fn proposed<'a>(
    hypotheses: &'a BTreeMap<RobotPair, BTreeMap<String, Vec<Alignment>>>,
    pair: &RobotPair,
) -> Vec<&'a Alignment> {
    hypotheses.get(pair).into_iter().flat_map(BTreeMap::values).flatten().collect()
}
