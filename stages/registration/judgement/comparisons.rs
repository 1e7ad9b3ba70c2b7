//! The comparisons of two maps, kept for as long as both stay the same.
//!
//! A pair is judged whenever a hypothesis comes or goes. Those that stay need not be compared again.

use crate::registration::comparison::{Agreement, ComparisonParameters, Deformed, MapView, compare};
use crate::shared::geometry::Pose2;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

/// The comparisons of two maps, by the relative pose.
#[derive(Debug, Default)]
pub struct Comparisons {
    /// The number of judgements so far.
    judgements: u64,
    agreements: Kept<Agreement>,
    deformations: Kept<Option<Deformed>>,
}

/// Results by the bits of the pose, each with the number of the judgement that has used it last.
type Kept<T> = BTreeMap<[u64; 4], (u64, T)>;

impl Comparisons {
    /// Begins a judgement, and forgets what the two before it have not used: the poses of hypotheses that are gone.
    pub(super) fn begin(&mut self) {
        self.judgements += 1;
        let least = self.judgements.saturating_sub(2);
        self.agreements.retain(|_, (last, _)| *last >= least);
        self.deformations.retain(|_, (last, _)| *last >= least);
    }

    /// The agreement of the maps with map b at each of some poses `T_a_b`.
    pub(super) fn agreements(
        &mut self,
        a: &MapView<'_>,
        b: &MapView<'_>,
        poses: &[Pose2],
        parameters: &ComparisonParameters,
    ) -> Vec<Agreement> {
        of(&mut self.agreements, self.judgements, poses, |pose| compare(a, b, pose, parameters))
    }

    /// The deformation of map b onto map a from each of some poses `T_a_b`.
    pub(super) fn deformations(
        &mut self,
        a: &MapView<'_>,
        b: &MapView<'_>,
        poses: &[Pose2],
        parameters: &ComparisonParameters,
    ) -> Vec<Option<Deformed>> {
        let bodies = OnceLock::new();
        of(&mut self.deformations, self.judgements, poses, |pose| {
            Deformed::new(a, b, bodies.get_or_init(|| Deformed::bodies(a, b)), pose, parameters)
        })
    }
}

/// The result for each pose. Those that are not kept are made, beside each other.
fn of<T: Copy + Send>(
    kept: &mut Kept<T>,
    judgement: u64,
    poses: &[Pose2],
    make: impl Fn(&Pose2) -> T + Sync,
) -> Vec<T> {
    let mut asked = BTreeSet::new();
    let is_missing = |pose: &&Pose2| !kept.contains_key(&key(pose)) && asked.insert(key(pose));
    let missing: Vec<&Pose2> = poses.iter().filter(is_missing).collect();
    let made: Vec<T> = missing.par_iter().map(|pose| make(pose)).collect();
    kept.extend(missing.iter().map(|pose| key(pose)).zip(made.into_iter().map(|made| (judgement, made))));
    let used = poses.iter().filter_map(|pose| {
        let (last, result) = kept.get_mut(&key(pose))?;
        *last = judgement;
        Some(*result)
    });
    used.collect()
}

fn key(pose: &Pose2) -> [u64; 4] {
    [pose.translation.x, pose.translation.y, pose.rotation.re, pose.rotation.im].map(f64::to_bits)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn a_pose_is_compared_once_while_it_is_judged_again_and_again() {
        let (mut kept, made) = (Kept::default(), AtomicUsize::new(0));
        let mut ask = |judgement: u64, poses: &[f64]| {
            let poses: Vec<Pose2> = poses.iter().map(|x| pose(*x, 2.0, 0.3)).collect();
            let results = of(&mut kept, judgement, &poses, |pose| {
                made.fetch_add(1, Ordering::Relaxed);
                pose.translation.x
            });
            (results, made.load(Ordering::Relaxed))
        };
        assert_eq!(ask(1, &[1.0, 2.0, 1.0]), (vec![1.0, 2.0, 1.0], 2));
        assert_eq!(ask(2, &[2.0, 1.0, 3.0]), (vec![2.0, 1.0, 3.0], 3));
        assert_eq!(ask(2, &[]), (vec![], 3));
    }

    #[test]
    fn poses_that_are_no_longer_judged_are_forgotten() {
        let mut comparisons = Comparisons::default();
        for (judgement, expected) in [(1, 1), (2, 1), (3, 1), (4, 0)] {
            comparisons.begin();
            if judgement == 1 {
                comparisons
                    .agreements
                    .insert(key(&pose(1.0, 0.0, 0.0)), (comparisons.judgements, Agreement::default()));
            }
            assert_eq!(comparisons.agreements.len(), expected, "judgement {judgement}");
        }
    }
}
