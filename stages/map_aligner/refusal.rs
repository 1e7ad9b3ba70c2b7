//! Why maps cannot be aligned.

/// Why there is no first guess for two maps. The texts are for the people who run the robots.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SearchRefusal {
    /// A map without walls.
    #[error("the map of {robot} has no walls")]
    NoWalls {
        /// Whose.
        robot: String,
    },
    /// A map that would take too much time and memory.
    #[error("the known part of the map of {robot} is longer than {most:.0} m, which is the most that is searched")]
    TooLarge {
        /// Whose.
        robot: String,
        /// What is allowed, metres.
        most: f64,
    },
    /// No place speaks for itself.
    #[error("the maps fit nowhere: wherever walls lie on walls, as many lie on free space of the other map")]
    NoFit,
    /// Too little in common.
    #[error(
        "the maps have too little in common: at the best place they agree on {length:.0} m of wall, and at least \
         {least:.0} m are needed"
    )]
    TooLittleInCommon {
        /// Metres of wall on which the maps agree.
        length: f64,
        /// What is asked for, metres.
        least: f64,
    },
}
