//! The clocks of two machines.

use std::time::{SystemTime, UNIX_EPOCH};

/// The system clock, nanoseconds since the Unix epoch. It is only read where messages come from or go to other
/// programs.
pub fn nanoseconds_now() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// The clock of a machine.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clock {
    /// The offset to the system clock, nanoseconds: for tests, which run on one machine.
    pub(super) ahead: i64,
}

impl Clock {
    /// Nanoseconds since the Unix epoch. It is read only at the two ends of a bridge.
    pub(super) fn nanoseconds(self) -> i64 {
        nanoseconds_now().saturating_add(self.ahead)
    }
}

/// The clock offset of the receiver, nanoseconds, as in the Network Time Protocol (RFC 5905, section 8): from the times
/// at which the sender sent the request and received the answer, by its clock, and at which the receiver received and
/// answered it, by the receiver's clock. Its error is at most half of the round-trip time; it is 0 if the clocks may
/// agree within this error, as a packet that is sent again takes seconds one way and none the other.
pub(super) fn offset(sent: i64, came: i64, answered: i64, received: i64) -> i64 {
    let there = i128::from(came) - i128::from(sent);
    let back = i128::from(answered) - i128::from(received);
    // The true offset is between `back` and `there`, as neither way takes less than no time.
    if back <= 0 && 0 <= there {
        return 0;
    }
    i64::try_from((there + back) / 2).unwrap_or(if there + back < 0 { i64::MIN } else { i64::MAX })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_offset_is_the_difference_of_the_clocks() {
        const HOUR: i64 = 3_600_000_000_000;
        // 30 there, 10 in between, 50 back.
        assert_eq!(offset(1000, 1030 + HOUR, 1040 + HOUR, 1090), HOUR - 10);
        assert_eq!(offset(1000 + HOUR, 1030, 1040, 1070 + HOUR), -HOUR);
        assert_eq!(offset(i64::MIN, i64::MAX, i64::MAX, i64::MIN), i64::MAX);
    }

    #[test]
    fn clocks_agree_if_the_round_trip_allows_it() {
        const SECOND: i64 = 1_000_000_000;
        // The request was lost twice, the answer came at once.
        assert_eq!(offset(0, 3 * SECOND, 3 * SECOND + 1, 3 * SECOND + 1000), 0);
        assert_eq!(offset(0, 1000, 1001, 3 * SECOND), 0);
        // An offset beyond that is one of the clocks.
        assert_eq!(offset(0, 3 * SECOND, 3 * SECOND, 2 * SECOND), 2 * SECOND);
    }
}
