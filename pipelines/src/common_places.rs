//! How well a merge lays places on each other that two robots both have seen, as the truth of a bent log knows them.

use gridweave_logs::summary::{Bend, Frame, Summary};
use gridweave_runtime::ros::{DeformationNode, MapDeformation};
use gridweave_stages::deformation::Deformation;
use nalgebra::{Isometry2, Point2};
use serde::Serialize;
use std::fmt;

/// A place as two maps show it: x and y in the map frame of the second robot by name, and then in that of the first, metres.
pub(crate) type CommonPlace = [f64; 4];

/// How far the same places lie apart in the merge of two robots.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CommonPlaces {
    /// How many places there are.
    pub places: usize,
    /// As the rigid frames lay them.
    pub rigid: Distances,
    /// As the bent maps lie in these frames; none if no map is bent.
    pub bent: Option<Distances>,
}

/// Distances between places that should be one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Distances {
    /// Metres.
    pub median_m: f64,
    /// Nine of ten are no greater, metres.
    pub p90_m: f64,
    /// Metres.
    pub most_m: f64,
}

/// Measures a merge of the robots `first` and `second`. `None` if they are not merged with each other, or there are no
/// places.
pub(crate) fn measure(run: &Summary, [first, second]: [&str; 2], places: &[CommonPlace]) -> Option<CommonPlaces> {
    let one = Placed { frame: pose(run.frames.get(first)?), bend: run.bends.get(first).and_then(deformation) };
    let other = Placed { frame: pose(run.frames.get(second)?), bend: run.bends.get(second).and_then(deformation) };
    let distances = |is_bent: bool| {
        let apart = |&[x2, y2, x1, y1]: &CommonPlace| {
            (one.in_world(Point2::new(x1, y1), is_bent) - other.in_world(Point2::new(x2, y2), is_bent)).norm()
        };
        Distances::of(places.iter().map(apart).collect())
    };
    let is_bent = one.bend.is_some() || other.bend.is_some();
    Some(CommonPlaces {
        places: places.len(),
        rigid: distances(false)?,
        bent: if is_bent { distances(true) } else { None },
    })
}

/// A map in the world.
struct Placed {
    frame: Isometry2<f64>,
    bend: Option<Deformation>,
}

impl Placed {
    fn in_world(&self, point: Point2<f64>, is_bent: bool) -> Point2<f64> {
        match &self.bend {
            Some(bend) if is_bent => self.frame * bend.apply(&point),
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
        let text = |Distances { median_m, p90_m, .. }: &Distances| {
            format!("{median_m:.3} m in the median, {p90_m:.3} m at 90 %")
        };
        write!(f, "{} common places: {} apart as the rigid frames lay them", self.places, text(&self.rigid))?;
        match &self.bent {
            Some(bent) => write!(f, "; {} as the maps are bent", text(bent)),
            None => Ok(()),
        }
    }
}

pub(crate) fn pose(frame: &Frame) -> Isometry2<f64> {
    Isometry2::new(nalgebra::Vector2::new(frame.x, frame.y), frame.yaw)
}

fn deformation(bend: &Bend) -> Option<Deformation> {
    let node = |&[x, y, dx, dy, dyaw]: &[f64; 5]| DeformationNode { x, y, dx, dy, dyaw, ..Default::default() };
    let nodes = bend.nodes.iter().map(node).collect();
    Deformation::from_message(&MapDeformation { spacing: bend.spacing, nodes, ..Default::default() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn summary(bends: &[(&str, f64)]) -> Summary {
        let frame = |x: f64| Frame { x, ..Default::default() };
        let corners = [(0.0, 0.0), (4.0, 0.0), (0.0, 4.0), (4.0, 4.0)];
        let bend = |dx: f64| Bend {
            spacing: 4.0,
            nodes: corners.iter().map(|&(x, y)| [x, y, dx, 0.0, 0.0]).collect(),
            ..Default::default()
        };
        Summary {
            frames: [("robot1".into(), frame(0.0)), ("robot2".into(), frame(10.0))].into(),
            bends: bends.iter().map(|&(robot, dx)| (robot.to_owned(), bend(dx))).collect(),
            ..Default::default()
        }
    }

    #[test]
    fn places_are_measured_as_the_frames_lay_them_and_as_the_maps_are_bent() {
        let places: Vec<CommonPlace> = (0..=10).map(|i| [1.0, 1.0, 11.0 + 0.1 * f64::from(i), 1.0]).collect();
        let measured = measure(&summary(&[("robot2", 0.5)]), ["robot1", "robot2"], &places).unwrap();
        let near = |one: f64, other: f64| (one - other).abs() < 1e-9;
        assert!(
            near(measured.rigid.median_m, 0.5) && near(measured.rigid.p90_m, 0.9) && near(measured.rigid.most_m, 1.0)
        );
        assert!(near(measured.bent.unwrap().most_m, 0.5), "{measured}");
        assert_eq!(measure(&summary(&[]), ["robot1", "robot2"], &places).unwrap().bent, None);
        assert_eq!(measure(&summary(&[]), ["robot1", "robot3"], &places), None);
        assert_eq!(measure(&summary(&[]), ["robot1", "robot2"], &[]), None);
    }
}
