//! The log time.

use iceoryx2::prelude::ZeroCopySend;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A log time, nanoseconds since the epoch of the log (usually the Unix epoch).
///
/// A replay is ordered by it. No stage reads a clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ZeroCopySend)]
#[repr(C)]
pub struct LogTime(pub u64);

impl LogTime {
    /// The earliest log time.
    pub const MIN: Self = Self(0);
    /// The latest log time.
    pub const MAX: Self = Self(u64::MAX);

    /// Seconds since the epoch of the log, rounded to about a microsecond.
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// Seconds from `earlier` to this time; negative if this time is the earlier one.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        (i128::from(self.0) - i128::from(earlier.0)) as f64 * 1e-9
    }

    /// This time plus `seconds`, clamped to the range of log times.
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
    fn adding_seconds_is_clamped_to_the_range() {
        assert_eq!(LogTime(5).plus_seconds(1.5), LogTime(1_500_000_005));
        assert_eq!(LogTime(2_000_000_000).plus_seconds(-1.5), LogTime(500_000_000));
        for (seconds, expected) in
            [(1e300, LogTime::MAX), (f64::INFINITY, LogTime::MAX), (-1e300, LogTime::MIN), (f64::NAN, LogTime(7))]
        {
            assert_eq!(LogTime(7).plus_seconds(seconds), expected, "{seconds}");
        }
    }
}
