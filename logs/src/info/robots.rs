//! The contents of a log by robot.

mod problems;

use crate::one_map::OneMap;
use crate::robots::{
    CellValues, Classified, InferredPoses, MapOrigin, MergedMaps, Peculiarity, PoseSource, RobotChannels, Role,
    TagRanges, TagReader, doubtful, is_scan, left_out, peculiarities, pose_with_covariance, robots_with_unread_maps,
    unread_map,
};
use crate::schemas::full_type_name;
use crate::tf::{TfPoses, is_static};
use gridweave_runtime::message::Channel;
use gridweave_runtime::ros::{GridError, Header, OccupancyGrid, RosMessage, TFMessage, decode};
use gridweave_runtime::stage::RobotTopics;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// The contents of a log for one robot.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RobotInfo {
    /// The robot's topics.
    pub topics: BTreeSet<String>,
    /// The number of maps.
    pub maps: u64,
    /// The number of map updates.
    pub map_updates: u64,
    /// The number of scans, if there are no maps: a map would be built from them.
    #[serde(skip_serializing_if = "is_zero")]
    pub scans: u64,
    /// The number of poses, including those derived from other messages.
    pub poses: u64,
    /// The source of the poses: a topic, or frames of tf; `None` without poses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub poses_from: Option<String>,
    /// The number of tag readings.
    pub readings: u64,
    /// The tags, and the number of readings of each.
    pub tags: BTreeMap<String, u64>,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// The leading fields of a tag range, up to the range.
#[derive(Deserialize)]
struct TagRangeStart {
    #[serde(rename = "header")]
    _header: Header,
    tag_id: String,
    range: f64,
}

/// Collects the contents of a log by robot, one message at a time.
pub(super) struct RobotSurvey {
    topics: RobotTopics,
    roles: RobotChannels,
    mismatches: BTreeSet<String>,
    /// Topics with maps that belong to no robot.
    other_maps: BTreeSet<String>,
    /// Topics with scans that belong to no robot.
    other_scans: BTreeSet<String>,
    /// What is said of maps of types that are not read.
    unread_maps: BTreeSet<String>,
    /// By robot beside others: what is said of its maps, which are all of types that are not read.
    with_unread_maps: BTreeMap<String, String>,
    /// By robot: what is wrong with the first map that cannot be used, and how many such maps there are.
    unusable_maps: BTreeMap<String, (GridError, u64)>,
    merged_maps: MergedMaps,
    /// By robot: the topic of its maps, and the frame of the first.
    map_frames: BTreeMap<String, (String, String)>,
    /// What is said of maps that are merged ones of other programs or may be, and of lidars that are not read.
    notes: BTreeSet<String>,
    /// By topic: what is unusual in its maps.
    peculiarities: BTreeMap<(String, Peculiarity), String>,
    /// By topic.
    ranges: BTreeMap<String, TagRanges>,
    /// The robots that localise in one map.
    one_map: Option<OneMap>,
    robots: BTreeMap<String, RobotInfo>,
    tf: Option<TfPoses>,
    inferred: InferredPoses,
    /// Odometry in a frame other than the map frame: the topic, by robot.
    odometry: BTreeMap<String, String>,
    /// By topic.
    tag_readers: BTreeMap<String, TagReader>,
    /// The number of messages that do not match their type, by topic.
    unreadable: BTreeMap<String, u64>,
}

impl RobotSurvey {
    /// Creates a survey of logs with these channels.
    pub(super) fn new<'a>(topics: RobotTopics, channels: impl Iterator<Item = &'a Channel> + Clone) -> Self {
        let roles = RobotChannels::new(topics.clone(), channels.clone());
        Self {
            with_unread_maps: robots_with_unread_maps(channels, &roles, &topics.map),
            inferred: InferredPoses::new(&roles),
            odometry: BTreeMap::new(),
            tag_readers: BTreeMap::new(),
            roles,
            tf: topics.tf.clone().map(TfPoses::new),
            topics,
            mismatches: BTreeSet::new(),
            other_maps: BTreeSet::new(),
            other_scans: BTreeSet::new(),
            unread_maps: BTreeSet::new(),
            unusable_maps: BTreeMap::new(),
            merged_maps: MergedMaps::default(),
            map_frames: BTreeMap::new(),
            notes: BTreeSet::new(),
            peculiarities: BTreeMap::new(),
            ranges: BTreeMap::new(),
            one_map: None,
            robots: BTreeMap::new(),
            unreadable: BTreeMap::new(),
        }
    }

    /// Sets the robots that the user has named.
    pub(super) fn set_given_robots(&mut self, given: &BTreeSet<String>) {
        self.merged_maps = MergedMaps::new(given.clone());
    }

    /// Sets the robots that localise in one map.
    pub(super) fn set_one_map(&mut self, one_map: Option<OneMap>) {
        self.one_map = one_map;
    }

    /// The role of a channel, and its robot.
    pub(super) fn classify(&mut self, channel: &Channel) -> (Role, String) {
        let Classified { role, robot, mismatch } = self.roles.classify(channel);
        self.mismatches.extend(mismatch);
        self.notes.extend(self.roles.lidar_note(channel).filter(|_| role == Role::Scan));
        if role == Role::TagMessage {
            let reader = self.roles.tag_reader(channel);
            self.tag_readers.extend(reader.map(|reader| (channel.topic.clone(), reader)));
        }
        match role {
            Role::Other if full_type_name(&channel.schema_name) == OccupancyGrid::NAME => {
                self.other_maps.insert(channel.topic.clone());
            }
            Role::Other if is_scan(&full_type_name(&channel.schema_name)) => {
                self.other_scans.insert(channel.topic.clone());
            }
            Role::Other => self.unread_maps.extend(unread_map(&channel.topic, &channel.schema_name)),
            Role::Tf => {}
            _ => {
                self.robots.entry(robot.to_owned()).or_default().topics.insert(channel.topic.clone());
            }
        }
        (role, robot.to_owned())
    }

    /// Whether the messages of a role are read: for the names of frames, and for maps that cannot be used.
    pub(super) fn reads(role: Role) -> bool {
        matches!(role, Role::Tf | Role::Odometry | Role::Map)
    }

    /// Adds a message of a channel with the given role, robot and topic.
    pub(super) fn take(&mut self, role: Role, robot: &str, topic: &str, data: &[u8]) {
        if role == Role::Tf {
            return self.take_tf(robot, topic, data);
        }
        let Some(info) = self.robots.get_mut(robot) else { return };
        match role {
            Role::Map => self.take_map(robot, topic, data),
            Role::MapUpdate => info.map_updates += 1,
            Role::Scan => info.scans += 1,
            Role::Pose(_) => {
                info.poses += 1;
                info.poses_from.get_or_insert_with(|| topic.to_owned());
            }
            Role::Odometry => {
                match pose_with_covariance(PoseSource::Odometry, data).map(|pose| decode::<Header>(&pose)) {
                    Ok(Ok(header)) if self.inferred.takes_odometry(robot, topic, &header.frame_id) => info.poses += 1,
                    Ok(_) => {
                        self.odometry.entry(robot.to_owned()).or_insert_with(|| topic.to_owned());
                    }
                    Err(_) => self.count_unreadable(topic),
                }
            }
            Role::Tags => {
                info.readings += 1;
                match decode::<TagRangeStart>(data) {
                    Ok(reading) => {
                        let note = self.ranges.entry(topic.to_owned()).or_default().add(reading.range);
                        self.notes.extend(note.map(|note| format!("tags on `{topic}`: {note}")));
                        *info.tags.entry(reading.tag_id).or_default() += 1;
                    }
                    Err(_) => self.count_unreadable(topic),
                }
            }
            Role::TagMessage => match self.tag_readers.get(topic).map(|reader| reader.read(robot, data)) {
                Some(Ok(message)) => {
                    info.readings += message.readings.len() as u64;
                    for reading in message.readings {
                        *info.tags.entry(reading.tag_id).or_default() += 1;
                    }
                }
                Some(Err(_)) => self.count_unreadable(topic),
                None => {}
            },
            Role::Topology | Role::Tf | Role::Other => {}
        }
    }

    fn take_map(&mut self, robot: &str, topic: &str, data: &[u8]) {
        let Ok(map) = decode::<OccupancyGrid<'_>>(data) else { return self.count_unreadable(topic) };
        let Some(info) = self.robots.get_mut(robot) else { return };
        if !self.map_frames.contains_key(robot) {
            self.map_frames.insert(robot.to_owned(), (topic.to_owned(), map.header.frame_id.clone()));
        }
        for (peculiarity, text) in peculiarities(data, CellValues::Auto, info.maps) {
            let note = || format!("maps on `{topic}`: {text}");
            self.peculiarities.entry((topic.to_owned(), peculiarity)).or_insert_with(note);
        }
        info.maps += 1;
        if let Err(error) = map.check() {
            let (_, count) = self.unusable_maps.entry(robot.to_owned()).or_insert((error, 0));
            *count += 1;
        }
        if self.inferred.asks_for_map(robot) {
            self.inferred.set_map_frame(robot, &map.header.frame_id);
        }
    }

    /// Counts a message that cannot be decoded.
    fn count_unreadable(&mut self, topic: &str) {
        *self.unreadable.entry(topic.to_owned()).or_default() += 1;
    }

    /// Adds a number of unread messages with the given role, robot and topic.
    pub(super) fn add(&mut self, role: Role, robot: &str, topic: &str, messages: u64) {
        let Some(info) = self.robots.get_mut(robot) else { return };
        match role {
            Role::Map => info.maps += messages,
            Role::MapUpdate => info.map_updates += messages,
            Role::Scan => info.scans += messages,
            Role::Pose(_) => info.poses += messages,
            Role::Odometry if info.poses_from.as_deref() == Some(topic) => info.poses += messages,
            // A message contains one tag reading or more.
            Role::Tags | Role::TagMessage => info.readings += messages,
            _ => {}
        }
    }

    fn take_tf(&mut self, prefix: &str, topic: &str, data: &[u8]) {
        let Ok(message) = decode::<TFMessage>(data) else { return self.count_unreadable(topic) };
        self.merged_maps.add_transforms(&message);
        self.inferred.odometry(prefix, is_static(topic), &message);
        let (poses, _) = match &mut self.tf {
            Some(tf) => tf.update(prefix, is_static(topic), &message),
            None => self.inferred.transforms(prefix, is_static(topic), &message),
        };
        for (robot, _) in poses {
            let info = self.robots.entry(robot.clone()).or_default();
            info.poses += 1;
            if let (None, Some(frames)) = (&info.poses_from, &self.topics.tf) {
                let [map, base] = [&frames.map_frame, &frames.base_frame].map(|frame| frame.replace("{robot}", &robot));
                info.poses_from = Some(format!("tf ({map} to {base})"));
            }
            if !info.topics.contains(topic) {
                info.topics.insert(topic.to_owned());
            }
        }
    }

    /// Removes the robots whose maps are merged ones of other programs. Call it once all messages were added.
    pub(super) fn remove_merged_maps(&mut self) {
        let frames = std::mem::take(&mut self.map_frames);
        // The frames of all robots decide.
        for (robot, (_, frame)) in &frames {
            self.merged_maps.add_map(robot, frame);
        }
        for (robot, (topic, frame)) in &frames {
            match self.merged_maps.origin(robot, frame, &self.roles) {
                MapOrigin::Merged => {
                    self.notes.insert(left_out(topic, Some(&self.roles.robots_option(None))));
                    self.robots.remove(robot);
                }
                MapOrigin::Doubtful => {
                    self.notes.insert(doubtful(topic, robot, &self.roles.robots_option(Some(robot))));
                }
                MapOrigin::Robot | MapOrigin::Undecided => {}
            }
        }
    }

    /// Whether a robot is one of the log.
    pub(super) fn is_known(&self, robot: &str) -> bool {
        self.robots.contains_key(robot)
    }

    pub(super) fn into_robots(mut self) -> BTreeMap<String, RobotInfo> {
        for (robot, info) in &mut self.robots {
            info.poses_from = info.poses_from.take().or_else(|| self.inferred.origin(robot));
        }
        self.robots
    }
}
