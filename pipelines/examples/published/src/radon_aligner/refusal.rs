//! Why maps cannot be aligned.

/// Why two maps are not aligned. The texts are for the user.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RadonRefusal {
    /// A map without walls.
    #[error("the map of {robot} has no walls")]
    NoWalls {
        /// Name of the robot.
        robot: String,
    },
    /// A map that would take too much time and memory.
    #[error("the walls of the map of {robot} extend over more than {most:.0} m (max_extent)")]
    TooLarge {
        /// Name of the robot.
        robot: String,
        /// Largest extent allowed, metres.
        most: f64,
    },
    /// The directions do not fit.
    #[error(
        "the walls of the maps do not run in the same directions\nmissing: a correlation of {least:.2} (min_correlation) instead \
         of {correlation:.2}\ntry: let one robot drive where the other was, along straight walls"
    )]
    NoRotation {
        /// The correlation of the energies.
        correlation: f64,
        /// Least correlation required.
        least: f64,
    },
    /// No pose with enough in common.
    #[error(
        "at no pose that was tried do the maps have {percent:.0} % of the smaller one in common (min_overlap)\ntry: let one \
         robot drive where the other was"
    )]
    NoOverlap {
        /// Least share required, percent.
        percent: f64,
    },
    /// They disagree at the best pose.
    #[error(
        "the maps agree on {similarity:.2} of what they have in common at the best of four rotations\nmissing: {least:.2} \
         (min_similarity)\ntry: let one robot drive where the other was"
    )]
    Dissimilar {
        /// The acceptance index.
        similarity: f64,
        /// Least index required.
        least: f64,
    },
}
