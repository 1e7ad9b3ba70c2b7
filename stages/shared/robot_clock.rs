//! The times of a robot's messages on one clock that never goes back.

use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::Time;
use std::collections::BTreeMap;

/// The longest time by which consecutive stamps of one kind of message lie out of order, seconds: a greater one is a
/// leap of the clock. Poses are kept for as long.
const LONGEST_DISORDER: f64 = 10.0;
/// The longest time for which a program holds messages back, seconds: the stamps of two kinds of messages that are
/// further apart are of two clocks. Poses that are found when a drive has ended come as late as the drive was long.
const LONGEST_DELAY: f64 = 86_400.0;
/// The fastest clock of a simulation or a replay, in multiples of the clock that the log times are of.
const FASTEST_CLOCK: f64 = 10.0;

/// Assigns times to a robot's messages by their stamps.
///
/// Usually the time of a message is its stamp. A clock that leaps (a simulation starts again, one message has a stamp
/// of the future, a stamp is of another clock) goes on here as the log times do. A message without a stamp takes the
/// time that has passed in the log since the last one with a stamp; before any other, its log time, and the stamps that
/// follow are put on the clock of the log if they are of another one.
#[derive(Clone, Debug, Default)]
pub struct RobotClock {
    /// The last message of each kind.
    last: BTreeMap<&'static str, Reading>,
    /// The last message with a stamp, or else the first one.
    latest: Option<Reading>,
}

/// A message with its time.
#[derive(Clone, Copy, Debug)]
struct Reading {
    time: LogTime,
    log_time: LogTime,
    /// What was added to the stamp, nanoseconds.
    shift: i128,
    /// Whether it has a stamp.
    is_stamped: bool,
}

impl Reading {
    /// The time of a message with this log time, if the clock has gone on as the log did.
    fn expected(&self, log_time: LogTime) -> LogTime {
        LogTime(later(self.time, i128::from(log_time.0) - i128::from(self.log_time.0)))
    }

    /// Whether `time` follows this message without a leap.
    fn is_followed_by(&self, time: LogTime, log_time: LogTime) -> bool {
        let passed = log_time.seconds_since(self.log_time);
        // Messages that were held back come together, and the log times do not show the time between them.
        let longest = if passed > 0.0 { LONGEST_DISORDER + FASTEST_CLOCK * passed } else { LONGEST_DELAY };
        (-LONGEST_DISORDER..=longest).contains(&time.seconds_since(self.time))
    }
}

/// A time shifted by nanoseconds.
fn later(time: LogTime, shift: i128) -> u64 {
    u64::try_from((i128::from(time.0) + shift).max(0)).unwrap_or(u64::MAX)
}

/// The clock of a robot has leapt, or its messages are stamped by several clocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Leap;

impl Leap {
    /// The warning of a leap in the stamps of the robot `name`.
    pub fn warning(self, name: &str) -> String {
        format!(
            "the stamps of {name} leap, as its clock started again, or some are of another clock: from there on its messages are \
             put in order by their log times"
        )
    }
}

impl RobotClock {
    /// The time of a message of the kind `kind`, and whether the clock has leapt there.
    pub fn time(&mut self, kind: &'static str, stamp: Time, log_time: LogTime) -> (LogTime, Option<Leap>) {
        let stamp = LogTime::from(stamp);
        if stamp == LogTime::MIN {
            let Some(latest) = self.latest else {
                let reading = Reading { time: log_time, log_time, shift: 0, is_stamped: false };
                self.last.insert(kind, reading);
                self.latest = Some(reading);
                return (log_time, None);
            };
            return (latest.expected(log_time), None);
        }
        let shifted = |shift: i128| LogTime(later(stamp, shift));
        let known = self.last.get(kind).copied();
        let others = || self.last.values().map(|other| other.shift);
        let shifts = std::iter::once(0).chain(known.iter().map(|last| last.shift)).chain(others());
        let fits = |shift: &i128| match (&known, &self.latest) {
            (Some(last), _) => last.is_followed_by(shifted(*shift), log_time),
            // By the first message of a kind, only another clock can be detected.
            (None, Some(latest)) => {
                let most = if latest.is_stamped { LONGEST_DELAY } else { LONGEST_DISORDER };
                shifted(*shift).seconds_since(latest.expected(log_time)).abs() <= most
            }
            (None, None) => true,
        };
        let reference = known.or(self.latest);
        let (shift, leap) = match { shifts }.find(fits) {
            Some(shift) => (shift, None),
            None => {
                let expected = reference.map_or(log_time, |reference| reference.expected(log_time));
                (i128::from(expected.0) - i128::from(stamp.0), Some(Leap))
            }
        };
        let reading = Reading { time: shifted(shift), log_time, shift, is_stamped: true };
        self.last.insert(kind, reading);
        self.latest = Some(reading);
        (reading.time, leap)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> LogTime {
        LogTime::MIN.plus_seconds(seconds)
    }

    /// The times of messages with these kinds, stamps and log times, seconds, and how often the clock has leapt.
    fn times(messages: &[(&'static str, f64, f64)]) -> (Vec<f64>, usize) {
        let mut clock = RobotClock::default();
        let mut leaps = 0;
        let time = |(kind, stamp, log_time): &(&'static str, f64, f64)| {
            let (time, leap) = clock.time(kind, at(*stamp).into(), at(*log_time));
            leaps += usize::from(leap.is_some());
            (time.seconds() * 1e3).round() / 1e3
        };
        (messages.iter().map(time).collect(), leaps)
    }

    #[test]
    fn a_message_has_the_time_of_its_stamp() {
        let messages = [("pose", 5.0, 105.0), ("scan", 4.0, 105.1), ("pose", 5.5, 105.2), ("pose", 5.4, 160.0)];
        assert_eq!(times(&messages), (vec![5.0, 4.0, 5.5, 5.4], 0));
    }

    #[test]
    fn a_message_without_a_stamp_is_on_the_clock_of_the_others() {
        assert_eq!(times(&[("pose", 0.0, 105.0)]), (vec![105.0], 0));
        let messages = [("pose", 5.0, 105.0), ("scan", 0.0, 106.0), ("pose", 0.0, 107.0), ("pose", 8.0, 108.0)];
        assert_eq!(times(&messages), (vec![5.0, 6.0, 7.0, 8.0], 0));
    }

    #[test]
    fn a_first_message_without_a_stamp_does_not_make_the_others_late() {
        // A node has sent before the clock of the simulation ran.
        let simulated = [("odometry", 0.0, 1e9), ("odometry", 50.0, 1e9 + 0.5), ("scan", 50.1, 1e9 + 0.6)];
        assert_eq!(times(&simulated), (vec![1e9, 1e9 + 0.5, 1e9 + 0.6], 1));
        let other_kind = [("odometry", 0.0, 1e9), ("scan", 50.0, 1e9 + 0.5), ("odometry", 50.1, 1e9 + 0.6)];
        assert_eq!(times(&other_kind), (vec![1e9, 1e9 + 0.5, 1e9 + 0.6], 1));
        let same_clock = [("odometry", 0.0, 1e9), ("scan", 1e9 + 0.4, 1e9 + 0.5), ("odometry", 1e9 + 0.6, 1e9 + 0.6)];
        assert_eq!(times(&same_clock), (vec![1e9, 1e9 + 0.4, 1e9 + 0.6], 0));
    }

    #[test]
    fn one_stamp_of_the_future_changes_nothing_for_the_others() {
        let messages = [("pose", 5.0, 105.0), ("pose", 1e6, 105.5), ("pose", 6.0, 106.0), ("scan", 6.0, 106.0)];
        assert_eq!(times(&messages), (vec![5.0, 5.5, 6.0, 6.0], 1));
    }

    #[test]
    fn a_clock_that_starts_again_goes_on_for_all_kinds_of_messages_alike() {
        let before = [("pose", 50.0, 150.0), ("scan", 50.1, 150.2)];
        let after = [("pose", 0.5, 152.0), ("scan", 0.6, 152.3), ("pose", 1.5, 153.0), ("scan", 1.6, 153.1)];
        let (found, leaps) = times(&[before, [after[0], after[1]], [after[2], after[3]]].concat());
        assert_eq!((found, leaps), (vec![50.0, 50.1, 52.0, 52.1, 53.0, 53.1], 1));
    }

    #[test]
    fn stamps_of_two_clocks_are_put_on_one() {
        let messages = [("pose", 1e9, 1e9), ("scan", 3.0, 1e9 + 0.1), ("pose", 1e9 + 1.0, 1e9 + 1.0)];
        let (found, leaps) = times(&[&messages[..], &[("scan", 4.0, 1e9 + 1.1)]].concat());
        assert_eq!((found, leaps), (vec![1e9, 1e9 + 0.1, 1e9 + 1.0, 1e9 + 1.1], 1));
    }

    #[test]
    fn readings_that_come_late_keep_their_time_and_a_gap_is_no_leap() {
        let late = [("pose", 100.0, 1100.0), ("tag", 40.0, 1100.0), ("pose", 101.0, 1101.0), ("tag", 41.0, 1101.0)];
        assert_eq!(times(&late), (vec![100.0, 40.0, 101.0, 41.0], 0));
        let gap = [("pose", 100.0, 1100.0), ("pose", 700.0, 1700.0), ("pose", 701.0, 9000.0)];
        assert_eq!(times(&gap), (vec![100.0, 700.0, 701.0], 0));
        let together = [("tag", 900.0, 1900.0), ("pose", 100.0, 2000.0), ("pose", 200.0, 2000.0)];
        assert_eq!(times(&together), (vec![900.0, 100.0, 200.0], 0), "found at the end of a drive");
    }

    #[test]
    fn any_stamps_and_log_times_give_a_time() {
        let extremes = [0, 1, u64::MAX / 2, u64::MAX - 1, u64::MAX].map(LogTime);
        let mut clock = RobotClock::default();
        for stamp in extremes {
            for log_time in extremes {
                for kind in ["pose", "scan"] {
                    clock.time(kind, stamp.into(), log_time);
                }
            }
        }
    }
}
