//! Why a robot has no map, or only a part of one, and what would mend it.

use super::slam_map::{BadScans, LossCause, ScanFault};

/// How to use what a robot saw before and after it lost its way.
const CUT_THERE: &str =
    "cut the log there (`gridweave filter` with --end and --start), and merge both parts as two robots";

/// Why a map is not trusted, because of scans of which the first is `since` seconds after the first of all.
pub(super) fn why_bad(bad: &BadScans, since: f64) -> String {
    let BadScans { count, scans, .. } = bad;
    match bad.fault {
        ScanFault::Unmatched => format!(
            "{count} of {scans} scans lie on none of its others, the first of them {since:.1} s after its first scan. Its odometry \
             or its scans may be wrong"
        ),
        ScanFault::Contradicting => format!(
            "{count} of {scans} scans that see walls again look through them, the first of them {since:.1} s after its first scan, as \
             where a map is bent or doubled. To use it, record better odometry, or {CUT_THERE}. To see the map, give \
             --set mapper.max_contradicting=1"
        ),
    }
}

/// Why the map of a robot would be mirrored.
pub(super) fn upside_down(name: &str) -> String {
    format!(
        "its scans turn against its odometry, as those of a lidar that is mounted upside down. Log its mount on /tf_static \
         with a roll of 180 degrees, or give it: --lidar {name}=X,Y,YAW,3.1416"
    )
}

/// Where a robot has lost its way, so many seconds after its first scan.
pub(super) fn lost_way(name: &str, seconds: f64, cause: LossCause) -> String {
    let (why, cure) = match cause {
        LossCause::Pause(pause) => (
            format!("nothing shows how it moved in the {pause:.1} s before, and its scans lie on no earlier ones"),
            CUT_THERE.to_owned(),
        ),
        LossCause::ScanGap { seconds, deviation } => (
            format!(
                "it has no scans with odometry of the {seconds:.1} s before, in which odometry may be {deviation:.1} m off (standard \
                 deviation), and its scan does not show where it is"
            ),
            CUT_THERE.to_owned(),
        ),
        LossCause::ParallelWalls => (
            "it has no odometry, and its scans do not show how it moved along walls that are bare and parallel"
                .to_owned(),
            format!("record its odometry, or {CUT_THERE}"),
        ),
    };
    format!(
        "{name} has lost its way {seconds:.1} s after its first scan: {why}. What it saw from there on is left out of its map. To use \
         it, {cure}"
    )
}

pub(super) fn too_large(name: &str) -> String {
    format!("scans of {name} were left out: its map would get too large")
}
