//! Why a translation cannot be told.

/// Why no translation is taken. The texts are for the people who run the robots.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MatchRefusal {
    /// Too few edges agree.
    #[error(
        "at the best translation {found} edges of the topological maps agree\nmissing: {least} (min_edges)\ntry: drive one robot on \
         where the other was"
    )]
    TooFewEdges {
        /// Edges of the map with fewer of them.
        found: usize,
        /// What is asked for.
        least: usize,
    },
    /// Another translation is nearly as good.
    #[error(
        "the edges of the topological maps fit elsewhere nearly as well: another translation gathers {percent:.0} % of the votes of \
         the best\nmissing: at most {most:.0} % (max_runner_up)\ntry: drive one robot on where the other was"
    )]
    Ambiguous {
        /// Of the votes of the best one, percent.
        percent: f64,
        /// What is allowed, percent.
        most: f64,
    },
}
