//! Conventions in which programs write the cells of an occupancy grid, and their translation to that of ROS map
//! servers: -1 unknown, 0 free to 100 occupied.

mod bytes;
mod costmap;

use bytes::ByteValues;
use costmap::{obstacles_are_inflated, without_costs};
use gridweave_runtime::ros::{MapMetaData, OccupancyGrid, cell, decode, encode};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;

/// The value of a cell in a costmap whose obstacle the robot's centre must not be nearer to (nav2's inscribed cost).
const INSCRIBED: i8 = 99;
/// The value of an obstacle, in costmaps and in maps.
const LETHAL: i8 = 100;
/// The value of a cell that is as likely occupied as free.
const EVEN_ODDS: i8 = 50;
/// Two classes of values explain more of their variance than this: as much as they explain of values that are spread
/// evenly.
const EVEN_SPREAD: f64 = 0.75;
/// The least difference of the means of two classes of values, if they are not 0 and one other value.
const LEAST_CONTRAST: f64 = 20.0;
/// No map has so many times more walls than free space.
const MORE_THAN_WALLS: u64 = 2;

/// How the values of cells are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CellValues {
    /// By the distribution of the values in each map: as `occupancy` where some cells are occupied and some free; as
    /// `costmap` where obstacles are inflated; as `probabilities` where else most of what is likely occupied, or free,
    /// would be unknown; as `two_classes` where the values fall into two classes. Values outside -1 to 100 are read as those of an image or of a costmap from 0 to 255, where they fit, and else as
    /// unknown.
    #[default]
    Auto,
    /// As map servers write them: occupied from 65 to 100, free below 25.
    Occupancy,
    /// As nav2's costmaps: 100 is an obstacle, and costs that fall with the distance from it are free space.
    Costmap,
    /// As Cartographer after a few scans: above 50 is occupied and below 50 free.
    Probabilities,
    /// The larger of two classes of values is occupied and the smaller free, whatever they are: 0 and 1, 30 and 70, 25
    /// and 100.
    TwoClasses,
    /// The smaller of two classes of values is occupied and the larger free: the shades of an image.
    Inverted,
}

/// The meaning of the values of one map's cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum CellMeaning {
    /// What map servers write.
    Occupancy,
    /// Obstacles with the costs around them.
    Costmap,
    /// Above 50 occupied, below 50 free.
    Probabilities,
    /// The means of two classes of values, free and occupied.
    TwoClasses { free: f64, occupied: f64 },
}

impl fmt::Display for CellMeaning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Occupancy => f.write_str("cells are read as occupancy"),
            Self::Costmap => f.write_str("a costmap: costs below 100 are read as free, 100 as occupied"),
            Self::Probabilities => {
                f.write_str("values are read as probabilities: below 50 as free, above 50 as occupied")
            }
            Self::TwoClasses { free, occupied } => {
                write!(f, "values about {free:.0} are read as free, values about {occupied:.0} as occupied")
            }
        }
    }
}

/// Why the values of cells may have the opposite meaning: there are two of them, and the larger, which is taken for
/// walls, has more cells than the smaller; with the option that reads them so.
pub(crate) fn inversion_of(cells: &[i8]) -> Option<String> {
    let counts = Counts::of(cells);
    let mut values = counts.0.iter().enumerate().filter(|(_, count)| **count > 0);
    let (Some((smaller, few)), Some((larger, many)), None) = (values.next(), values.next(), values.next()) else {
        return None;
    };
    (*many > MORE_THAN_WALLS * few).then(|| {
        format!(
            "{many} cells have the value {larger} and {few} the value {smaller}, so that most would be walls, or none: if the \
             walls have the value {smaller}, give --set log.map_values=inverted"
        )
    })
}

impl CellValues {
    /// The cells of a map in the convention of map servers, and the convention that they were in. Borrowed if they are
    /// in it.
    pub(crate) fn read<'a>(self, info: &MapMetaData, cells: &'a [i8]) -> (Cow<'a, [i8]>, CellMeaning) {
        let convention = self.convention(info.width as usize, cells);
        let read = match convention {
            CellMeaning::Occupancy => Cow::Borrowed(cells),
            CellMeaning::Costmap => Cow::Owned(without_costs(info.width as usize, cells)),
            CellMeaning::Probabilities => Cow::Owned(cells.iter().map(|value| by_probability(*value)).collect()),
            CellMeaning::TwoClasses { free, occupied } => {
                let scaled = |value: i8| {
                    let share = (f64::from(value) - free) / (occupied - free);
                    if cell::is_known(value) { (100.0 * share).round().clamp(0.0, 100.0) as i8 } else { cell::UNKNOWN }
                };
                Cow::Owned(cells.iter().map(|value| scaled(*value)).collect())
            }
        };
        (read, convention)
    }

    /// A map message in the convention of map servers, and what its values were read as; `None` if it is in it, or is
    /// no map.
    pub(crate) fn translate(self, message: &[u8]) -> Option<(Vec<u8>, Vec<String>)> {
        let map: OccupancyGrid<'_> = decode(message).ok()?;
        let cells = map.cells();
        if (map.info.width as usize).checked_mul(map.info.height as usize) != Some(cells.len()) {
            return None;
        }
        let bytes = ByteValues::of(cells).filter(|_| self == Self::Auto);
        let in_range = bytes.map_or(Cow::Borrowed(cells), |bytes| Cow::Owned(bytes.read(cells)));
        let (read, convention) = self.read(&map.info, &in_range);
        let is_other = matches!(read, Cow::Owned(_));
        if bytes.is_none() && !is_other {
            return None;
        }
        let notes = bytes.map(|bytes| bytes.to_string()).into_iter().chain(is_other.then(|| convention.to_string()));
        let translated = OccupancyGrid { data: bytemuck::cast_slice(&read), ..map };
        Some((encode(&translated).ok()?, notes.collect()))
    }

    fn convention(self, width: usize, cells: &[i8]) -> CellMeaning {
        let classes = |classes: Option<Classes>| {
            let between = |Classes { free, occupied, .. }| CellMeaning::TwoClasses { free, occupied };
            classes.map_or(CellMeaning::Occupancy, between)
        };
        match self {
            Self::Occupancy => CellMeaning::Occupancy,
            Self::Costmap => CellMeaning::Costmap,
            Self::Probabilities => CellMeaning::Probabilities,
            Self::TwoClasses => classes(Counts::of(cells).classes()),
            Self::Inverted => match classes(Counts::of(cells).classes()) {
                CellMeaning::TwoClasses { free, occupied } => {
                    CellMeaning::TwoClasses { free: occupied, occupied: free }
                }
                convention => convention,
            },
            Self::Auto => {
                let counts = Counts::of(cells);
                let has = |is: fn(i8) -> bool| (0..=LETHAL).any(|value| is(value) && counts.of_value(value) > 0);
                match has(cell::is_occupied) && has(cell::is_free) {
                    // Of a costmap as many cells are inscribed as are obstacles; the walk over its cells is left to
                    // such maps.
                    true if counts.of_value(INSCRIBED) >= counts.of_value(LETHAL).max(1)
                        && obstacles_are_inflated(width, cells) =>
                    {
                        CellMeaning::Costmap
                    }
                    true if counts.are_probabilities() => CellMeaning::Probabilities,
                    true => CellMeaning::Occupancy,
                    false => match classes(counts.two_classes()) {
                        CellMeaning::Occupancy if counts.are_probabilities() => CellMeaning::Probabilities,
                        convention => convention,
                    },
                }
            }
        }
    }
}

/// How many cells have each value from 0 to 100.
struct Counts([u64; LETHAL as usize + 1]);

impl Counts {
    fn of(cells: &[i8]) -> Self {
        let mut all = [0; 256];
        cells.iter().for_each(|value| all[usize::from(value.cast_unsigned())] += 1);
        let mut known = [0; LETHAL as usize + 1];
        known.copy_from_slice(&all[..=LETHAL as usize]);
        Self(known)
    }

    fn of_value(&self, value: i8) -> u64 {
        usize::try_from(value).ok().and_then(|index| self.0.get(index)).copied().unwrap_or(0)
    }

    /// Whether there are values on both sides of 50, and most of those on one side are near it: map servers take them for
    /// unknown.
    fn are_probabilities(&self) -> bool {
        let sum = |is: fn(i8) -> bool, within: std::ops::RangeInclusive<i8>| {
            within.filter(|value| is(*value)).map(|value| self.of_value(value)).sum::<u64>()
        };
        let (below, above) = (0..=EVEN_ODDS - 1, EVEN_ODDS + 1..=LETHAL);
        let (free, occupied) = (sum(cell::is_free, below.clone()), sum(cell::is_occupied, above.clone()));
        let (all_below, all_above) = (sum(|_| true, below), sum(|_| true, above));
        all_below > 0 && all_above > 0 && (2 * free < all_below || 2 * occupied < all_above)
    }

    /// The means of the two classes into which the values fall, the larger of which has fewer cells as walls have;
    /// `None` if they are one class.
    fn two_classes(&self) -> Option<Classes> {
        // Of 0 and one other value, 0 is free and the other occupied, however small it is.
        let is_binary = self.0[0] > 0 && self.0.iter().filter(|count| **count > 0).count() == 2;
        let is_contrast = |classes: &Classes| is_binary || classes.occupied - classes.free >= LEAST_CONTRAST;
        self.classes()
            .filter(|classes| classes.explained > EVEN_SPREAD && is_contrast(classes) && classes.has_fewer_walls)
    }

    /// The two classes with the least variance within them (Otsu, "A threshold selection method from gray-level
    /// histograms", 1979); `None` if there is one value only.
    fn classes(&self) -> Option<Classes> {
        let total = self.0.iter().sum::<u64>() as f64;
        let values = || self.0.iter().enumerate().map(|(value, count)| (value as f64, *count as f64));
        let mean = values().map(|(value, count)| value * count).sum::<f64>() / total;
        let variance = values().map(|(value, count)| (value - mean).powi(2) * count).sum::<f64>() / total;
        let (mut below, mut sum) = (0.0, 0.0);
        let mut best: Option<Classes> = None;
        for (value, count) in values() {
            below += count;
            sum += value * count;
            let above = total - below;
            if below == 0.0 || above == 0.0 {
                continue;
            }
            let (free, occupied) = (sum / below, (mean * total - sum) / above);
            let between = below * above / (total * total) * (occupied - free).powi(2);
            let explained = between / variance;
            if best.is_none_or(|best| explained > best.explained) {
                best = Some(Classes { free, occupied, explained, has_fewer_walls: above < below });
            }
        }
        best
    }
}

/// Two classes of values.
#[derive(Clone, Copy)]
struct Classes {
    /// The mean of the smaller values.
    free: f64,
    /// The mean of the larger values.
    occupied: f64,
    /// The share of the variance of all values that is between the classes.
    explained: f64,
    /// Whether fewer cells have the larger values.
    has_fewer_walls: bool,
}

/// A cell by its probability of being occupied, in percent.
fn by_probability(value: i8) -> i8 {
    match value {
        _ if !cell::is_known(value) || value == EVEN_ODDS => cell::UNKNOWN,
        _ if value > EVEN_ODDS => LETHAL,
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const N: i8 = -1;

    fn read(values: CellValues, width: u32, cells: &[i8]) -> (Vec<i8>, CellMeaning) {
        let info = MapMetaData { width, height: cells.len() as u32 / width, ..Default::default() };
        let (read, convention) = values.read(&info, cells);
        (read.into_owned(), convention)
    }

    #[test]
    fn what_map_servers_write_is_read_as_it_is() {
        for cells in [&[0, 0, 0, 100, N][..], &[0, 3, 12, 40, 97, N], &[100, 100, N], &[0, 0, N], &[N, N], &[]] {
            assert_eq!(read(CellValues::Auto, 1, cells), (cells.to_vec(), CellMeaning::Occupancy), "{cells:?}");
        }
    }

    #[test]
    fn the_larger_of_two_values_is_occupied_and_the_smaller_free() {
        for (free, occupied) in [(0, 1), (25, 100), (0, 64), (30, 70), (0, 50)] {
            let cells = [N, free, free, free, occupied, free, N];
            let (read, convention) = read(CellValues::Auto, 7, &cells);
            assert_eq!(read, [N, 0, 0, 0, 100, 0, N], "{free} {occupied}");
            let means = CellMeaning::TwoClasses { free: f64::from(free), occupied: f64::from(occupied) };
            assert_eq!(convention, means);
        }
    }

    #[test]
    fn probabilities_from_30_to_70_are_spread_over_the_whole_range() {
        let cells: Vec<i8> =
            [30; 40].into_iter().chain([33; 20]).chain([66; 5]).chain([70; 9]).chain([50, N]).collect();
        let (read, _) = read(CellValues::Auto, 76, &cells);
        let count = |is: fn(i8) -> bool| read.iter().filter(|value| is(**value)).count();
        assert_eq!((count(cell::is_free), count(cell::is_occupied)), (60, 14));
        assert_eq!(read[75], N);
    }

    #[test]
    fn probabilities_are_split_where_most_walls_or_most_free_space_would_be_unknown() {
        // Cartographer after a few scans, with some cells that are sure; and weak walls beside sure free space.
        for cells in [
            [[20; 2], [43; 2], [43; 2], [43; 2], [57; 2], [50, N], [70, 60]].concat(),
            [[0; 2], [0; 2], [0; 2], [0; 2], [60; 2], [50, N], [100, 60]].concat(),
        ] {
            let (read, convention) = read(CellValues::Auto, 14, &cells);
            assert_eq!(convention, CellMeaning::Probabilities);
            assert_eq!(read, [0, 0, 0, 0, 0, 0, 0, 0, 100, 100, N, N, 100, 100]);
        }
        let sure = [0, 0, 0, 30, 50, 50, 50, 50, 100, 100, 60, N];
        assert_eq!(read(CellValues::Auto, 12, &sure).1, CellMeaning::Occupancy, "50 is unknown");
        // What the user demands is done.
        let spread: Vec<i8> = (30..60).collect();
        assert!(matches!(read(CellValues::TwoClasses, 30, &spread).1, CellMeaning::TwoClasses { .. }));
    }

    #[test]
    fn of_two_values_the_larger_of_which_has_most_cells_the_smaller_may_be_walls() {
        for (wall, free) in [(0, 1), (0, 100), (30, 70)] {
            let cells = [N, free, free, free, wall, free, N];
            let text = inversion_of(&cells).unwrap();
            let found = format!("4 cells have the value {free} and 1 the value {wall}");
            assert!(text.starts_with(&found) && text.ends_with("--set log.map_values=inverted"), "{text}");
            assert_eq!(read(CellValues::Inverted, 7, &cells).0, [N, 0, 0, 0, 100, 0, N]);
        }
        for cells in [&[0, 0, 0, 100, N][..], &[0, 100, 100], &[0, 1, 2, 2, 2, 2, 2], &[1, 1, 1], &[N], &[]] {
            assert_eq!(inversion_of(cells), None, "{cells:?}");
        }
    }

    #[test]
    fn values_of_one_class_are_left_as_they_are() {
        let spread: Vec<i8> = (20..50).collect();
        for cells in [&spread[..], &[0, 1, 2, 3, 2, 1, 0], &[40, 40, 41], &[1, 1, 1, 0]] {
            assert_eq!(read(CellValues::Auto, 1, cells).1, CellMeaning::Occupancy, "{cells:?}");
        }
    }

    /// A wall along a column with the costs about it, free space on its left and unknown space on its right.
    fn costmap() -> Vec<i8> {
        [[0, 0, 40, 70, 99, 100, 99, 70, N, N]; 6].concat()
    }

    #[test]
    fn costs_are_free_on_the_side_of_free_space_and_unknown_behind_an_obstacle() {
        let expected = [[0, 0, 0, 0, 0, 100, N, N, N, N]; 6].concat();
        assert_eq!(read(CellValues::Auto, 10, &costmap()), (expected.clone(), CellMeaning::Costmap));
        assert_eq!(read(CellValues::Costmap, 10, &costmap()).0, expected);
        assert_eq!(read(CellValues::Occupancy, 10, &costmap()).0, costmap());
        assert_eq!(read(CellValues::Costmap, 2, &[0, -128]).0, [0, N], "every value out of range is unknown");
    }

    #[test]
    fn a_map_with_values_of_99_beside_walls_here_and_there_is_no_costmap() {
        let mut cells = [[0, 0, 0, 100, 99, 0, N]; 6].concat();
        cells[0] = 99;
        assert_eq!(read(CellValues::Auto, 7, &cells).1, CellMeaning::Occupancy);
    }

    proptest! {
        #[test]
        fn what_is_read_is_in_the_convention_of_map_servers_and_unknown_cells_stay_so(
            cells in proptest::collection::vec(any::<i8>(), 0..60),
            width in 0_u32..9,
            values in prop_oneof![Just(CellValues::Auto), Just(CellValues::Costmap), Just(CellValues::TwoClasses), Just(CellValues::Probabilities)],
        ) {
            let info = MapMetaData { width, ..Default::default() };
            let (read, convention) = values.read(&info, &cells);
            prop_assert_eq!(read.len(), cells.len());
            if convention != CellMeaning::Occupancy {
                for (was, is) in cells.iter().zip(read.iter()) {
                    prop_assert!(*is == cell::UNKNOWN || cell::is_known(*is));
                    prop_assert!(cell::is_known(*was) || *is == cell::UNKNOWN);
                }
            }
        }
    }
}
