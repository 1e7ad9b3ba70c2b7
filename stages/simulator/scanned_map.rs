//! A map of a building scanned from many positions, with small errors of their poses.

use super::clearances::Clearances;
use super::floor_plan::FloorPlan;
use super::lidar::Lidar;
use super::mapper::Mapper;
use super::ray_caster::RayCaster;
use crate::shared::geometry::{GridGeometry, Pose2, pose};
use crate::shared::scan_grid::SnapshotMap;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use std::f64::consts::TAU;

/// Parameters of the scans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanSettings {
    /// Number of scans, each from another position.
    pub count: usize,
    /// Beams of a scan, over a full circle.
    pub beams: usize,
    /// The longest range, metres.
    pub reach: f64,
    /// Standard deviation of a range, metres.
    pub noise: f64,
    /// Share of the beams that return nothing, 0 to 1.
    pub dropped: f64,
    /// Standard deviation of a scan's position in the map, in x and in y, metres.
    pub position_error: f64,
    /// Standard deviation of a scan's heading in the map, radians.
    pub heading_error: f64,
}

impl Default for ScanSettings {
    fn default() -> Self {
        Self {
            count: 200,
            beams: 720,
            reach: 12.0,
            noise: 0.015,
            dropped: 0.02,
            position_error: 0.01,
            heading_error: 0.002,
        }
    }
}

/// The map of a building that is scanned from random positions at which a robot can stand, on the given grid. What is
/// beyond is ignored.
pub(super) fn scan_building(
    plan: &FloorPlan,
    transform_map_building: &Pose2,
    geometry: GridGeometry,
    settings: &ScanSettings,
    random: &mut impl Rng,
) -> SnapshotMap {
    let places = Clearances::of(plan).places_in(&plan.bounds);
    let caster = RayCaster::new(&plan.solids);
    let ScanSettings { beams, reach, noise, dropped, .. } = *settings;
    let lidar = Lidar { beams, field_of_view: TAU, reach, noise, dropped };
    let mut mapper = Mapper::over(geometry);
    let mut beams = Vec::new();
    let scans = if places.is_empty() { 0 } else { settings.count };
    for _ in 0..scans {
        let place = places[random.random_range(0..places.len())];
        let transform_building_robot = pose(place.x, place.y, random.random::<f64>() * TAU);
        lidar.scan(&caster, &transform_building_robot, random, &mut beams);
        let mut error = |deviation: f64| deviation * random.sample::<f64, _>(StandardNormal);
        let (x, y, yaw) =
            (error(settings.position_error), error(settings.position_error), error(settings.heading_error));
        mapper.add_scan(&(transform_map_building * transform_building_robot * pose(x, y, yaw)), &beams);
    }
    mapper.whole()
}
