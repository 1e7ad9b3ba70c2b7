//! Where a scan was made, on the map around a robot, without adding it.

use super::pose_graph::turned_information;
use super::relocalization::relocate;
use super::scan_points::ScanPoint;
use super::scan_registration::{WELL_MATCHED, register};
use super::trajectory::{LEAST_MATCHED, Trajectory};
use crate::shared::geometry::Pose2;
use nalgebra::{Matrix3, Vector3};

/// A scan that was registered without being added.
#[derive(Clone, Copy, Debug)]
pub struct LocatedScan {
    /// Pose of the base in its frame at the last scan.
    pub pose: Pose2,
    /// Whether most of its points lie on the map.
    pub is_sure: bool,
    /// Standard deviation of its position by its walls alone in the direction in which they show it least, metres.
    /// It is large between two parallel walls.
    pub deviation: f64,
}

impl Trajectory {
    /// Registers points on the local map, without adding them: the pose relative to the last scan, `guess` being what
    /// it is expected to be with these standard deviations of position and yaw. `None` if the points lie on no earlier
    /// ones.
    pub fn locate(&self, guess: &Pose2, deviations: [f64; 2], points: &[ScanPoint]) -> Option<LocatedScan> {
        let last = self.poses().last()?;
        let [place, yaw] = deviations.map(|deviation| deviation.powi(-2));
        let information = Matrix3::from_diagonal(&Vector3::new(place, place, yaw));
        let information = turned_information(&information, &last.rotation);
        let found = register(self.local_map(), points, &(last * guess), &information, deviations);
        (found.matched >= LEAST_MATCHED).then(|| located(last, &found.pose, found.matched, &found.information))
    }

    /// Registers points likewise where they lie at one place alone, of all at which they may be. `None` if they lie nowhere, or at
    /// several.
    pub fn relocate(&self, guess: &Pose2, deviations: [f64; 2], points: &[ScanPoint]) -> Option<LocatedScan> {
        let last = self.poses().last()?;
        let found = relocate(self.local_map(), points, &(last * guess), deviations)?;
        Some(located(last, &found.pose, found.matched, &found.information))
    }
}

/// A scan at a pose, of whose points a share lies on the map, with the information on its pose by its walls alone.
fn located(last: &Pose2, pose: &Pose2, matched: f64, information: &Matrix3<f64>) -> LocatedScan {
    let of_position = information.fixed_view::<2, 2>(0, 0).into_owned();
    LocatedScan {
        pose: last.inv_mul(pose),
        is_sure: matched >= WELL_MATCHED,
        deviation: of_position.symmetric_eigenvalues().min().max(0.0).sqrt().recip(),
    }
}
