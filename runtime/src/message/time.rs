//! The time line of a log.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A moment on the time line of a log, in nanoseconds since the epoch that the log uses (mostly the Unix epoch).
///
/// It orders a whole replay. No stage reads a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ZeroCopySend)]
#[repr(C)]
pub struct LogTime(pub u64);

impl LogTime {
    /// Before everything.
    pub const MIN: Self = Self(0);
    /// After everything.
    pub const MAX: Self = Self(u64::MAX);

    /// Seconds since the epoch of the log. Below a microsecond the value is rounded.
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Seconds from `earlier` to this moment; negative if this moment is the earlier one.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        (i128::from(self.0) - i128::from(earlier.0)) as f64 * 1e-9
    }

    /// This moment and `seconds` more, held within the time line.
    pub fn plus_seconds(self, seconds: f64) -> Self {
        let nanoseconds = i128::from(self.0).saturating_add((seconds * 1e9) as i128);
        Self(nanoseconds.clamp(0, u64::MAX as i128) as u64)
    }
}

impl fmt::Display for LogTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{:09}", self.0 / 1_000_000_000, self.0 % 1_000_000_000)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_moment_and_any_number_of_seconds_is_on_the_time_line() {
        assert_eq!(LogTime(5).plus_seconds(1.5), LogTime(1_500_000_005));
        assert_eq!(LogTime(2_000_000_000).plus_seconds(-1.5), LogTime(500_000_000));
        for (seconds, expected) in
            [(1e300, LogTime::MAX), (f64::INFINITY, LogTime::MAX), (-1e300, LogTime::MIN), (f64::NAN, LogTime(7))]
        {
            assert_eq!(LogTime(7).plus_seconds(seconds), expected, "{seconds}");
        }
    }
}
