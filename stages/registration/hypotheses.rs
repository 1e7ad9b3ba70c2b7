//! The hypotheses that one stage has for one pair of robots, gathered from the messages that they come in.

use crate::shared::robot_pair::RobotPair;
use gridweave_runtime::ros::Alignment;
use std::collections::BTreeMap;

/// Whose hypotheses they are, and of which pair of robots.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Origin {
    /// The pair.
    pub pair: RobotPair,
    /// What they were found from, see [`Alignment::source`].
    pub source: String,
}

impl Origin {
    /// Of an alignment.
    pub fn of(alignment: &Alignment) -> Self {
        Self { pair: RobotPair::of(alignment), source: alignment.source.clone() }
    }
}

/// Whether the covariance of an alignment tells how far two maps fit about as well, as that of `map_aligner` does; that of other methods
/// is for how far off they are.
pub fn has_covariance_of_fit(alignment: &Alignment) -> bool {
    alignment.hypotheses > 0 && alignment.source == "maps" && alignment.method == "maps"
}

/// Gathers hypotheses until all that belong together have come: they are judged against each other, and one without the
/// others would be believed too easily.
#[derive(Debug, Default)]
pub struct HypothesisGatherer {
    begun: BTreeMap<Origin, Vec<Alignment>>,
}

impl HypothesisGatherer {
    /// Takes a hypothesis. Gives all of its stage for the pair, by rank, once the last has come. A rank that does not
    /// follow the one before is an error, and what has come is forgotten.
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

/// Hypotheses came out of order.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the hypotheses for {} and {} by the {} were left out: number {missing} was due, and {came} came",
    origin.pair.a, origin.pair.b, origin.source
)]
pub struct HypothesisMissing {
    /// Whose they are.
    pub origin: Origin,
    /// The rank that should have come.
    pub missing: usize,
    /// The rank that came.
    pub came: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hypothesis(source: &str, rank: u32, hypotheses: u32) -> Alignment {
        Alignment { a: "a".into(), b: "b".into(), source: source.into(), rank, hypotheses, ..Default::default() }
    }

    #[test]
    fn hypotheses_come_together_when_the_last_is_there() {
        let mut gatherer = HypothesisGatherer::default();
        assert_eq!(gatherer.add(hypothesis("maps", 0, 3)), Ok(None));
        assert_eq!(gatherer.add(hypothesis("maps", 1, 3)), Ok(None));
        let (_, alone) = gatherer.add(hypothesis("tags", 0, 0)).unwrap().unwrap();
        assert_eq!(alone.len(), 1, "another stage's are another matter");
        let (origin, all) = gatherer.add(hypothesis("maps", 2, 3)).unwrap().unwrap();
        assert_eq!((origin.source.as_str(), all.len()), ("maps", 3));
        assert!(all.iter().enumerate().all(|(rank, one)| one.rank as usize == rank));
        assert_eq!(origin.pair, RobotPair::new("a", "b"));
    }

    #[test]
    fn the_first_rank_begins_anew() {
        let mut gatherer = HypothesisGatherer::default();
        gatherer.add(hypothesis("maps", 0, 3)).unwrap();
        gatherer.add(hypothesis("maps", 0, 2)).unwrap();
        assert_eq!(gatherer.add(hypothesis("maps", 1, 2)).unwrap().unwrap().1.len(), 2);
    }

    #[test]
    fn a_rank_out_of_order_is_an_error() {
        let mut gatherer = HypothesisGatherer::default();
        let error = gatherer.add(hypothesis("maps", 1, 2)).unwrap_err();
        assert!(error.to_string().contains("number 0 was due, and 1 came"), "{error}");
        gatherer.add(hypothesis("maps", 0, 3)).unwrap();
        assert!(gatherer.add(hypothesis("maps", 2, 3)).is_err());
        assert!(gatherer.add(hypothesis("maps", 1, 3)).is_err(), "what has come is forgotten");
    }
}
