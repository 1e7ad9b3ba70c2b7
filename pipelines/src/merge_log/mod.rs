//! What a log knows of a merge at one moment: the last map of each robot, where they lie, and what was found in them. Pictures
//! and reports are drawn from it.

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
/// The topic of a robot's map that was drawn from its scans.
const DRAWN: &str = "/{robot}/drawn_map";
/// The topic of where maps contradict each other.
const CONFLICTS: &str = "/map_conflicts";
/// The topic of a robot's drive in the merged frame.
const PATH: &str = "/{robot}/merged_path";
/// Poses nearer than this to the last one are left out of a trail, metres.
const TRAIL_SPACING: f64 = 0.1;

/// What a log knows of a merge at one moment.
#[derive(Clone, Debug, Default)]
pub(crate) struct MergeState {
    /// The robots that have a map, or of which something else is known.
    pub(crate) robots: BTreeMap<String, RobotState>,
    /// The merged map, encoded.
    merged: Option<Vec<u8>>,
    /// Where maps contradict each other, encoded.
    conflicts: Option<Vec<u8>>,
    /// Where the maps lie.
    pub(crate) frames: Option<RobotFrames>,
    /// What became of each pair.
    pub(crate) verdicts: Option<Verdicts>,
    /// How far the maps agree.
    pub(crate) agreement: Option<MapAgreement>,
    /// The hypotheses of each pair, by the topic that they were sent on, by rank.
    pub(crate) hypotheses: BTreeMap<(String, String, String), Vec<Alignment>>,
    /// How the error of ICP fell, by pair, by what the first guess was found from, and by its rank.
    pub(crate) icp_errors: BTreeMap<(String, String, String, u32), IcpErrors>,
    /// The tags that pairs have in common.
    pub(crate) common_tags: BTreeMap<(String, String), CommonTags>,
}

/// What a log knows of a robot.
#[derive(Clone, Debug, Default)]
pub(crate) struct RobotState {
    /// The last map, encoded.
    map: Option<Vec<u8>>,
    /// Straight walls.
    pub(crate) segments: Option<Segments>,
    /// The direction of the walls.
    pub(crate) direction: Option<MapDirection>,
    /// Where tags are.
    pub(crate) tags: Option<TagEstimates>,
    /// How the map is bent.
    pub(crate) bend: Option<MapDeformation>,
    /// Places and ways.
    pub(crate) topology: Option<TopologicalMap>,
    /// The drive in the merged frame.
    pub(crate) path: Option<Path>,
    /// The drive in the robot's map.
    pub(crate) trail: Vec<Point2<f64>>,
}

impl RobotState {
    /// The last map.
    pub(crate) fn map(&self) -> Option<OccupancyGrid<'_>> {
        decode(self.map.as_deref()?).ok()
    }
}

impl MergeState {
    /// The merged map.
    pub(crate) fn merged(&self) -> Option<OccupancyGrid<'_>> {
        decode(self.merged.as_deref()?).ok()
    }

    /// Where maps contradict each other: 0 nowhere to 100 wholly.
    pub(crate) fn conflicts(&self) -> Option<OccupancyGrid<'_>> {
        decode(self.conflicts.as_deref()?).ok()
    }

    /// The robots that have a map, by name.
    pub(crate) fn robots_with_maps(&self) -> impl Iterator<Item = (&str, OccupancyGrid<'_>)> {
        self.robots.iter().filter_map(|(robot, state)| Some((robot.as_str(), state.map()?)))
    }

    /// Takes up a message, if it is about a merge.
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
                let bend: MapDeformation = decode(data)?;
                let state = self.robot(&bend.robot);
                state.bend = Some(bend);
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
                    self.robot(robot).drive_to(Point2::new(pose.position.x, pose.position.y));
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
            _ => match match_robot(&topics.map, topic).or_else(|| match_robot(DRAWN, topic)) {
                Some(robot) => &mut self.robot(robot).map,
                None => return Ok(()),
            },
        };
        decode::<OccupancyGrid<'_>>(data)?;
        *slot = Some(data.to_vec());
        Ok(())
    }

    /// Hypotheses of a pair come by rank, and those that come with the first take the place of all before.
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
    fn drive_to(&mut self, place: Point2<f64>) {
        let is_far = self.trail.last().is_none_or(|last| (place - last).norm() >= TRAIL_SPACING);
        if is_far && place.coords.iter().all(|value| value.is_finite()) {
            self.trail.push(place);
        }
    }
}
