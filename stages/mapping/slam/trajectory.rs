//! The poses of a robot at its scans, as they are known so far.

use super::contradictions::{Contradictions, PlacedScan, find_contradictions};
use super::local_map::LocalMap;
use super::loop_closure::{Drive, Revisit, middle};
use super::odometry_noise::{OdometryCorrection, OdometryNoise};
use super::pose_graph::{Constraint, LandmarkSighting, PoseGraph, turned_information, yaw_information};
use super::relocalization::find_loop_closures;
use super::revisits::refine;
use super::scan_points::ScanPoint;
use super::scan_registration::{RegisteredScan, SLIP_GAIN, WELL_MATCHED, register};
use super::seen_tags::SeenTags;
use crate::shared::geometry::{Point2, Pose2, pose};
use nalgebra::{Matrix3, UnitComplex, Vector2, Vector3};
use std::cell::OnceCell;
use std::ops::Range;
use std::slice;

/// Number of scans before one that make up its local map, at most, and the path that they may span, metres.
pub(super) const RECENT_SCANS: usize = 40;
const RECENT_PATH: f64 = 20.0;
/// Path of a submap, metres, and number of its scans, at most.
const SUBMAP_PATH: f64 = 4.0;
const SUBMAP_SCANS: usize = 30;
/// Share of the information of odometry about the yaw that counts where a scan is registered: wheels that turn too far do
/// so for long, so that steps are not independent, and walls show the yaw nearly everywhere.
const YAW_SHARE: f64 = 0.2;
/// Share of the information about the yaw that counts as a measurement against the middle of the local map, beside that against
/// the last scan: its walls have been seen for long, so that the errors of the yaw do not add up from scan to scan as those of
/// the position do. Simulated drives fit 0.1 (`experiments pose-certainty`), whose walls are straight and still; a third of it is
/// taken, as a window that is too narrow loses closures, and one that is too wide costs time.
pub const YAW_OF_MAP_SHARE: f64 = 0.03;
/// Share of its points that must lie on the local map, for a scan to be registered at all.
pub(super) const LEAST_MATCHED: f64 = 0.15;
/// Distance of an earlier submap from the robot, metres, up to which it is part of the local map once a loop closure
/// has tied it; the number of these, the nearest ones; and the standard deviations up to which it is tied, metres and
/// radians.
const REVISITED_DISTANCE: f64 = 10.0;
const REVISITED_SUBMAPS: usize = 6;
const REVISITED_DEVIATIONS: [f64; 2] = [0.15, 0.05];

/// The scans of a robot with their poses, in the frame of the first.
#[derive(Clone, Debug)]
pub struct Trajectory {
    noise: OdometryNoise,
    graph: PoseGraph,
    /// The points of each scan, in the frame of the base.
    scans: Vec<Vec<ScanPoint>>,
    /// Position of the lidar at each scan, in the frame of the base. A recorded map has none.
    lidars: Vec<Point2>,
    /// Path of odometry up to each scan, metres.
    paths: Vec<f64>,
    submaps: Vec<Range<usize>>,
    /// First scan of the submap that is not finished.
    submap_start: usize,
    /// Earlier submaps that are part of the local map.
    revisited: Vec<usize>,
    is_recorded: bool,
    tags: SeenTags,
    /// How the robot has moved up to the last scan by odometry.
    last_move: Pose2,
    /// The local map, once it was asked for since the last change.
    local_map: OnceCell<LocalMap>,
    unmatched: usize,
}

impl Trajectory {
    /// Nothing so far. `odometry_deviation` is the standard deviation of odometry that is assumed before the first
    /// scan, as a share of the way and the turn.
    pub fn new(odometry_deviation: f64) -> Self {
        Self {
            noise: OdometryNoise::new(odometry_deviation),
            graph: PoseGraph::default(),
            scans: Vec::new(),
            lidars: Vec::new(),
            paths: Vec::new(),
            submaps: Vec::new(),
            submap_start: 0,
            revisited: Vec::new(),
            is_recorded: false,
            tags: SeenTags::default(),
            last_move: Pose2::identity(),
            local_map: OnceCell::new(),
            unmatched: 0,
        }
    }

    /// The squares of a recorded map as scans at known poses, each of which is a submap.
    pub(super) fn of_recorded_map(graph: PoseGraph, scans: Vec<Vec<ScanPoint>>) -> Self {
        let count = scans.len();
        let submaps = (0..count).map(|scan| scan..scan + 1).collect();
        Self {
            graph,
            scans,
            paths: vec![0.0; count],
            submaps,
            submap_start: count,
            is_recorded: true,
            ..Self::new(1.0)
        }
    }

    /// The poses of the base at the scans.
    pub fn poses(&self) -> &[Pose2] {
        &self.graph.poses
    }

    /// All of its scans.
    fn drive(&self) -> Drive {
        Drive { scans: 0..self.scans.len(), is_recorded: self.is_recorded }
    }

    /// Whether it is a recorded map.
    pub(super) fn is_recorded(&self) -> bool {
        self.is_recorded
    }

    /// The points of each scan, in the frame of the base.
    pub(super) fn scans(&self) -> impl Iterator<Item = &[ScanPoint]> {
        self.scans.iter().map(Vec::as_slice)
    }

    /// Odometry with the registration on the local map, the yaw in that map, and loop closures.
    pub fn constraints(&self) -> &[Constraint] {
        &self.graph.constraints
    }

    /// The positions at which tags were seen.
    pub(super) fn sightings(&self) -> &[LandmarkSighting] {
        &self.graph.sightings
    }

    /// The tags that were seen, each with the number of its landmark in the graph.
    pub(super) fn tags(&self) -> impl ExactSizeIterator<Item = (&str, usize)> {
        self.tags.landmarks()
    }

    /// The submaps, as ranges of scans.
    pub(super) fn submaps(&self) -> &[Range<usize>] {
        &self.submaps
    }

    /// The loop closures that were found: poses of later scans in earlier ones.
    pub fn closures(&self) -> impl Iterator<Item = &Constraint> {
        self.graph.constraints.iter().filter(|constraint| constraint.is_loop)
    }

    /// How many scans lay on no earlier ones, and have their pose by odometry.
    pub fn unmatched(&self) -> usize {
        self.unmatched
    }

    /// Whether no scan has hit anything.
    pub fn sees_nothing(&self) -> bool {
        self.scans.iter().all(Vec::is_empty)
    }

    /// Whether the robot turns one way by odometry and the other way by its scans.
    pub fn turns_against_odometry(&self) -> bool {
        self.noise.turns_against_scans()
    }

    /// Length of the ways of the robot as a share of that by odometry.
    pub fn odometry_scale(&self) -> f64 {
        self.noise.scale()
    }

    /// What turns the ways of the robot by odometry into those by its scans; `None` if it is not steady.
    pub fn odometry_correction(&self) -> Option<OdometryCorrection> {
        self.noise.correction()
    }

    /// Length of the path of the robot by odometry, metres.
    pub fn path(&self) -> f64 {
        self.paths.last().copied().unwrap_or_default()
    }

    /// Standard deviations of a way by odometry that is made of steps as those so far: of the position, metres, which errors of the
    /// yaw on the way move as well, and of the yaw, radians.
    pub fn deviations_of_way(&self, way: f64) -> [f64; 2] {
        let steps = self.graph.poses.len().saturating_sub(1).max(1) as f64;
        let step = (self.path() / steps).min(way);
        let [position, yaw] = self.noise.deviations(&pose(step, 0.0, 0.0));
        let growth = if step > 0.0 { (way / step).sqrt() } else { 1.0 };
        let yaw = yaw * growth / YAW_SHARE.sqrt();
        // The integral over a random walk.
        [(position * growth).hypot(yaw * way / 3f64.sqrt()), yaw]
    }

    /// Compares each scan with the walls that were seen at other times than its own.
    pub fn contradictions(&self) -> Contradictions {
        find_contradictions(&self.placed_scans(&self.graph.poses, 0).collect::<Vec<_>>(), RECENT_SCANS)
    }

    /// The scans at poses that need not be those of the graph, as of the given drive.
    pub(super) fn placed_scans<'a>(&'a self, poses: &'a [Pose2], drive: usize) -> impl Iterator<Item = PlacedScan<'a>> {
        let scans = self.scans.iter().zip(poses).enumerate();
        scans.map(move |(scan, (points, pose))| PlacedScan {
            points,
            pose: *pose,
            lidar: self.lidars.get(scan).copied(),
            drive,
        })
    }

    /// Moves the scans to poses in any frame; those of the first submap stay where they are as a whole.
    pub fn move_to(&mut self, poses: Vec<Pose2>) {
        let start = self.start();
        self.graph.poses = poses;
        self.hold(&start);
        self.local_map.take();
    }

    /// Appends the scans of another trajectory, which is finished, at poses in the frame of this one.
    pub fn append(&mut self, other: Self, poses: Vec<Pose2>) {
        let (first, path) = (self.scans.len(), self.path());
        let constraints = other.graph.constraints.into_iter();
        self.graph.poses.extend(poses);
        self.graph.constraints.extend(constraints.map(|own| Constraint {
            from: first + own.from,
            to: first + own.to,
            ..own
        }));
        self.lidars.extend(other.lidars);
        self.paths.extend(other.paths.iter().map(|at| path + at));
        self.scans.extend(other.scans);
        self.submaps.extend(other.submaps.iter().map(|submap| first + submap.start..first + submap.end));
        self.submap_start = self.scans.len();
        self.unmatched += other.unmatched;
        self.local_map.take();
        for sighting in &other.graph.sightings {
            let tag = other.tags.landmarks().find(|(_, landmark)| *landmark == sighting.landmark);
            tag.into_iter().for_each(|(tag, _)| {
                self.see(first + sighting.from, tag, sighting.place, sighting.deviation);
            });
        }
    }

    /// Adds a scan of a robot that has moved by `moved` since the last one, by odometry: its points, and the position of the
    /// lidar, in the frame of the base. Returns whether a loop closure has moved earlier scans.
    pub fn add(&mut self, moved: &Pose2, points: Vec<ScanPoint>, lidar: Point2) -> bool {
        self.lidars.push(lidar);
        let Some(last) = self.graph.poses.last().copied() else {
            self.push(Pose2::identity(), 0.0, points);
            return false;
        };
        let moved = &self.noise.corrected(moved);
        let by_odometry = self.noise.information(moved);
        let found = self.register_next(moved, &points);
        self.last_move = *moved;
        let is_matched = found.matched >= LEAST_MATCHED;
        let pose = if is_matched { found.pose } else { last * moved };
        self.unmatched += usize::from(!is_matched);
        let by_walls = if is_matched { found.information } else { Matrix3::zeros() };
        let yaw_by_walls = YAW_OF_MAP_SHARE * yaw_information(&by_walls);
        let by_walls = turned_information(&by_walls, &last.rotation.inverse());
        let information = by_walls + by_odometry;
        let to = self.graph.poses.len();
        let transform = last.inv_mul(&pose);
        if let (true, Some(covariance)) = (is_matched, information.try_inverse()) {
            self.noise.learn(moved, &transform, &covariance, &by_walls);
        }
        self.graph.constraints.push(Constraint { from: to - 1, to, transform, information, is_loop: false });
        let from = self.centre_of_local_map();
        self.graph.constraints.push(Constraint {
            from,
            to,
            transform: self.graph.poses[from].inv_mul(&pose),
            information: Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, yaw_by_walls)),
            is_loop: false,
        });
        self.push(pose, moved.translation.vector.norm(), points);
        let is_long = self.paths[to] - self.paths[self.submap_start] > SUBMAP_PATH;
        (is_long || to - self.submap_start >= SUBMAP_SCANS) && self.finish_submap()
    }

    /// Registers the points of a robot that has moved by `moved` since the last scan. Where odometry is late or early, the last step
    /// and this one may be wrong, one as much as the other the other way, and right together.
    fn register_next(&self, moved: &Pose2, points: &[ScanPoint]) -> RegisteredScan {
        let last = self.graph.poses.len() - 1;
        let found = self.register_from(last, moved, points);
        if found.matched >= WELL_MATCHED || last == 0 {
            return found;
        }
        let by_both = self.register_from(last - 1, &(self.last_move * moved), points);
        if by_both.matched >= WELL_MATCHED.max(found.matched + SLIP_GAIN) { by_both } else { found }
    }

    /// Registers the points of a robot that has moved by `moved` since a scan.
    fn register_from(&self, scan: usize, moved: &Pose2, points: &[ScanPoint]) -> RegisteredScan {
        let start = self.graph.poses[scan];
        let mut prior = turned_information(&self.noise.information(moved), &start.rotation);
        prior.m33 *= YAW_SHARE;
        register(self.local_map(), points, &(start * moved), &prior, self.noise.deviations(moved))
    }

    /// Adds the position at which a tag was seen, in the frame of the base at a scan, with its standard deviation, metres.
    /// Of several from one scan the first counts: they have the same errors.
    pub fn see(&mut self, scan: usize, tag: &str, place: Point2, deviation: f64) {
        if scan >= self.scans.len() {
            return;
        }
        let Some(landmark) = self.tags.see(tag, scan) else { return };
        self.graph.sightings.push(LandmarkSighting { from: scan, landmark, place, deviation });
    }

    fn push(&mut self, pose: Pose2, way: f64, points: Vec<ScanPoint>) {
        self.local_map.take();
        self.graph.poses.push(pose);
        self.paths.push(self.paths.last().map_or(0.0, |path| path + way));
        self.scans.push(points);
    }

    /// The first of the scans that make up the local map.
    fn recent(&self) -> usize {
        let count = self.scans.len();
        let path = self.paths.last().map_or(0.0, |path| path - RECENT_PATH);
        self.paths.partition_point(|at| *at < path).max(count.saturating_sub(RECENT_SCANS))
    }

    /// The scan whose yaw stands for that of the local map: the middle one of the finished submap in its middle.
    fn centre_of_local_map(&self) -> usize {
        let recent = self.recent();
        let centre = (recent + self.scans.len()) / 2;
        let until_centre = self.submaps.partition_point(|submap| submap.start <= centre);
        let submap = until_centre.checked_sub(1).map(|last| middle(&self.submaps[last]));
        submap.filter(|scan| *scan >= recent).unwrap_or(recent)
    }

    /// The last scans, and the earlier submaps around the robot.
    pub(super) fn local_map(&self) -> &LocalMap {
        self.local_map.get_or_init(|| {
            let recent = self.recent();
            let revisited = self.revisited.iter().flat_map(|submap| self.submaps[*submap].clone());
            let scans = revisited.filter(|scan| *scan < recent).chain(recent..self.scans.len());
            LocalMap::new(scans.map(|scan| (self.graph.poses[scan], &self.scans[scan][..])))
        })
    }

    /// Optimises the poses if a tag was seen again since the last time, that was first seen before the scan `recent`. Returns
    /// whether one was.
    fn close_by_tags(&mut self, recent: usize) -> bool {
        let is_seen_again = self.tags.take_seen_again(recent);
        if is_seen_again {
            self.graph.optimize();
        }
        is_seen_again
    }

    /// Finishes the submap of the last scans, and looks for loop closures. Returns whether one has moved earlier
    /// scans.
    pub fn finish_submap(&mut self) -> bool {
        let own = self.submap_start..self.scans.len();
        if own.is_empty() {
            return false;
        }
        self.submap_start = own.end;
        let (centre, recent) = (middle(&own), self.recent());
        self.submaps.push(own);
        let has_seen_again = self.close_by_tags(recent);
        let has_earlier = self.submaps[0].end <= recent;
        let mut covariances = has_earlier.then(|| self.graph.covariances_from(centre)).flatten();
        let (drive, scans) = (self.drive(), self.scans().collect::<Vec<_>>());
        let drives = slice::from_ref(&drive);
        let revisit = Revisit { graph: &self.graph, scans: &scans, submaps: &self.submaps, drives, recent };
        let find = |covariances: &Vec<Matrix3<f64>>| find_loop_closures(&revisit, covariances, &self.lidars);
        let found = covariances.as_ref().map_or_else(Vec::new, find);
        let has_closed = !found.is_empty();
        self.graph.constraints.extend(found);
        if has_closed {
            self.graph.optimize();
            covariances = self.graph.covariances_from(centre);
        }
        self.revisited = covariances.map_or_else(Vec::new, |known| self.tied_submaps(recent, &known));
        self.local_map.take();
        has_closed || has_seen_again
    }

    /// Finishes the last submap, and registers each scan on what was seen at its place at other times. Returns whether
    /// scans have moved.
    pub fn finish(&mut self) -> bool {
        let mut has_closed = self.finish_submap();
        let start = self.start();
        // Those seen from the last scan of a submap come after its end.
        has_closed |= self.close_by_tags(self.recent());
        let scans: Vec<&[ScanPoint]> = self.scans.iter().map(Vec::as_slice).collect();
        let drive = self.drive();
        let has_moved = refine(&mut self.graph, &scans, &self.submaps, slice::from_ref(&drive), RECENT_SCANS);
        self.hold(&start);
        self.local_map.take();
        has_closed || has_moved
    }

    /// The poses of the first submap.
    fn start(&self) -> Vec<Pose2> {
        self.submaps.first().map_or_else(Vec::new, |first| self.graph.poses[first.clone()].to_vec())
    }

    /// Moves all poses rigidly so that those of the first scans are where they were: the frame is known by all of these
    /// better than by the first.
    fn hold(&mut self, start: &[Pose2]) {
        let poses = &self.graph.poses;
        let apart = |(now, before): (&Pose2, &Pose2)| (before.rotation / now.rotation).angle();
        let turns = poses.iter().zip(start).map(apart);
        let share = 1.0 / start.len().max(1) as f64;
        let turn = UnitComplex::new(turns.sum::<f64>() * share);
        let shift = |(now, before): (&Pose2, &Pose2)| before.translation.vector - turn * now.translation.vector;
        let shift = poses.iter().zip(start).map(shift).sum::<Vector2<f64>>() * share;
        let by = Pose2::from_parts(shift.into(), turn);
        self.graph.poses.iter_mut().for_each(|pose| *pose = by * *pose);
    }

    /// The earlier submaps around the last scan, whose pose relative to the last submap is well known by these covariances.
    fn tied_submaps(&self, recent: usize, covariances: &[Matrix3<f64>]) -> Vec<usize> {
        let Some(last) = self.graph.poses.len().checked_sub(1).filter(|_| self.closures().next().is_some()) else {
            return Vec::new();
        };
        let here = self.graph.poses[last].translation.vector;
        let middle = |submap: &usize| middle(&self.submaps[*submap]);
        let distance = |submap: &usize| (self.graph.poses[middle(submap)].translation.vector - here).norm();
        let is_tied = |submap: &usize| {
            let is_near = distance(submap) < REVISITED_DISTANCE;
            let covariance = covariances[middle(submap)];
            let place = (covariance.m11 + covariance.m22).sqrt();
            let is_known = place < REVISITED_DEVIATIONS[0] && covariance.m33.sqrt() < REVISITED_DEVIATIONS[1];
            self.submaps[*submap].end <= recent && is_near && is_known
        };
        let tied = (0..self.submaps.len()).filter(is_tied);
        let mut nearest: Vec<(f64, usize)> = tied.map(|submap| (distance(&submap), submap)).collect();
        nearest.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        nearest.into_iter().take(REVISITED_SUBMAPS).map(|(_, submap)| submap).collect()
    }
}
