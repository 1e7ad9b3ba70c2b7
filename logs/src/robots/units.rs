//! Lengths that may be in other units than metres.

use gridweave_runtime::ros::MapMetaData;
use std::ops::RangeInclusive;

/// Units in which programs write lengths, and how many of them are a metre.
const UNITS: [(&str, f64); 2] = [("centimetres", 100.0), ("millimetres", 1000.0)];
/// The least side of a map whose resolution may be in other units, metres.
const LARGE: f64 = 500.0;
/// The sides of the cells of robots' maps, metres.
const USUAL_CELLS: RangeInclusive<f64> = 0.01..=0.25;
/// No tag is read from farther away, metres.
const FARTHEST_TAG: f64 = 1000.0;
/// The least number of readings that show the unit of all.
const LEAST_READINGS: u64 = 10;

/// Why the resolution of a map may be in other units; `None` if it is not.
pub(crate) fn unit_of_map(info: &MapMetaData) -> Option<String> {
    let side = f64::from(info.resolution);
    let [width, height] = [info.width, info.height].map(|cells| f64::from(cells) * side);
    let (unit, per_metre) = UNITS.into_iter().find(|(_, per_metre)| USUAL_CELLS.contains(&(side / per_metre)))?;
    let metres = side / per_metre;
    (side >= 1.0 && width.max(height) >= LARGE).then(|| {
        format!(
            "cells of {side} m make a map of {width:.0} m by {height:.0} m: if its resolution is in {unit}, publish it in metres \
             ({metres}); it is read so with --resolution ROBOT={metres}"
        )
    })
}

/// The ranges of tags that were read on a topic.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TagRanges {
    readings: u64,
    too_far: u64,
}

impl TagRanges {
    /// Adds a range, metres. Returns why all of them may be in other units, once.
    pub(crate) fn add(&mut self, range: f64) -> Option<String> {
        if self.readings == LEAST_READINGS {
            return None;
        }
        self.readings += 1;
        self.too_far += u64::from(range > FARTHEST_TAG);
        (self.readings == LEAST_READINGS && 2 * self.too_far > self.readings).then(|| {
            format!("ranges of {range:.0} m are too long for a tag: if they are in millimetres, publish them in metres")
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resolution_in_other_units_is_named_where_the_map_would_be_huge() {
        let unit =
            |resolution, width, height| unit_of_map(&MapMetaData { resolution, width, height, ..Default::default() });
        let text = unit(5.0, 400, 300).unwrap();
        let start = "cells of 5 m make a map of 2000 m by 1500 m: if its resolution is in centimetres, publish it in metres (0.05)";
        assert!(text.starts_with(start), "{text}");
        assert!(unit(50.0, 400, 400).unwrap().contains("in millimetres, publish it in metres (0.05)"));
        for (resolution, cells) in [(0.05, 40_000), (5.0, 90), (0.5, 4000), (f32::NAN, 400), (1e9, 400)] {
            assert_eq!(unit(resolution, cells, cells), None, "{resolution}");
        }
    }

    #[test]
    fn ranges_in_millimetres_are_named_once() {
        let notes = |range: fn(u32) -> f64| {
            let mut ranges = TagRanges::default();
            (0..50).filter_map(|number| ranges.add(range(number))).collect::<Vec<_>>()
        };
        let found = notes(|number| 4000.0 + f64::from(number));
        assert_eq!(
            found,
            ["ranges of 4009 m are too long for a tag: if they are in millimetres, publish them in metres"]
        );
        // An error code among readings.
        assert!(notes(|number| if number % 3 == 0 { 65_535.0 } else { 4.0 }).is_empty());
    }
}
