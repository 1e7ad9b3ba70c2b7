//! Why a robot has no map, or only a part of one, and what would mend it.

use super::slam_map::{BadScans, LossCause, ScanFault};
use crate::shared::geometry::wrap_angle;

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

/// That the ways of a robot are `scale` times as long as by its odometry.
pub(super) fn wrong_scale(name: &str, scale: f64, outcome: &str) -> String {
    let (percent, size) = (100.0 * (1.0 / scale - 1.0), if scale < 1.0 { "long" } else { "short" });
    format!(
        "the odometry of {name} is {:.0} % too {size} by its scans, {outcome}: are its wheels as large as its driver takes them to \
         be?",
        percent.abs()
    )
}

/// That the ways of a robot by its scans are turned against those by odometry, with the yaw of its lidar as it is given, radians.
pub(super) fn turned_lidar(name: &str, turn: f64, yaw: f64) -> String {
    let side = if turn < 0.0 { "right" } else { "left" };
    format!(
        "{name} moves {:.0} degrees farther to the {side} by its scans than by its odometry, as if its lidar were mounted with another \
         yaw: its poses, and the frame of its map, are turned by that. Log the mount on /tf_static, or give it: \
         --lidar {name}=X,Y,{:.3}",
        turn.to_degrees().abs(),
        wrap_angle(yaw - turn)
    )
}

/// Where a robot has lost its way, so many seconds after its first scan.
pub(super) fn lost_way(name: &str, seconds: f64, cause: LossCause) -> String {
    let (why, cure) = match cause {
        LossCause::Pause(pause) => (
            format!("nothing shows how it moved in the {pause:.1} s before, and its scans lie on no earlier ones"),
            format!("{CUT_THERE}, with --initial"),
        ),
        LossCause::ScanGap { seconds, deviation } => (
            format!(
                "it has no scans with odometry of the {seconds:.1} s before, in which odometry may be {deviation:.1} m off (standard \
                 deviation), and neither its scan there nor all later ones show beyond doubt where it is"
            ),
            format!("{CUT_THERE}, with --initial"),
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

/// Where a robot has lost its way so far, so many seconds after its first scan.
pub(super) fn lost_way_so_far(name: &str, seconds: f64) -> String {
    format!(
        "{name} has lost its way {seconds:.1} s after its first scan. Its map stays as it is until the end: then what it sees from there \
         on is merged with it, if both fit"
    )
}

/// Why scans are not in a map.
pub(super) const TOO_LARGE: &str =
    "its map would get too large. For a larger one with larger cells give --set mapper.resolution=METRES";

pub(super) fn too_large(name: &str) -> String {
    format!("scans of {name} were left out: {TOO_LARGE}")
}
