//! Why maps cannot be aligned.

/// Why two maps are not aligned. The texts are for the people who run the robots.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RadonRefusal {
    /// A map without walls.
    #[error("the map of {robot} has no walls")]
    NoWalls {
        /// Whose.
        robot: String,
    },
    /// A map that would take too much time and memory.
    #[error("the walls of the map of {robot} lie farther apart than {most:.0} m, which is the most that is searched")]
    TooLarge {
        /// Whose.
        robot: String,
        /// What is allowed, metres.
        most: f64,
    },
    /// The directions do not fit.
    #[error(
        "the walls of the maps do not run in the same directions\nmissing: a correlation of {least:.2} (min_correlation) instead \
         of {correlation:.2}\ntry: drive one robot on where the other was, along straight walls"
    )]
    NoRotation {
        /// The correlation of the energies.
        correlation: f64,
        /// What is asked for.
        least: f64,
    },
    /// No place with enough in common.
    #[error(
        "at no place that was tried do the maps have {percent:.0} % of the smaller one in common (min_overlap)\ntry: drive one \
         robot on where the other was"
    )]
    NoOverlap {
        /// What is asked for, percent.
        percent: f64,
    },
    /// They disagree at the best place.
    #[error(
        "the maps agree on {similarity:.2} of what they have in common at the best of four rotations\nmissing: {least:.2} \
         (min_similarity)\ntry: drive one robot on where the other was"
    )]
    Dissimilar {
        /// The acceptance index.
        similarity: f64,
        /// What is asked for.
        least: f64,
    },
}
