//! Why no translation is found.

/// Why no translation is found. The texts are for the user.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MatchRefusal {
    /// Too few edges agree.
    #[error(
        "at the best translation {found} edges of the topological maps agree\nmissing: {least} (min_edges)\ntry: let one robot drive \
         where the other was"
    )]
    TooFewEdges {
        /// Number of edges, of the map with fewer of them.
        found: usize,
        /// Least number required.
        least: usize,
    },
    /// Another translation is nearly as good.
    #[error(
        "the edges of the topological maps fit elsewhere nearly as well: another translation gathers {percent:.0} % of the votes of \
         the best\nmissing: at most {most:.0} % (max_runner_up)\ntry: let one robot drive where the other was"
    )]
    Ambiguous {
        /// Its share of the votes of the best one, percent.
        percent: f64,
        /// Largest share allowed, percent.
        most: f64,
    },
}
