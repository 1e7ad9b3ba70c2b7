//! Histograms of durations, of constant size.

/// The number of buckets.
pub(super) const BUCKETS: usize = 96;
/// The number of buckets per doubling of the duration.
const PER_OCTAVE: f64 = 4.0;
/// The upper limit of the first bucket, nanoseconds.
const FIRST: f64 = 1_000.0;

/// Counts of durations: four buckets per doubling, from a microsecond to about ten seconds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Histogram {
    counts: [u64; BUCKETS],
}

impl Histogram {
    /// The bucket of a duration.
    pub fn bucket(nanoseconds: u64) -> usize {
        let octaves = (nanoseconds.max(1) as f64 / FIRST).log2();
        ((octaves * PER_OCTAVE).floor().max(-1.0) as i64 + 1).clamp(0, BUCKETS as i64 - 1) as usize
    }

    /// A histogram with the given counts by bucket.
    pub fn from_counts(counts: [u64; BUCKETS]) -> Self {
        Self { counts }
    }

    /// The number of counted durations.
    pub fn count(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// The quantile of the durations at `share` (0 to 1), seconds, rounded up to the limit of its bucket. None if the
    /// histogram is empty.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let rank = ((self.count() as f64 * share).ceil() as u64).max(1);
        let mut before = 0;
        let bucket = self.counts.iter().position(|count| {
            before += count;
            before >= rank
        })?;
        Some(FIRST * 1e-9 * (bucket as f64 / PER_OCTAVE).exp2())
    }

    /// The difference to an earlier state of the same histogram.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self { counts: std::array::from_fn(|bucket| self.counts[bucket].saturating_sub(earlier.counts[bucket])) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_is_at_most_a_bucket_too_high() {
        let mut counts = [0; BUCKETS];
        (1..=1000u64).for_each(|time| counts[Histogram::bucket(time * 10_000)] += 1);
        let histogram = Histogram::from_counts(counts);
        for (share, exact) in [(0.5, 5e-3), (0.95, 9.5e-3), (0.99, 9.9e-3), (0.001, 1e-5)] {
            let found = histogram.quantile(share).unwrap();
            assert!(found >= exact && found <= exact * 1.2, "{share}: {found} for {exact}");
        }
        assert_eq!(histogram.since(&histogram).quantile(0.5), None);
    }

    #[test]
    fn every_duration_has_a_bucket() {
        assert_eq!((Histogram::bucket(0), Histogram::bucket(999)), (0, 0));
        assert_eq!(Histogram::bucket(1_000), 1);
        assert_eq!(Histogram::bucket(u64::MAX), BUCKETS - 1);
    }
}
