//! The meaning of an occupancy grid's cell values: -1 unknown, 0 free to 100 occupied.
//!
//! The thresholds are those of nav2's map server, 65 % and 25 %. A value between them is known, but neither occupied
//! nor free; any other value counts as unknown.

/// The value of an unobserved cell.
pub const UNKNOWN: i8 = -1;
/// The least value of an occupied cell.
const OCCUPIED_FROM: i8 = 65;
/// A known cell with a value below this is free.
const FREE_BELOW: i8 = 25;
/// The greatest value of a known cell.
const MOST: i8 = 100;

/// Whether a cell value is known.
#[inline]
pub fn is_known(value: i8) -> bool {
    (0..=MOST).contains(&value)
}

/// Whether a cell value means occupied.
#[inline]
pub fn is_occupied(value: i8) -> bool {
    (OCCUPIED_FROM..=MOST).contains(&value)
}

/// Whether a cell value means free.
#[inline]
pub fn is_free(value: i8) -> bool {
    (0..FREE_BELOW).contains(&value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_is_unknown_free_undecided_or_occupied() {
        for value in i8::MIN..=i8::MAX {
            let expected = match value {
                0..=24 => (true, true, false),
                25..=64 => (true, false, false),
                65..=100 => (true, false, true),
                _ => (false, false, false),
            };
            assert_eq!((is_known(value), is_free(value), is_occupied(value)), expected, "{value}");
        }
        assert!(!is_known(UNKNOWN));
    }
}
