//! The search of tags by their readings alone, at the poses of an estimate.

use super::super::far_tags::{self, FarTag};
use super::super::measured::Measured;
use super::super::{Ray, Ring, TagLocalizerParameters, TagMode};
use super::graph::LandmarkGraph;
use super::keyframes::yaw;
use crate::shared::geometry::Point2;

/// Largest number of ranges, and of bearings, with which a tag is searched; they are evenly spaced along the drive.
const MOST_SEARCHED: usize = 100;
/// Cells along a side of the grid on which a tag is searched: its position is refined in any case.
const SEARCH_CELLS: f64 = 100.0;

/// Searches tags by their readings alone.
pub(super) fn search(tags: &[FarTag], parameters: &TagLocalizerParameters) -> Vec<Option<TagMode>> {
    let coarse = TagLocalizerParameters { resolution: parameters.grid_size / SEARCH_CELLS, ..parameters.clone() };
    far_tags::locate(tags, &coarse)
}

/// The readings of each tag at the estimated poses, not more than a search needs, and the number of all. Ranges are
/// corrected by the calibration so far.
pub(super) fn readings_by_tag(graph: &LandmarkGraph<'_>, parameters: &TagLocalizerParameters) -> Vec<(FarTag, usize)> {
    let mut tags = vec![(FarTag::default(), 0); graph.tags.len()];
    for reading in graph.readings() {
        let here = graph.poses[reading.keyframe] * reading.offset;
        let (tag, count) = &mut tags[reading.tag];
        *count += 1;
        let variance = reading.stddev.powi(2) + parameters.pose_stddev.powi(2);
        match reading.measured {
            Measured::Range(range) => {
                let radius = (range - graph.calibration[0]) / (1.0 + graph.calibration[1]);
                tag.ranges.push(Ring { centre: here.translation.vector.into(), radius, variance });
            }
            Measured::Place(place) => {
                tag.seen.push(Ring { centre: here * Point2::from(place), radius: 0.0, variance });
            }
            Measured::Bearing { sensor, bearing, stddev } => tag.rays.push(Ray {
                origin: here * Point2::from(sensor),
                bearing: yaw(&here) + bearing,
                variance: stddev * stddev,
                origin_variance: parameters.pose_stddev.powi(2),
            }),
        }
    }
    for (tag, _) in &mut tags {
        thin_out(&mut tag.ranges);
        thin_out(&mut tag.seen);
        thin_out(&mut tag.rays);
    }
    tags
}

/// Keeps readings that are evenly spaced.
fn thin_out<T>(readings: &mut Vec<T>) {
    let step = readings.len().div_ceil(MOST_SEARCHED).max(1);
    let mut number = 0;
    readings.retain(|_| {
        number += 1;
        (number - 1) % step == 0
    });
}
