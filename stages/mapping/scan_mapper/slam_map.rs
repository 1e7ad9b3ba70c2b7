//! The map of a robot that has odometry only, or nothing but scans: its poses are found by SLAM.

use super::{BaseBeam, ScanBeams, ScanMap, ScanMapperParameters};
use crate::mapping::slam::{Contradictions, LocatedScan, OdometryCorrection, ScanPoint, Trajectory, scan_points};
use crate::shared::geometry::{Point2, Pose2, pose, wrap_angle};
use crate::shared::scan_grid::SnapshotMap;
use gridweave_runtime::message::LogTime;

/// Largest share of the scans that may lie on no others, for a map to be drawn.
const MAX_UNMATCHED: f64 = 0.2;
/// How many times as many scans there are when a growing map is tested again: all of its scans are looked at each time, and
/// a long drive must not cost more and more.
const TESTED_AGAIN: f64 = 1.1;
/// Least number of scans before which a share says nothing.
const LEAST_SCANS: usize = 20;

/// A scan whose beams were all sent from one pose of the base.
struct StillScan {
    time: LogTime,
    /// Pose of the base by odometry.
    odometry: Pose2,
    transform_base_lidar: Pose2,
    beams: Vec<StillBeam>,
}

/// A beam, in single precision: all scans are kept.
#[derive(Clone, Copy)]
struct StillBeam {
    angle: f32,
    range: f32,
    is_hit: bool,
}

/// The scans of a robot with their poses, and the map that is drawn from them.
pub(super) struct SlamMap {
    trajectory: Trajectory,
    scans: Vec<StillScan>,
    map: ScanMap,
    /// Number of scans in the map.
    drawn: usize,
    /// Scans that are not in the map, as it would get too large, and were not reported yet.
    left_out: usize,
    first_unmatched: Option<LogTime>,
    lost_way: Option<LostWay>,
    max_contradicting: f64,
    /// The last test of the map, and of how many scans it was.
    tested: Option<(usize, Contradictions)>,
}

/// Where a robot has lost its way: how it moved from there on is not known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LostWay {
    pub(super) time: LogTime,
    pub(super) cause: LossCause,
}

/// Why a robot has lost its way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum LossCause {
    /// Nothing shows how it moved in a pause of so many seconds before, and its scans lie on no earlier ones.
    Pause(f64),
    /// Nothing but odometry shows how it moved in so many seconds without scans; its standard deviation is in metres.
    ScanGap { seconds: f64, deviation: f64 },
    /// It has no odometry, and its scans show walls of one direction only, as in a bare corridor.
    ParallelWalls,
}

/// A tag as it was seen.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TagSighting {
    pub(super) tag: String,
    /// Metres ahead of the base and to its left.
    pub(super) place: Point2,
    /// Standard deviation of the position, metres.
    pub(super) deviation: f64,
}

/// So many bad scans that there is no map of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BadScans {
    pub(super) fault: ScanFault,
    /// How many.
    pub(super) count: usize,
    /// Of how many.
    pub(super) scans: usize,
    /// Time of the first of them.
    pub(super) since: LogTime,
}

/// What is wrong with scans.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScanFault {
    /// They lie on no others.
    Unmatched,
    /// Their beams pass through walls that the robot saw at other times.
    Contradicting,
}

impl SlamMap {
    pub(super) fn new(parameters: &ScanMapperParameters) -> Self {
        Self {
            trajectory: Trajectory::new(parameters.odometry_deviation),
            scans: Vec::new(),
            map: ScanMap::new(parameters),
            drawn: 0,
            left_out: 0,
            first_unmatched: None,
            lost_way: None,
            max_contradicting: parameters.max_contradicting,
            tested: None,
        }
    }

    /// Leaves out all later scans: where they were made is not known.
    pub(super) fn lose_way(&mut self, lost: LostWay) {
        self.lost_way.get_or_insert(lost);
    }

    /// Where the robot has lost its way.
    pub(super) fn lost_way(&self) -> Option<LostWay> {
        self.lost_way
    }

    /// Length of the ways of the robot as a share of that by odometry.
    pub(super) fn odometry_scale(&self) -> f64 {
        self.trajectory.odometry_scale()
    }

    /// What turns the ways of the robot by odometry into those by its scans; `None` if it is not steady.
    pub(super) fn odometry_correction(&self) -> Option<OdometryCorrection> {
        self.trajectory.odometry_correction()
    }

    /// The yaw of the lidar on the robot as it is given, radians; 0 before the first scan.
    pub(super) fn lidar_yaw(&self) -> f64 {
        self.scans.last().map_or(0.0, |scan| scan.transform_base_lidar.rotation.angle())
    }

    /// Whether no scan has hit anything.
    pub(super) fn sees_nothing(&self) -> bool {
        self.trajectory.sees_nothing()
    }

    /// Time of the last scan.
    pub(super) fn last_time(&self) -> Option<LogTime> {
        self.scans.last().map(|scan| scan.time)
    }

    /// Whether the robot has moved so far from the last scan, to the pose `odometry`, that another one is to be added.
    /// Scans that are not later than the last are not, nor those of a robot that has lost its way.
    pub(super) fn is_due(&self, time: LogTime, odometry: &Pose2, parameters: &ScanMapperParameters) -> bool {
        self.lost_way.is_none()
            && self.scans.last().is_none_or(|last| {
                let moved = last.odometry.inv_mul(odometry);
                let is_far = moved.translation.vector.norm() >= parameters.step
                    || moved.rotation.angle().abs() >= parameters.step_yaw;
                time > last.time && is_far
            })
    }

    /// Standard deviations of position and yaw, metres and radians, of the motion since the last scan of a robot that is at the
    /// pose `odometry` after so many seconds without any: in these it has driven as far as in the mean, if not farther.
    pub(super) fn deviations_after_gap(&self, seconds: f64, odometry: &Pose2) -> [f64; 2] {
        let (Some(first), Some(last)) = (self.scans.first(), self.scans.last()) else { return [0.0; 2] };
        let driven = last.time.seconds_since(first.time);
        let speed = if driven > 0.0 { self.trajectory.path() / driven } else { 0.0 };
        let way = last.odometry.inv_mul(odometry).translation.vector.norm();
        self.trajectory.deviations_of_way(way.max(speed * seconds))
    }

    /// Adds a scan that was made at the pose `odometry`, without motion, and is expected at the pose `guess` in the same frame.
    /// Returns whether it lies on the earlier ones.
    pub(super) fn add(&mut self, time: LogTime, odometry: &Pose2, guess: &Pose2, scan: &ScanBeams) -> bool {
        let moved = self.scans.last().map_or_else(Pose2::identity, |last| last.odometry.inv_mul(guess));
        let before = self.trajectory.unmatched();
        let lidar = scan.transform_base_lidar.translation.vector.into();
        if self.trajectory.add(&moved, points(scan), lidar) {
            self.forget_map();
        }
        let still =
            |beam: &BaseBeam| StillBeam { angle: beam.angle as f32, range: beam.range as f32, is_hit: beam.is_hit };
        let beams = scan.beams.iter().map(still).collect();
        let transform_base_lidar = scan.transform_base_lidar;
        self.scans.push(StillScan { time, odometry: *odometry, transform_base_lidar, beams });
        let is_matched = self.trajectory.unmatched() == before;
        if !is_matched {
            self.first_unmatched.get_or_insert(time);
        }
        is_matched
    }

    /// Adds the position at which a tag was seen from the pose `odometry`, metres ahead of the base and to its left, with
    /// its standard deviation.
    pub(super) fn see(&mut self, time: LogTime, odometry: &Pose2, tag: &TagSighting) {
        let is_lost = self.lost_way.is_some_and(|lost| time >= lost.time);
        let Some(scan) = self.scans.partition_point(|scan| scan.time <= time).checked_sub(1) else { return };
        if !is_lost {
            let place = self.scans[scan].odometry.inv_mul(odometry) * tag.place;
            self.trajectory.see(scan, &tag.tag, place, tag.deviation);
        }
    }

    /// Registers a scan without adding it, from the pose `guess` with the given standard deviations of position and
    /// yaw. The pose in the frame of odometry; `None` if the scan lies on no earlier ones.
    pub(super) fn locate(&self, guess: &Pose2, deviations: [f64; 2], scan: &ScanBeams) -> Option<LocatedScan> {
        let last = self.scans.last()?.odometry;
        let found = self.trajectory.locate(&last.inv_mul(guess), deviations, &points(scan))?;
        Some(LocatedScan { pose: last * found.pose, ..found })
    }

    /// Registers a scan likewise where it lies at one place alone, of all at which it may be. `None` if it lies nowhere, or at several.
    pub(super) fn relocate(&self, guess: &Pose2, deviations: [f64; 2], scan: &ScanBeams) -> Option<LocatedScan> {
        let last = self.scans.last()?.odometry;
        let found = self.trajectory.relocate(&last.inv_mul(guess), deviations, &points(scan))?;
        Some(LocatedScan { pose: last * found.pose, ..found })
    }

    /// The scans with their poses, relative to the first.
    pub(super) fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// Pose of the first scan in the map.
    pub(super) fn transform_map_trajectory(&self) -> Pose2 {
        self.scans.first().map_or_else(Pose2::identity, |first| first.odometry)
    }

    /// Moves the scans to poses in any frame; the map's frame stays where it was.
    pub(super) fn move_to(&mut self, poses: Vec<Pose2>) {
        self.trajectory.move_to(poses);
        self.forget_map();
    }

    /// Goes on with the scans of a later session, at poses relative to the first scan of this one.
    pub(super) fn append(&mut self, session: Self, poses: Vec<Pose2>) {
        self.trajectory.append(session.trajectory, poses);
        self.scans.extend(session.scans);
        self.first_unmatched = self.first_unmatched.or(session.first_unmatched);
        self.lost_way = session.lost_way;
        self.forget_map();
    }

    /// Looks for the last loop closures, when there will be no more scans.
    pub(super) fn finish(&mut self) {
        if self.trajectory.finish() {
            self.forget_map();
        }
    }

    /// Scans have moved: the map is drawn again.
    fn forget_map(&mut self) {
        self.map.clear();
        (self.drawn, self.left_out) = (0, 0);
        self.tested = None;
    }

    /// Pose of a scan in the map, whose frame is that of odometry at the first scan.
    fn pose(&self, scan: usize) -> Pose2 {
        self.transform_map_trajectory() * self.trajectory.poses()[scan]
    }

    /// Draws the scans that are not in the map.
    fn draw(&mut self) {
        let mut beams = ScanBeams { transform_base_lidar: Pose2::identity(), beams: Vec::new(), duration: 0.0 };
        while let Some(scan) = self.scans.get(self.drawn) {
            beams.transform_base_lidar = scan.transform_base_lidar;
            beams.beams.clear();
            beams.beams.extend(scan.beams.iter().map(|beam| BaseBeam {
                angle: f64::from(beam.angle),
                range: f64::from(beam.range),
                is_hit: beam.is_hit,
                delay: 0.0,
            }));
            let at = self.pose(self.drawn);
            self.drawn += 1;
            self.left_out += usize::from(self.map.draw(&beams, |_| Some(at)).is_err());
        }
    }

    /// Takes the number of scans that were left out of the map since the last time, as it would get too large.
    pub(super) fn take_left_out(&mut self) -> usize {
        std::mem::take(&mut self.left_out)
    }

    /// The map of all scans; none if no cell is known.
    pub(super) fn snapshot(&mut self) -> Option<SnapshotMap> {
        self.draw();
        self.map.snapshot()
    }

    /// Time of the first and of the last scan.
    pub(super) fn times(&self) -> Option<[LogTime; 2]> {
        Some([self.scans.first()?.time, self.scans.last()?.time])
    }

    /// Pose in the map for a pose by odometry at a time: relative to the scan before it, and with the difference
    /// between odometry and registration up to the next one in proportion to the time. `None` where the robot has lost
    /// its way.
    pub(super) fn in_map(&self, time: LogTime, odometry: &Pose2) -> Option<Pose2> {
        if self.lost_way.is_some_and(|lost| time >= lost.time) {
            return None;
        }
        let next = self.scans.partition_point(|scan| scan.time <= time);
        let Some(before) = next.checked_sub(1) else { return Some(*odometry) };
        let last = &self.scans[before];
        let moved = last.odometry.inv_mul(odometry);
        let start = self.pose(before);
        let Some(after) = self.scans.get(next) else { return Some(start * moved) };
        let by_odometry = last.odometry.inv_mul(&after.odometry);
        let registered = start.inv_mul(&self.pose(next));
        let share = time.seconds_since(last.time) / after.time.seconds_since(last.time);
        let off = registered.translation.vector - by_odometry.translation.vector;
        let turned = wrap_angle(registered.rotation.angle() - by_odometry.rotation.angle());
        let place = moved.translation.vector + off * share;
        Some(start * pose(place.x, place.y, moved.rotation.angle() + turned * share))
    }

    /// Whether the scans turn against odometry, as those of a lidar that is mounted upside down.
    pub(super) fn is_mirrored(&self) -> bool {
        self.trajectory.turns_against_odometry()
    }

    /// Looks for scans that contradict the walls that were seen at other times, if the map has changed much since the
    /// last test, or at all and `is_end`.
    pub(super) fn test(&mut self, is_end: bool) {
        let count = self.scans.len();
        let is_tested = |(tested, _): &(usize, Contradictions)| {
            count == *tested || !is_end && (count as f64) < TESTED_AGAIN * *tested as f64
        };
        if !self.tested.as_ref().is_some_and(is_tested) {
            let found = self.trajectory.contradictions();
            self.tested = Some((count, found));
        }
    }

    /// What the last test has found.
    pub(super) fn contradictions(&self) -> Option<&Contradictions> {
        self.tested.as_ref().map(|(_, found)| found)
    }

    /// Whether so many scans lie on no others, or by the last test contradict others, that there is no map of them.
    pub(super) fn bad_scans(&self) -> Option<BadScans> {
        let unmatched = self.first_unmatched.map(|since| {
            let (count, scans) = (self.trajectory.unmatched(), self.scans.len());
            BadScans { fault: ScanFault::Unmatched, count, scans, since }
        });
        let contradicting = self.contradictions().and_then(|Contradictions { revisiting, contradicting }| {
            let (count, since) = (contradicting.len(), self.scans.get(*contradicting.first()?)?.time);
            Some(BadScans { fault: ScanFault::Contradicting, count, scans: *revisiting, since })
        });
        let are_too_many =
            |bad: &BadScans, most: f64| bad.scans >= LEAST_SCANS && bad.count as f64 > most * bad.scans as f64;
        unmatched
            .filter(|bad| are_too_many(bad, MAX_UNMATCHED))
            .or(contradicting.filter(|bad| are_too_many(bad, self.max_contradicting)))
    }
}

/// The hits of a scan in the frame of the base.
fn points(scan: &ScanBeams) -> Vec<ScanPoint> {
    let place = |beam: &BaseBeam| {
        let (sine, cosine) = beam.angle.sin_cos();
        scan.transform_base_lidar * Point2::new(cosine * beam.range, sine * beam.range)
    };
    let hits: Vec<Point2> = scan.beams.iter().filter(|beam| beam.is_hit).map(place).collect();
    scan_points(&hits, &scan.transform_base_lidar.translation.vector.into())
}
