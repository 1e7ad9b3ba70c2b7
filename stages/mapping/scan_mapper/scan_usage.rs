//! Which scans and poses a robot has sent, and why none of its scans is in a map.

use super::ScanError;
use super::reasons::TOO_LARGE;
use gridweave_runtime::message::LogTime;

/// The first and the last time of something.
#[derive(Clone, Copy, Debug)]
struct Interval {
    first: LogTime,
    last: LogTime,
}

impl Interval {
    fn with(interval: Option<Self>, time: LogTime) -> Self {
        let Self { first, last } = interval.unwrap_or(Self { first: time, last: time });
        Self { first: first.min(time), last: last.max(time) }
    }
}

/// The scans of a robot, by whether they can be used, and the times of its poses.
#[derive(Debug, Default)]
pub(super) struct ScanUsage {
    count: usize,
    scans: Option<Interval>,
    /// Of poses in the map, or by odometry.
    poses: Option<Interval>,
    /// Number of scans that cannot be used, and why the first cannot.
    rejected: Option<(usize, ScanError)>,
    /// Whether a scan was left out, as the map would get too large.
    is_too_large: bool,
}

impl ScanUsage {
    /// Counts a scan.
    pub(super) fn add_scan(&mut self, time: LogTime) {
        self.count += 1;
        self.scans = Some(Interval::with(self.scans, time));
    }

    /// Counts a scan that cannot be used.
    pub(super) fn reject_scan(&mut self, problem: ScanError) {
        self.rejected.get_or_insert((0, problem)).0 += 1;
    }

    /// Counts a scan that was left out of the map, as that would get too large.
    pub(super) fn leave_out(&mut self) {
        self.is_too_large = true;
    }

    /// Counts a pose.
    pub(super) fn add_pose(&mut self, time: LogTime) {
        self.poses = Some(Interval::with(self.poses, time));
    }

    /// Number of its scans that can be used.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Time of the first of them.
    pub(super) fn first(&self) -> Option<LogTime> {
        Some(self.scans?.first)
    }

    /// Why none of its scans is in a map. `None` if it has sent none.
    pub(super) fn why_none(&self) -> Option<String> {
        let Some(scans) = self.scans else {
            return self.rejected.map(|(count, problem)| format!("none of its {count} scans can be used: {problem}"));
        };
        let why = match self.poses {
            _ if self.is_too_large => TOO_LARGE.to_owned(),
            Some(poses) if poses.last < scans.first => {
                let seconds = scans.first.seconds_since(poses.last);
                format!("its last pose is {seconds:.1} s before the first of them; are both stamped by one clock?")
            }
            Some(poses) if poses.first > scans.last => {
                let seconds = poses.first.seconds_since(scans.last);
                format!("its first pose is {seconds:.1} s after the last of them; are both stamped by one clock?")
            }
            Some(poses) if poses.first == poses.last => "all of its poses have one time".to_owned(),
            Some(_) if scans.first == scans.last => "all of them have one time, at which there is no pose".to_owned(),
            _ => "there is no pose of it for their times".to_owned(),
        };
        Some(format!("none of its {} scans is used: {why}", self.count))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Why no scan from 100 s to 110 s is used, with poses at these times.
    fn why(poses: &[u64], change: impl Fn(&mut ScanUsage)) -> String {
        let mut usage = ScanUsage::default();
        let at = |seconds: u64| LogTime(1_000_000_000 * seconds);
        (100..=110).for_each(|seconds| usage.add_scan(at(seconds)));
        poses.iter().for_each(|seconds| usage.add_pose(at(*seconds)));
        change(&mut usage);
        usage.why_none().unwrap()
    }

    #[test]
    fn each_cause_has_its_own_reason() {
        let nothing = |_: &mut ScanUsage| {};
        for (poses, reason) in [
            (&[20, 30, 25][..], "its last pose is 70.0 s before"),
            (&[3710, 3800], "its first pose is 3600.0 s after"),
            (&[105, 105], "all of its poses have one time"),
            (&[90, 120], "no pose of it for their times"),
            (&[], "no pose of it for their times"),
        ] {
            assert!(why(poses, nothing).contains(reason), "{}", why(poses, nothing));
        }
        assert!(why(&[90, 120], ScanUsage::leave_out).contains("its map would get too large"));
        let mut rejected = ScanUsage::default();
        assert_eq!(rejected.why_none(), None);
        rejected.reject_scan(ScanError::BackInTime);
        rejected.reject_scan(ScanError::NotFinite);
        assert_eq!(rejected.why_none().unwrap(), "none of its 2 scans can be used: time_increment is below 0");
    }
}
