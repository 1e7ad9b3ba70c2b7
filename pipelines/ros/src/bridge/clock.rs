//! The clocks of two machines.

use crate::node::nanoseconds_now;

/// The clock of a machine.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// By how much it is ahead of what the system shows, nanoseconds: for tests, which have one machine.
    pub(super) ahead: i64,
}

impl Clock {
    /// Nanoseconds since the Unix epoch. It is read where a bridge begins and ends, and nowhere else.
    pub(super) fn nanoseconds(self) -> i64 {
        nanoseconds_now().saturating_add(self.ahead)
    }
}

/// By how much the clock of the receiver is ahead, nanoseconds, as in the Network Time Protocol (RFC 5905, section 8): from when
/// the sender asked and heard the answer, by its own clock, and when the receiver heard and answered, by that one's. It is wrong
/// by no more than half of what both ways took.
pub(super) fn offset(sent: i64, came: i64, answered: i64, received: i64) -> i64 {
    let there = i128::from(came) - i128::from(sent);
    let back = i128::from(answered) - i128::from(received);
    i64::try_from((there + back) / 2).unwrap_or(if there + back < 0 { i64::MIN } else { i64::MAX })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_offset_is_what_one_clock_shows_more_than_the_other() {
        const HOUR: i64 = 3_600_000_000_000;
        // 30 there, 10 in between, 50 back.
        assert_eq!(offset(1000, 1030 + HOUR, 1040 + HOUR, 1090), HOUR - 10);
        assert_eq!(offset(1000 + HOUR, 1030, 1040, 1070 + HOUR), -HOUR);
        assert_eq!(offset(i64::MIN, i64::MAX, i64::MAX, i64::MIN), i64::MAX);
    }
}
