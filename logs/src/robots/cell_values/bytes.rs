//! Maps whose cells are bytes from 0 to 255, put as they are into the signed cells of an occupancy grid.

use gridweave_runtime::ros::cell;
use std::fmt;

/// The byte of an unknown pixel in the image of a map server.
const UNKNOWN_PIXEL: usize = 205;
/// The byte of a free pixel in the image of a map server.
const FREE_PIXEL: usize = 254;
/// The byte of an obstacle in a costmap (`costmap_2d::LETHAL_OBSTACLE`).
const LETHAL_COST: usize = 254;
/// The byte of a cell in which the robot touches an obstacle (`costmap_2d::INSCRIBED_INFLATED_OBSTACLE`).
const INSCRIBED_COST: usize = 253;
/// An unknown cell of a costmap, and -1 as a byte.
const NO_INFORMATION: usize = 255;

/// The meaning of bytes that no cell of an occupancy grid has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteValues {
    /// The pixels of a map server's image: 205 is unknown. The rarer of black and white is occupied, as walls are.
    Pixels {
        /// Whether white pixels are occupied.
        inverted: bool,
    },
    /// The costs of a costmap before they are published: 254 is an obstacle, 255 unknown.
    Costs,
    /// Nothing known.
    OutOfRange,
}

impl fmt::Display for ByteValues {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pixels { inverted: false } => {
                "cells have the values of an image: 0 is read as occupied, 205 as unknown, 254 and 255 as free"
            }
            Self::Pixels { inverted: true } => {
                "cells have the values of an image: 0 is read as free, 205 as unknown, 254 and 255 as occupied"
            }
            Self::Costs => "cells have the costs of a costmap from 0 to 255: 254 is read as occupied, 255 as unknown",
            Self::OutOfRange => "cells with values outside -1 to 100 are read as unknown",
        })
    }
}

impl ByteValues {
    /// The meaning of the values outside -1 to 100; `None` if there are none.
    pub(super) fn of(cells: &[i8]) -> Option<Self> {
        let mut counts = [0_u64; 256];
        cells.iter().for_each(|value| counts[usize::from(value.cast_unsigned())] += 1);
        let is_in_range = |byte: usize| byte <= 100 || byte == NO_INFORMATION;
        let outside: u64 = (0..counts.len()).filter(|byte| !is_in_range(*byte)).map(|byte| counts[byte]).sum();
        if outside == 0 {
            return None;
        }
        let is_pixel = |byte: usize| [0, UNKNOWN_PIXEL, FREE_PIXEL, NO_INFORMATION].contains(&byte);
        let others: u64 = (0..counts.len()).filter(|byte| !is_pixel(*byte)).map(|byte| counts[byte]).sum();
        let (black, white) = (counts[0], counts[FREE_PIXEL] + counts[NO_INFORMATION]);
        let is_image = counts[UNKNOWN_PIXEL] > others && white > 0 || counts[FREE_PIXEL] > black && others == 0;
        Some(if is_image && black > 0 {
            Self::Pixels { inverted: white < black }
        } else if counts[LETHAL_COST] + counts[INSCRIBED_COST] > 0 && counts[0] > counts[LETHAL_COST] {
            Self::Costs
        } else {
            Self::OutOfRange
        })
    }

    /// The cells in the range of an occupancy grid, -1 to 100.
    pub(super) fn read(self, cells: &[i8]) -> Vec<i8> {
        let value = |byte: usize| match self {
            Self::Pixels { inverted } => match byte {
                UNKNOWN_PIXEL => cell::UNKNOWN,
                byte => {
                    if (byte < UNKNOWN_PIXEL) != inverted {
                        100
                    } else {
                        0
                    }
                }
            },
            // As nav2 publishes costs.
            Self::Costs => match byte {
                0 => 0,
                LETHAL_COST => 100,
                INSCRIBED_COST => 99,
                NO_INFORMATION => cell::UNKNOWN,
                cost => (1 + 97 * (cost - 1) / 251) as i8,
            },
            Self::OutOfRange => i8::try_from(byte).ok().filter(|value| *value <= 100).unwrap_or(cell::UNKNOWN),
        };
        let table: Vec<i8> = (0..256).map(value).collect();
        cells.iter().map(|value| table[usize::from(value.cast_unsigned())]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const U: i8 = 205_u8.cast_signed();
    const F: i8 = 254_u8.cast_signed();

    #[track_caller]
    fn assert_read(cells: &[i8], values: ByteValues, expected: &[i8]) {
        assert_eq!(ByteValues::of(cells), Some(values));
        assert_eq!(values.read(cells), expected);
    }

    #[test]
    fn cells_of_an_occupancy_grid_are_in_range() {
        assert_eq!(ByteValues::of(&[-1, 0, 1, 50, 100]), None);
        assert_eq!(ByteValues::of(&[]), None);
    }

    #[test]
    fn the_pixels_of_a_map_image_are_known_by_their_unknown_ones() {
        let pixels = ByteValues::Pixels { inverted: false };
        assert_read(&[U, U, F, F, 0, F], pixels, &[-1, -1, 0, 0, 100, 0]);
        assert_read(&[U, U, -1, -1, 0], pixels, &[-1, -1, 0, 0, 100]);
        assert_read(&[F, F, 0], pixels, &[0, 0, 100]);
        assert_read(&[U, -1, 0, 0], ByteValues::Pixels { inverted: true }, &[-1, 100, 0, 0]);
    }

    #[test]
    fn the_costs_of_a_costmap_are_read_as_nav2_publishes_them() {
        let costs = [0, 0, 1, 126, 252_u8.cast_signed(), 253_u8.cast_signed(), F, -1];
        assert_read(&costs, ByteValues::Costs, &[0, 0, 1, 49, 98, 99, 100, -1]);
    }

    #[test]
    fn other_values_out_of_range_are_unknown() {
        assert_read(&[0, 100, -1, -128, 120, U, -5], ByteValues::OutOfRange, &[0, 100, -1, -1, -1, -1, -1]);
    }
}
