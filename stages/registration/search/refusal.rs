//! Why maps cannot be aligned.

use crate::shared::number_text::beside_bound;

/// Why there is no hypothesis for two maps. The texts are for the user.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SearchRefusal {
    /// A map without walls.
    #[error("the map of {robot} has no walls")]
    NoWalls {
        /// Name of the robot.
        robot: String,
    },
    /// A map with walls, all other cells of which are unknown.
    #[error(
        "the map of {robot} has walls and no free space\ntry: let its SLAM mark what its beams have passed as free (RTAB-Map: \
         Grid/RayTracing), or give a map file whose ground is free, not a grey \
         between `free_thresh` and `occupied_thresh`\n\nwalls are compared from the side of the free space"
    )]
    NoFreeSpace {
        /// Name of the robot.
        robot: String,
    },
    /// A map that would take too much time and memory.
    #[error("the known part of the map of {robot} is longer than {most:.0} m (max_extent of map_aligner)")]
    TooLarge {
        /// Name of the robot.
        robot: String,
        /// Largest extent allowed, metres.
        most: f64,
    },
    /// No pose has a positive score.
    #[error(
        "the maps fit nowhere\ntry: let one robot drive where the other was, or let both see one tag\n\nat every pose at which \
         walls agree, at least as many walls are on free space of the other map"
    )]
    NoFit,
    /// No pose that the initial poses allow has a positive score.
    #[error(
        "the maps fit nowhere near the initial poses\ntry: are the poses right? --initial ROBOT=X,Y,YAW,STDDEV widens them\n\n\
         at every pose there at which walls agree, at least as many walls are on free space of the other map"
    )]
    NoFitInWindow,
    /// Too little wall in common.
    #[error(
        "the maps have too little in common: {} m of wall agree at the best pose\nmissing: at least {} m of wall \
         (min_wall_length)\ntry: let one robot drive where the other was, or let both see one tag",
        beside_bound(*length, *least, 0)[0], beside_bound(*length, *least, 0)[1]
    )]
    TooLittleInCommon {
        /// Inlier length, metres.
        length: f64,
        /// Least inlier length required, metres.
        least: f64,
    },
}
