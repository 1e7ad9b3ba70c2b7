//! Distances between common places, which two robots have both seen, in a merge; the truth of a log with deformed maps
//! lists them.

use gridweave_logs::summary::{DeformationSummary, Frame, Summary};
use gridweave_runtime::ros::{DeformationNode, MapDeformation};
use gridweave_stages::shared::deformation::Deformation;
use gridweave_stages::shared::geometry::{PointPair, fit_rigid};
use nalgebra::{Isometry2, Matrix3, Point2, Vector2, Vector3};
use serde::Serialize;
use std::fmt;

/// A place in two maps: x and y in the map frame of the second robot by name, and then in that of the first, metres.
pub(crate) type PlacePair = [f64; 4];

/// Distances between common places in the merge of two robots.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CommonPlaces {
    /// Number of places.
    pub places: usize,
    /// Distances by the rigid frames.
    pub rigid: Distances,
    /// Distances with the deformations of the maps; none if no map is deformed.
    #[serde(rename = "bent")]
    pub deformed: Option<Distances>,
    /// Error of the rigid frames against the best rigid fit of the places; none if all places are at one point.
    pub from_best: Option<FromBest>,
}

/// Error of the frames of two robots against the best rigid fit of their common places. Deformed maps have no exact
/// rigid frames, so this fit is what a merge can be measured against.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FromBest {
    /// Error at the middle of the places, metres.
    pub metres: f64,
    /// Error of the direction, degrees, 0 to 180.
    pub degrees: f64,
    /// Normalised squared error in x, y and yaw by the covariance in the summary; none if the first robot is not the
    /// reference, or there is no covariance. With a correct covariance 95 % are below 7.81, and the mean is 3.
    pub normalised_error_squared: Option<f64>,
    /// Distances by the best rigid fit.
    pub best: Distances,
}

/// Statistics of the distances between common places.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Distances {
    /// The median, metres.
    pub median_m: f64,
    /// The 90 % quantile, metres.
    pub p90_m: f64,
    /// The maximum, metres.
    pub most_m: f64,
}

/// Measures a merge of the robots `first` and `second`. `None` if they are not merged with each other, or there are no
/// places.
pub(crate) fn measure(run: &Summary, [first, second]: [&str; 2], places: &[PlacePair]) -> Option<CommonPlaces> {
    let one =
        Placed { frame: pose(run.frames.get(first)?), deformation: run.deformations.get(first).and_then(deformation) };
    let other = Placed {
        frame: pose(run.frames.get(second)?),
        deformation: run.deformations.get(second).and_then(deformation),
    };
    let distances = |is_deformed: bool| {
        let apart = |&[x2, y2, x1, y1]: &PlacePair| {
            (one.in_world(Point2::new(x1, y1), is_deformed) - other.in_world(Point2::new(x2, y2), is_deformed)).norm()
        };
        Distances::of(places.iter().map(apart).collect())
    };
    let is_deformed = one.deformation.is_some() || other.deformation.is_some();
    Some(CommonPlaces {
        places: places.len(),
        rigid: distances(false)?,
        deformed: if is_deformed { distances(true) } else { None },
        from_best: from_best(run, [first, second], places),
    })
}

fn from_best(run: &Summary, [first, second]: [&str; 2], places: &[PlacePair]) -> Option<FromBest> {
    let (frame_a, frame_b) = (run.frames.get(first)?, run.frames.get(second)?);
    let found = pose(frame_a).inverse() * pose(frame_b);
    let of_both = |&[x2, y2, x1, y1]: &PlacePair| (Point2::new(x1, y1), Point2::new(x2, y2));
    let pairs: Vec<PointPair> = places.iter().map(of_both).map(|(a, b)| PointPair { a, b, weight: 1.0 }).collect();
    let best = fit_rigid(&pairs)?.transform_a_b;
    let middle: Point2<f64> =
        (pairs.iter().fold(Vector2::zeros(), |sum, pair| sum + pair.b.coords) / pairs.len() as f64).into();
    let is_reference = run.reference.as_deref() == Some(first);
    Some(FromBest {
        metres: (found * middle - best * middle).norm(),
        degrees: best.rotation.angle_to(&found.rotation).abs().to_degrees(),
        normalised_error_squared: if is_reference { normalised_error_squared(frame_b, &best) } else { None },
        best: Distances::of(pairs.iter().map(|pair| (pair.a - best * pair.b).norm()).collect())?,
    })
}

/// Normalised squared error of a frame by its covariance. `None` if it has none.
pub(crate) fn normalised_error_squared(found: &Frame, expected: &Isometry2<f64>) -> Option<f64> {
    let turned = (expected.rotation.inverse() * pose(found).rotation).angle();
    let moved = pose(found).translation.vector - expected.translation.vector;
    let error = Vector3::new(moved.x, moved.y, turned);
    let covariance = Matrix3::from_row_slice(&found.covariance).cholesky()?;
    Some(error.dot(&covariance.solve(&error)))
}

/// The pose of a map in the world, and its deformation.
struct Placed {
    frame: Isometry2<f64>,
    deformation: Option<Deformation>,
}

impl Placed {
    fn in_world(&self, point: Point2<f64>, is_deformed: bool) -> Point2<f64> {
        match &self.deformation {
            Some(deformation) if is_deformed => self.frame * deformation.apply(&point),
            _ => self.frame * point,
        }
    }
}

impl Distances {
    fn of(mut distances: Vec<f64>) -> Option<Self> {
        distances.sort_by(f64::total_cmp);
        let at =
            |share: f64| distances.get((share * (distances.len().checked_sub(1)?) as f64).round() as usize).copied();
        Some(Self { median_m: at(0.5)?, p90_m: at(0.9)?, most_m: at(1.0)? })
    }
}

impl fmt::Display for CommonPlaces {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text =
            |Distances { median_m, p90_m, .. }: &Distances| format!("median {median_m:.3} m, 90 % below {p90_m:.3} m");
        write!(f, "distances of {} common places: {} by the rigid frames", self.places, text(&self.rigid))?;
        match &self.deformed {
            Some(deformed) => write!(f, "; {} with the deformations", text(deformed)),
            None => Ok(()),
        }
    }
}

pub(crate) fn pose(frame: &Frame) -> Isometry2<f64> {
    Isometry2::new(nalgebra::Vector2::new(frame.x, frame.y), frame.yaw)
}

fn deformation(summary: &DeformationSummary) -> Option<Deformation> {
    let node = |&[x, y, dx, dy, dyaw]: &[f64; 5]| DeformationNode { x, y, dx, dy, dyaw, ..Default::default() };
    let nodes = summary.nodes.iter().map(node).collect();
    Deformation::from_message(&MapDeformation { spacing: summary.spacing, nodes, ..Default::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summary(displacements: &[(&str, f64)]) -> Summary {
        let frame = |x: f64| Frame { x, ..Default::default() };
        let corners = [(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (4.0, 4.0)];
        let deformation = |dx: f64| DeformationSummary {
            spacing: 4.0,
            nodes: corners.iter().map(|&(x, y)| [x, y, dx, 0.0, 0.0]).collect(),
            ..Default::default()
        };
        Summary {
            frames: [("robot1".into(), frame(0.0)), ("robot2".into(), frame(10.0))].into(),
            deformations: displacements.iter().map(|&(robot, dx)| (robot.to_owned(), deformation(dx))).collect(),
            ..Default::default()
        }
    }

    #[test]
    fn distances_are_measured_by_the_frames_and_with_the_deformations() {
        let places: Vec<PlacePair> = (0..=10).map(|i| [1.0, 1.0, 11.0 + 0.1 * f64::from(i), 1.0]).collect();
        let measured = measure(&summary(&[("robot2", 0.5)]), ["robot1", "robot2"], &places).unwrap();
        let near = |one: f64, other: f64| (one - other).abs() < 1e-9;
        assert!(
            near(measured.rigid.median_m, 0.5) && near(measured.rigid.p90_m, 0.9) && near(measured.rigid.most_m, 1.0)
        );
        assert!(near(measured.deformed.unwrap().most_m, 0.5), "{measured}");
        assert!(measured.from_best.is_none(), "all places of the first are at one point");
        assert_eq!(measure(&summary(&[]), ["robot1", "robot2"], &places).unwrap().deformed, None);
        assert_eq!(measure(&summary(&[]), ["robot1", "robot3"], &places), None);
        assert_eq!(measure(&summary(&[]), ["robot1", "robot2"], &[]), None);
    }

    #[test]
    fn frames_are_measured_against_the_best_rigid_fit() {
        // The second map is shifted by 0.2 m along x, and half of its places by 0.1 m up, half down.
        let place = |i: i32| {
            let (x, y) = (f64::from(i % 5), f64::from(i / 5));
            [x + 0.2, y + if i % 2 == 0 { 0.1 } else { -0.1 }, x + 10.0, y]
        };
        let places: Vec<PlacePair> = (0..20).map(place).collect();
        let mut run = summary(&[]);
        run.reference = Some("robot1".into());
        let covariance = [0.04, 0.0, 0.0, 0.0, 0.04, 0.0, 0.0, 0.0, 0.01];
        run.frames.get_mut("robot2").unwrap().covariance = covariance;
        let from_best = measure(&run, ["robot1", "robot2"], &places).unwrap().from_best.unwrap();
        assert!((from_best.metres - 0.2).abs() < 0.01 && from_best.degrees < 1.0, "{from_best:?}");
        assert!((0.09..0.11).contains(&from_best.best.median_m), "{from_best:?}");
        assert!((from_best.normalised_error_squared.unwrap() - 1.0).abs() < 0.3, "{from_best:?}");
        run.reference = Some("robot2".into());
        assert_eq!(
            measure(&run, ["robot1", "robot2"], &places).unwrap().from_best.unwrap().normalised_error_squared,
            None
        );
    }
}
