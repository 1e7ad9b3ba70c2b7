//! The state of a merge at one moment of a log: the last map of each robot, its pose, and what was found in it.
//! Pictures and reports are made from it.

mod placing;
mod reading;

pub(crate) use placing::{PlacedRobot, Placing};
pub(crate) use reading::{Opened, map_files};

use gridweave_logs::schemas::full_type_name;
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{
    Alignment, CommonTags, DecodeError, IcpErrors, MapAgreement, MapDeformation, MapDirection, OccupancyGrid, Path,
    PoseStamped, RobotFrames, RosMessage, Segments, TagEstimates, TopologicalMap, Verdicts, decode,
};
use gridweave_runtime::stage::{RobotTopics, match_robot};
use nalgebra::Point2;
use std::collections::BTreeMap;

/// The topic of the merged map.
const MERGED: &str = "/map";
/// The topic of a robot's map that was built from its scans.
const BUILT_FROM_SCANS: &str = "/{robot}/drawn_map";
/// The topic of the conflicts between maps.
const CONFLICTS: &str = "/map_conflicts";
/// The topic of a robot's path in the merged frame.
const PATH: &str = "/{robot}/merged_path";
/// Poses nearer than this to the last one are left out of a trail, metres.
const TRAIL_SPACING: f64 = 0.1;

/// The state of a merge at one moment.
#[derive(Clone, Debug, Default)]
pub(crate) struct MergeState {
    /// Robots with a map or other messages.
    pub(crate) robots: BTreeMap<String, RobotState>,
    /// The merged map, encoded.
    merged: Option<Vec<u8>>,
    /// The conflicts between maps, encoded.
    conflicts: Option<Vec<u8>>,
    /// Poses of the map frames.
    pub(crate) frames: Option<RobotFrames>,
    /// The decision on each pair.
    pub(crate) verdicts: Option<Verdicts>,
    /// Areas of agreement and conflict.
    pub(crate) agreement: Option<MapAgreement>,
    /// Hypotheses by topic and pair, each list by rank.
    pub(crate) hypotheses: BTreeMap<(String, String, String), Vec<Alignment>>,
    /// Errors of ICP by pair, source of the initial guess, and rank.
    pub(crate) icp_errors: BTreeMap<(String, String, String, u32), IcpErrors>,
    /// Common tags by pair.
    pub(crate) common_tags: BTreeMap<(String, String), CommonTags>,
}

/// The state of a robot.
#[derive(Clone, Debug, Default)]
pub(crate) struct RobotState {
    /// The last map, encoded.
    map: Option<Vec<u8>>,
    /// Straight walls.
    pub(crate) segments: Option<Segments>,
    /// The direction of the walls.
    pub(crate) direction: Option<MapDirection>,
    /// Estimated positions of tags.
    pub(crate) tags: Option<TagEstimates>,
    /// The deformation of the map.
    pub(crate) deformation: Option<MapDeformation>,
    /// The topological map.
    pub(crate) topology: Option<TopologicalMap>,
    /// The path in the merged frame.
    pub(crate) path: Option<Path>,
    /// The logged positions in the robot's map frame.
    pub(crate) trail: Vec<Point2<f64>>,
}

impl RobotState {
    /// Decodes the last map.
    pub(crate) fn map(&self) -> Option<OccupancyGrid<'_>> {
        decode(self.map.as_deref()?).ok()
    }
}

impl MergeState {
    /// Decodes the merged map.
    pub(crate) fn merged(&self) -> Option<OccupancyGrid<'_>> {
        decode(self.merged.as_deref()?).ok()
    }

    /// Decodes the conflicts between maps: 0 for agreement to 100 for full conflict.
    pub(crate) fn conflicts(&self) -> Option<OccupancyGrid<'_>> {
        decode(self.conflicts.as_deref()?).ok()
    }

    /// Iterates over the robots that have a map, by name.
    pub(crate) fn robots_with_maps(&self) -> impl Iterator<Item = (&str, OccupancyGrid<'_>)> {
        self.robots.iter().filter_map(|(robot, state)| Some((robot.as_str(), state.map()?)))
    }

    /// Ingests a message, if it is about a merge.
    pub(crate) fn take(&mut self, channel: &Channel, topics: &RobotTopics, data: &[u8]) -> Result<(), DecodeError> {
        if channel.message_encoding != "cdr" {
            return Ok(());
        }
        let topic = channel.topic.as_str();
        match full_type_name(&channel.schema_name).as_ref() {
            OccupancyGrid::NAME => self.take_grid(topic, topics, data)?,
            RobotFrames::NAME => self.frames = Some(decode(data)?),
            Verdicts::NAME => self.verdicts = Some(decode(data)?),
            MapAgreement::NAME => self.agreement = Some(decode(data)?),
            Alignment::NAME => self.take_hypothesis(topic, decode(data)?),
            IcpErrors::NAME => {
                let errors: IcpErrors = decode(data)?;
                let IcpErrors { a, b, source, rank, .. } = &errors;
                self.icp_errors.insert((a.clone(), b.clone(), source.clone(), *rank), errors);
            }
            CommonTags::NAME => {
                let tags: CommonTags = decode(data)?;
                self.common_tags.insert((tags.robot_a.clone(), tags.robot_b.clone()), tags);
            }
            Segments::NAME => {
                let segments: Segments = decode(data)?;
                let state = self.robot(&segments.robot);
                state.segments = Some(segments);
            }
            MapDirection::NAME => {
                let direction: MapDirection = decode(data)?;
                let state = self.robot(&direction.robot);
                state.direction = Some(direction);
            }
            TagEstimates::NAME => {
                let tags: TagEstimates = decode(data)?;
                let state = self.robot(&tags.robot);
                state.tags = Some(tags);
            }
            MapDeformation::NAME => {
                let deformation: MapDeformation = decode(data)?;
                let state = self.robot(&deformation.robot);
                state.deformation = Some(deformation);
            }
            TopologicalMap::NAME => {
                let topology: TopologicalMap = decode(data)?;
                let state = self.robot(&topology.robot);
                state.topology = Some(topology);
            }
            Path::NAME => {
                if let Some(robot) = match_robot(PATH, topic) {
                    self.robot(robot).path = Some(decode(data)?);
                }
            }
            PoseStamped::NAME => {
                if let Some(robot) = match_robot(&topics.pose, topic) {
                    let PoseStamped { pose, .. } = decode(data)?;
                    self.robot(robot).add_to_trail(Point2::new(pose.position.x, pose.position.y));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn take_grid(&mut self, topic: &str, topics: &RobotTopics, data: &[u8]) -> Result<(), DecodeError> {
        let slot = match topic {
            MERGED => &mut self.merged,
            CONFLICTS => &mut self.conflicts,
            _ => match match_robot(&topics.map, topic).or_else(|| match_robot(BUILT_FROM_SCANS, topic)) {
                Some(robot) => &mut self.robot(robot).map,
                None => return Ok(()),
            },
        };
        decode::<OccupancyGrid<'_>>(data)?;
        *slot = Some(data.to_vec());
        Ok(())
    }

    /// Adds a hypothesis. Those of a pair arrive by rank, and the first of a list replaces the list before.
    fn take_hypothesis(&mut self, topic: &str, alignment: Alignment) {
        let key = (topic.to_owned(), alignment.a.clone(), alignment.b.clone());
        let hypotheses = self.hypotheses.entry(key).or_default();
        hypotheses.truncate(alignment.rank as usize);
        hypotheses.push(alignment);
    }

    fn robot(&mut self, name: &str) -> &mut RobotState {
        self.robots.entry(name.to_owned()).or_default()
    }
}

impl RobotState {
    fn add_to_trail(&mut self, position: Point2<f64>) {
        let is_far = self.trail.last().is_none_or(|last| (position - last).norm() >= TRAIL_SPACING);
        if is_far && position.coords.iter().all(|value| value.is_finite()) {
            self.trail.push(position);
        }
    }
}
