//! Gathers the hypotheses of one stage for one pair of robots from single messages.

use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::Alignment;
use std::collections::BTreeMap;

/// Source of hypotheses, and the pair of robots.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Origin {
    /// The pair.
    pub pair: RobotPair,
    /// The source, see [`Alignment::source`].
    pub source: String,
}

impl Origin {
    /// Origin of an alignment.
    pub fn of(alignment: &Alignment) -> Self {
        Self { pair: RobotPair::of(alignment), source: alignment.source.clone() }
    }
}

/// Whether the covariance of an alignment is the width of the peak, within which the maps fit about as well, as that
/// of `map_aligner` is. The covariance of other methods is that of the error.
pub fn has_covariance_of_fit(alignment: &Alignment) -> bool {
    alignment.hypotheses > 0 && alignment.source == "maps" && alignment.method == "maps"
}

/// Collects hypotheses until the last one of a source has arrived. They are judged against each other, so an
/// incomplete list would make the others too probable.
#[derive(Debug, Default)]
pub struct HypothesisGatherer {
    begun: BTreeMap<Origin, Vec<Alignment>>,
}

impl HypothesisGatherer {
    /// Adds a hypothesis. Returns all of its source for the pair, by rank, once the last has arrived.
    ///
    /// # Errors
    /// A rank that does not follow the one before; the incomplete list is discarded.
    pub fn add(&mut self, alignment: Alignment) -> Result<Option<(Origin, Vec<Alignment>)>, HypothesisMissing> {
        let (rank, count, origin) = (alignment.rank as usize, alignment.hypotheses as usize, Origin::of(&alignment));
        let mut gathered = self.begun.remove(&origin).filter(|_| rank > 0).unwrap_or_default();
        if gathered.len() != rank {
            return Err(HypothesisMissing { origin, missing: gathered.len(), came: rank });
        }
        gathered.push(alignment);
        if gathered.len() >= count {
            return Ok(Some((origin, gathered)));
        }
        self.begun.insert(origin, gathered);
        Ok(None)
    }
}

/// Hypotheses arrived out of order.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the hypotheses of {} and {} by the {} were left out: rank {missing} is missing, rank {came} arrived",
    origin.pair.a, origin.pair.b, origin.source
)]
pub struct HypothesisMissing {
    /// Origin of the hypotheses.
    pub origin: Origin,
    /// The expected rank.
    pub missing: usize,
    /// The rank that arrived.
    pub came: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hypothesis(source: &str, rank: u32, hypotheses: u32) -> Alignment {
        Alignment { a: "a".into(), b: "b".into(), source: source.into(), rank, hypotheses, ..Default::default() }
    }

    #[test]
    fn hypotheses_are_returned_when_the_last_has_arrived() {
        let mut gatherer = HypothesisGatherer::default();
        assert_eq!(gatherer.add(hypothesis("maps", 0, 3)), Ok(None));
        assert_eq!(gatherer.add(hypothesis("maps", 1, 3)), Ok(None));
        let (_, alone) = gatherer.add(hypothesis("tags", 0, 0)).unwrap().unwrap();
        assert_eq!(alone.len(), 1, "sources are independent");
        let (origin, all) = gatherer.add(hypothesis("maps", 2, 3)).unwrap().unwrap();
        assert_eq!((origin.source.as_str(), all.len()), ("maps", 3));
        assert!(all.iter().enumerate().all(|(rank, one)| one.rank as usize == rank));
        assert_eq!(origin.pair, RobotPair::new("a", "b"));
    }

    #[test]
    fn rank_0_starts_a_new_list() {
        let mut gatherer = HypothesisGatherer::default();
        gatherer.add(hypothesis("maps", 0, 3)).unwrap();
        gatherer.add(hypothesis("maps", 0, 2)).unwrap();
        assert_eq!(gatherer.add(hypothesis("maps", 1, 2)).unwrap().unwrap().1.len(), 2);
    }

    #[test]
    fn a_rank_out_of_order_is_an_error() {
        let mut gatherer = HypothesisGatherer::default();
        let error = gatherer.add(hypothesis("maps", 1, 2)).unwrap_err();
        assert!(error.to_string().contains("rank 0 is missing, rank 1 arrived"), "{error}");
        gatherer.add(hypothesis("maps", 0, 3)).unwrap();
        assert!(gatherer.add(hypothesis("maps", 2, 3)).is_err());
        assert!(gatherer.add(hypothesis("maps", 1, 3)).is_err(), "the incomplete list is discarded");
    }
}
