//! What becomes of a pair of robots.

use crate::log::read_decoded;
use crate::trial::World;
use anyhow::{Context, Result};
use gridweave::evaluate::{RobotOutcome, evaluate_summary};
use gridweave::table::Table;
use gridweave_logs::summary::{Pair, Summary};
use gridweave_runtime::ros::RobotFrames;
use gridweave_runtime::stage::Registry;

/// The pipeline under test.
const PIPELINE: &str = "tag_merge";

/// What a merge has made of the pair of a log with two robots.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PairOutcome {
    /// What it came to.
    pub(super) outcome: RobotOutcome,
    /// Whether the robots were merged wrongly at any time, if only until the next message.
    pub(super) ever_wrong: bool,
    /// Metres, and degrees, if both are known.
    pub(super) errors: Option<(f64, f64)>,
    /// Whether the merge rests on few tags.
    pub(super) is_provisional: bool,
    /// Why there is none.
    pub(super) reason: String,
}

impl PairOutcome {
    /// Merges a world of two robots, of which the second is named.
    pub(super) fn of(world: &World, robot_b: &str, settings: &[String], registry: &Registry) -> Result<Self> {
        let merge = world.merge(PIPELINE, settings, registry)?;
        let robot = merge.evaluation.robots.iter().find(|robot| robot.robot == robot_b);
        let robot = robot.with_context(|| format!("{} does not hold {robot_b}", world.log.display()))?;
        let few = |pair: &Pair| pair.accepted && pair.method.starts_with("few tags");
        Ok(Self {
            outcome: robot.outcome,
            ever_wrong: ever_wrong(world)?,
            errors: robot.error_m.zip(robot.error_deg),
            is_provisional: merge.summary.alignments.iter().any(few),
            reason: robot.reason.clone().unwrap_or_default(),
        })
    }

    /// What refused the pair: the first stage that did.
    pub(super) fn refused_by(&self) -> &'static str {
        let says = |part: &str| self.reason.contains(part);
        match () {
            () if says("the maps do not confirm") => "walls",
            () if says("must confirm") && says("directions of both maps") => "directions",
            () if says("tag in common") || says("tags in common") || says("have no tag") => "tags",
            () => "walls",
        }
    }
}

/// Whether any of the frames that the last merge of a world has sent was wrong.
fn ever_wrong(world: &World) -> Result<bool> {
    let mut frames: Vec<RobotFrames> = Vec::new();
    read_decoded(&world.output(), |found| frames.push(found))?;
    for found in frames.iter().filter(|found| found.frames.len() > 1) {
        let mut summary = Summary::default();
        summary.set_frames(found);
        summary.unmerged.clear();
        if evaluate_summary(&summary, &world.truth)?.wrong > 0 {
            return Ok(true);
        }
    }
    Ok(false)
}

/// How many pairs came to what.
#[derive(Clone, Debug, Default)]
pub(super) struct Count {
    outcomes: Vec<PairOutcome>,
}

impl Count {
    /// The heads of [`cells`](Self::cells).
    pub(super) const HEADS: [&'static str; 5] = ["right", "of these by few tags", "wrong", "ever wrong", "refused"];

    pub(super) fn add(&mut self, outcome: PairOutcome) {
        self.outcomes.push(outcome);
    }

    fn number(&self, holds: impl Fn(&PairOutcome) -> bool) -> usize {
        self.outcomes.iter().filter(|outcome| holds(outcome)).count()
    }

    /// How many there are.
    pub(super) fn all(&self) -> usize {
        self.outcomes.len()
    }

    /// Right, of these by few tags, wrong, wrong at any time, refused.
    pub(super) fn cells(&self) -> [String; 5] {
        [
            self.number(|pair| pair.outcome == RobotOutcome::Right),
            self.number(|pair| pair.outcome == RobotOutcome::Right && pair.is_provisional),
            self.wrong(),
            self.ever_wrong(),
            self.number(|pair| matches!(pair.outcome, RobotOutcome::Refused | RobotOutcome::RightlyRefused)),
        ]
        .map(|count| count.to_string())
    }

    /// How many are wrong in the end.
    pub(super) fn wrong(&self) -> usize {
        self.number(|pair| pair.outcome == RobotOutcome::Wrong)
    }

    /// How many were merged wrongly at any time.
    pub(super) fn ever_wrong(&self) -> usize {
        self.number(|pair| pair.ever_wrong)
    }

    /// How many the tags, the directions and the walls have refused.
    pub(super) fn refusals(&self) -> [String; 3] {
        ["tags", "directions", "walls"].map(|by| {
            let is_refused =
                |pair: &PairOutcome| matches!(pair.outcome, RobotOutcome::Refused | RobotOutcome::RightlyRefused);
            self.number(|pair| is_refused(pair) && pair.refused_by() == by).to_string()
        })
    }

    /// The greatest errors of those that are right: metres and degrees.
    pub(super) fn worst(&self) -> [String; 2] {
        let errors =
            || self.outcomes.iter().filter(|pair| pair.outcome == RobotOutcome::Right).filter_map(|pair| pair.errors);
        let most = |values: &mut dyn Iterator<Item = f64>| values.reduce(f64::max);
        [most(&mut errors().map(|both| both.0)), most(&mut errors().map(|both| both.1))]
            .map(|worst| worst.map_or_else(|| "-".to_owned(), |worst| format!("{worst:.3}")))
    }
}

/// A table in which every trial has its row.
pub(super) fn all_trials() -> Table {
    Table::new(["set", "trial", "tags needed", "outcome", "ever wrong", "few tags", "error m", "error deg", "reason"])
}

/// Adds a trial.
pub(super) fn add_trial(table: &mut Table, set: &str, trial: &str, needed: usize, pair: &PairOutcome) {
    let outcome = match pair.outcome {
        RobotOutcome::RightlyRefused => RobotOutcome::Refused,
        outcome => outcome,
    };
    let error =
        |which: fn((f64, f64)) -> f64| pair.errors.map_or_else(String::new, |both| format!("{:.4}", which(both)));
    table.row([
        set.to_owned(),
        trial.to_owned(),
        needed.to_string(),
        outcome.words().to_owned(),
        pair.ever_wrong.to_string(),
        pair.is_provisional.to_string(),
        error(|both| both.0),
        error(|both| both.1),
        pair.reason.clone(),
    ]);
}
