//! The stage: keeps each robot's map and all that was proposed for each pair, and judges a pair when any of it changes.

use super::{Agreement, Elsewhere, MapView, MergeVerifierParameters, Verdict, judge};
use crate::geometry::{Grid, read_map};
use crate::hypotheses::{HypothesisGatherer, Origin};
use crate::icp_refiner::{IcpParameters, WallMap};
use gridweave_runtime::message::Message;
use gridweave_runtime::ros::{Alignment, Header};
use gridweave_runtime::stage::{Output, Stage, StageError};
use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};

/// The input port of the maps; all others are those of alignments.
const MAP_INPUT: usize = 0;
/// The output port of the judged alignments.
const ALIGNMENT_OUTPUT: usize = 0;

/// The names of two robots, as the alignments name them.
type Pair = (String, String);

/// Judges the alignments of pairs of robots.
pub(super) struct MergeVerifier {
    parameters: MergeVerifierParameters,
    maps: BTreeMap<String, RobotMap>,
    gatherer: HypothesisGatherer,
    hypotheses: BTreeMap<Origin, Vec<Alignment>>,
    sent: BTreeMap<Pair, Alignment>,
    /// What the last judgement on each pair went by, for the report.
    evidence: BTreeMap<Pair, Evidence>,
}

/// What a judgement went by.
#[derive(Clone, Copy, Debug)]
struct Evidence {
    agreement: Agreement,
    elsewhere: Elsewhere,
    hypotheses: usize,
}

/// A robot's last map. The message is kept as it came; the walls are made when they are first asked for.
struct RobotMap {
    message: Message,
    walls: OnceCell<WallMap>,
}

impl MergeVerifier {
    pub(super) fn new(parameters: MergeVerifierParameters) -> Self {
        Self {
            parameters,
            maps: BTreeMap::new(),
            gatherer: HypothesisGatherer::default(),
            hypotheses: BTreeMap::new(),
            sent: BTreeMap::new(),
            evidence: BTreeMap::new(),
        }
    }

    fn receive_map(&mut self, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let robot = message.robot();
        if let Err(problem) = read_map(message) {
            output.warn(format!("a map of {robot} was left out: {problem}"));
            return Ok(());
        }
        self.maps.insert(robot.to_owned(), RobotMap { message: message.clone(), walls: OnceCell::new() });
        let concerned = self.hypotheses.keys().filter(|origin| origin.concerns(robot));
        let pairs: BTreeSet<Pair> = concerned.map(|origin| (origin.a.clone(), origin.b.clone())).collect();
        pairs.iter().try_for_each(|pair| self.update(pair, output))
    }

    fn receive_alignment(&mut self, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        let alignment: Alignment = match message.decode() {
            Ok(alignment) => alignment,
            Err(error) => {
                output.warn(format!("an alignment was left out: {error}"));
                return Ok(());
            }
        };
        match self.gatherer.add(alignment) {
            Ok(None) => Ok(()),
            Ok(Some((origin, hypotheses))) => {
                let pair = (origin.a.clone(), origin.b.clone());
                self.hypotheses.insert(origin, hypotheses);
                self.update(&pair, output)
            }
            Err(missing) => {
                output.warn(missing.to_string());
                Ok(())
            }
        }
    }

    /// Everything that was proposed for a pair, by source and rank.
    fn proposed(&self, pair: &Pair) -> Vec<&Alignment> {
        let of_pair = |origin: &Origin| (&origin.a, &origin.b) == (&pair.0, &pair.1);
        self.hypotheses.iter().filter(|(origin, _)| of_pair(origin)).flat_map(|(_, hypotheses)| hypotheses).collect()
    }

    /// Judges a pair, and sends the outcome if it is not what was sent last.
    fn update(&mut self, pair: &Pair, output: &mut Output<'_>) -> Result<(), StageError> {
        let proposed = self.proposed(pair);
        let maps = self.maps.get(&pair.0).zip(self.maps.get(&pair.1));
        if maps.is_none() && proposed.iter().any(|alignment| alignment.accepted) {
            return Ok(());
        }
        let verdict = match maps {
            Some((a, b)) => {
                let doing = || format!("verify the alignment of `{}` and `{}`", pair.0, pair.1);
                let (_, grid_a) = read_map(&a.message).map_err(|error| StageError::new(doing(), error))?;
                let (_, grid_b) = read_map(&b.message).map_err(|error| StageError::new(doing(), error))?;
                judge(&a.view(grid_a), &b.view(grid_b), &proposed, &self.parameters)
            }
            None => None,
        };
        let evidence = verdict.as_ref().map(|verdict| Evidence::of(verdict, proposed.len()));
        let alignment = match &verdict {
            Some(verdict) => judged(verdict, &proposed),
            None => refused(&proposed),
        };
        if let Some(evidence) = evidence {
            self.evidence.insert(pair.clone(), evidence);
        }
        self.send(pair, alignment, output)
    }

    fn send(&mut self, pair: &Pair, mut alignment: Alignment, output: &mut Output<'_>) -> Result<(), StageError> {
        alignment.header = Header::new(output.log_time(), alignment.header.frame_id);
        if let Some(sent) = self.sent.get_mut(pair) {
            sent.header = alignment.header.clone();
            if *sent == alignment {
                return Ok(());
            }
        }
        output.send(ALIGNMENT_OUTPUT, "", &alignment)?;
        self.sent.insert(pair.clone(), alignment);
        Ok(())
    }
}

impl Stage for MergeVerifier {
    fn receive(&mut self, port: usize, message: &Message, output: &mut Output<'_>) -> Result<(), StageError> {
        match port {
            MAP_INPUT => self.receive_map(message, output),
            _ => self.receive_alignment(message, output),
        }
    }

    /// A pair that waits for a map to the end is refused, so that it does not go missing.
    fn finish(&mut self, output: &mut Output<'_>) -> Result<(), StageError> {
        let pairs: BTreeSet<Pair> = self.hypotheses.keys().map(|origin| (origin.a.clone(), origin.b.clone())).collect();
        for pair in pairs {
            let missing: Vec<&str> = [&pair.0, &pair.1]
                .into_iter()
                .filter(|robot| !self.maps.contains_key(*robot))
                .map(String::as_str)
                .collect();
            let proposed = self.proposed(&pair);
            if missing.is_empty() || proposed.iter().all(|alignment| !alignment.accepted) {
                continue;
            }
            let reason =
                format!("no usable map of {} has come, so the alignment cannot be verified", missing.join(" and "));
            let alignment = Alignment { reason, ..refused(&proposed) };
            self.send(&pair, alignment, output)?;
        }
        Ok(())
    }

    fn report(&self) -> Option<serde_json::Value> {
        let pairs: Vec<serde_json::Value> =
            self.evidence.iter().map(|(pair, evidence)| evidence.report(pair)).collect();
        Some(serde_json::json!({ "pairs": pairs }))
    }
}

impl Evidence {
    fn of(verdict: &Verdict<'_>, hypotheses: usize) -> Self {
        Self { agreement: verdict.candidate.agreement, elsewhere: verdict.elsewhere, hypotheses }
    }

    fn report(&self, (a, b): &Pair) -> serde_json::Value {
        let Agreement { overlap, wall_on_wall, wall_on_free, .. } = self.agreement;
        serde_json::json!({
            "a": a,
            "b": b,
            "hypotheses": self.hypotheses,
            "overlap_m2": overlap,
            "wall_on_wall_m": wall_on_wall,
            "wall_on_free_m": wall_on_free,
            "evidence_elsewhere": self.elsewhere.evidence,
            "agreement_elsewhere": self.elsewhere.agreement,
        })
    }
}

impl RobotMap {
    fn view<'a>(&'a self, grid: Grid<'a>) -> MapView<'a> {
        let walls = self.walls.get_or_init(|| WallMap::new(&grid, IcpParameters::default().normal_radius));
        MapView { grid, walls }
    }
}

/// The outcome for a pair of which a place was proposed.
fn judged(verdict: &Verdict<'_>, proposed: &[&Alignment]) -> Alignment {
    let accepted = verdict.refusal.is_none();
    let reason = verdict.reason();
    Alignment {
        accepted,
        provisional: false,
        rank: 0,
        hypotheses: 0,
        score: verdict.score,
        reason: if accepted {
            reason
        } else {
            with_other_sources(reason, verdict.candidate.alignment.source(), proposed)
        },
        ..verdict.candidate.alignment.clone()
    }
}

/// The outcome for a pair of which none was.
fn refused(proposed: &[&Alignment]) -> Alignment {
    let Some(first) = proposed.first() else { return Alignment::default() };
    let reason = with_other_sources(first.reason.clone(), first.source(), proposed);
    Alignment { accepted: false, provisional: false, rank: 0, hypotheses: 0, reason, ..(*first).clone() }
}

/// A refusal, with what the other sources have against the pair: whoever reads it wants to know why nothing helped.
fn with_other_sources(reason: String, source: &str, proposed: &[&Alignment]) -> String {
    let others = proposed.iter().filter(|alignment| alignment.source() != source && alignment.rank == 0);
    others.fold(reason, |reason, other| format!("{reason}; by the {}s: {}", other.source(), other.reason))
}
