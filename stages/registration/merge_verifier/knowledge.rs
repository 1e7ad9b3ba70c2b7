//! The user's knowledge of robots, applied to pairs.

use crate::registration::judgement::{JudgementParameters, UserKnowledge};
use crate::registration::pose_window::PoseWindow;
use crate::shared::geometry::row_by_row;
use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::{Alignment, Header};
use gridweave_runtime::stage::{Context, InitialPoses};
use nalgebra::{Matrix3, Vector3};
use std::collections::{BTreeMap, BTreeSet};

/// Number of the hypothesis that is the initial poses themselves.
const INITIAL: usize = 0;

/// The user's knowledge of all robots.
pub(super) struct Knowledge {
    initial_poses: InitialPoses,
    reference: Option<String>,
    /// The chosen hypotheses, by robot or `ROBOT/ROBOT`.
    chosen: BTreeMap<String, usize>,
    /// Keys of those that matched a pair.
    used: BTreeSet<String>,
}

impl Knowledge {
    pub(super) fn new(parameters: &JudgementParameters, context: &Context) -> Self {
        Self {
            initial_poses: context.initial_poses.clone(),
            reference: context.reference.clone(),
            chosen: parameters.hypotheses.clone(),
            used: BTreeSet::new(),
        }
    }

    /// Knowledge of a pair, where `robots` is the number of all robots.
    pub(super) fn of(&mut self, pair: &RobotPair, robots: usize) -> UserKnowledge {
        let is_meant = |name: &str| match name.split_once('/') {
            Some((one, other)) => pair.concerns(one) && pair.concerns(other) && one != other,
            None => pair.concerns(name) && self.is_with_reference(pair, name, robots),
        };
        let chosen = self.chosen.iter().find(|(name, _)| is_meant(name));
        self.used.extend(chosen.map(|(name, _)| name.clone()));
        UserKnowledge {
            window: PoseWindow::of(pair, &self.initial_poses),
            hypothesis: chosen.map(|(_, number)| *number),
        }
    }

    fn is_with_reference(&self, pair: &RobotPair, robot: &str, robots: usize) -> bool {
        match &self.reference {
            Some(reference) if reference != robot => pair.concerns(reference),
            _ => robots == 2,
        }
    }

    /// Warnings on choices that matched no pair.
    pub(super) fn unused(&self) -> impl Iterator<Item = String> {
        let unused = self.chosen.keys().filter(|name| !self.used.contains(*name));
        unused.map(|name| {
            format!(
                "the hypothesis that was chosen for `{name}` matches no pair of robots: write ROBOT for its pair with the \
                 reference, or ROBOT/ROBOT"
            )
        })
    }
}

/// The alignment by the initial poses only, or why there is none; `None` if the user has not chosen it.
pub(super) fn by_initial_poses(pair: &RobotPair, known: &UserKnowledge, frame_id: &str) -> Option<Alignment> {
    known.hypothesis.filter(|number| *number == INITIAL)?;
    let mut alignment = Alignment {
        header: Header { frame_id: frame_id.to_owned(), ..Header::default() },
        a: pair.a.clone(),
        b: pair.b.clone(),
        source: "initial poses".into(),
        method: "initial poses".into(),
        ..Alignment::default()
    };
    let Some(window) = &known.window else {
        let headline = "the initial poses were chosen, but not both robots have one";
        alignment.reason = format!("{headline}\ntry: --initial {}=X,Y,YAW", pair.b);
        return Some(alignment);
    };
    let (metres, radians) = window.deviations();
    let variances = Vector3::new(metres * metres, metres * metres, radians * radians);
    alignment.set_transform_a_b(&window.centre());
    alignment.covariance = row_by_row(&Matrix3::from_diagonal(&variances));
    alignment.accepted = true;
    alignment.reason = "aligned by the initial poses, as the user chose; the maps were not compared".into();
    Some(alignment)
}
