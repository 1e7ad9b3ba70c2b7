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
    #[error(
        "the maps fit nowhere\ntry: drive one robot on where the other was, or one tag seen by both\n\nwherever walls lie on walls, \
         as many lie on free space of the other map"
    )]
    NoFit,
    /// No place speaks for itself of those that are possible.
    #[error(
        "the maps fit nowhere near the initial poses\ntry: are the poses right? --initial ROBOT=X,Y,YAW,STDDEV widens them\n\n\
         wherever walls lie on walls there, as many lie on free space of the other map"
    )]
    NoFitInWindow,
    /// Too little in common.
    #[error(
        "the maps have too little in common: {length:.0} m of wall agree at the best place\nmissing: {least:.0} m of wall \
         (min_wall_length)\ntry: drive one robot on where the other was, or one tag seen by both"
    )]
    TooLittleInCommon {
        /// Metres of wall on which the maps agree.
        length: f64,
        /// What is asked for, metres.
        least: f64,
    },
}
