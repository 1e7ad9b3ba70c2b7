//! Routes messages to the output ports of their channels.

mod missing;

use super::channel::{Route, Stamp};
use super::derived::Derived;
use super::latched::Latch;
use super::{RobotMessages, RobotReading};
use crate::one_map::OneMap;
use crate::robots::{
    CellValues, MapOrigin, MergedMaps, MixedFrames, Peculiarity, Resolutions, RobotChannels, Role, doubtful, left_out,
    peculiarities, with_resolution,
};
use crate::tf::{MAP_FRAMES, is_static, tf_topic};
use gridweave_runtime::message::{Channel, FixedText, MessageHeader};
use gridweave_runtime::ros::{Header, TFMessage, TagRange, decode};
use gridweave_runtime::stage::{Output, RobotTopics, StageError, frame_of_robot};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// The number of messages on a topic of transforms in which frames are looked for: later ones repeat them.
const FIRST_TRANSFORMS: u64 = 1000;

/// Routes messages to the output ports of their channels, and sends what is derived from them.
pub(super) struct ChannelRouter {
    robots: RobotTopics,
    roles: RobotChannels,
    /// How the values of maps' cells are read.
    map_values: CellValues,
    resolutions: Resolutions,
    /// `None` if every map is taken as the robot's of its topic.
    merged_maps: Option<MergedMaps>,
    /// The last map of each route whose origin is undecided: none live, where other maps may never be published.
    undecided: Vec<(usize, Stamp, Vec<u8>)>,
    holds_undecided: bool,
    /// Topics of maps, and what was warned of in them.
    noted: BTreeSet<(String, Peculiarity)>,
    /// The frames of scans and odometry.
    mixed_frames: MixedFrames,
    routes: Vec<Route>,
    by_channel: BTreeMap<Channel, usize>,
    derived: Derived,
    /// The frames of the robots' maps that are known before the first message.
    map_frames: BTreeSet<String>,
    /// Whether robots localise in one map, which is no robot's.
    has_one_map: bool,
}

impl ChannelRouter {
    /// Creates a router for messages of these channels. Whole maps are derived from map updates if `updates_maps`.
    pub(super) fn new<'a>(
        robots: RobotTopics,
        channels: impl Iterator<Item = &'a Channel>,
        updates_maps: bool,
        reading: RobotReading,
    ) -> Self {
        let roles = RobotChannels::new(robots.clone(), channels);
        let derived = Derived::new(&robots, &roles, updates_maps, &reading);
        Self {
            derived,
            roles,
            robots,
            map_values: reading.map_values,
            resolutions: reading.resolutions,
            merged_maps: updates_maps.then(MergedMaps::default),
            undecided: Vec::new(),
            holds_undecided: true,
            noted: BTreeSet::new(),
            mixed_frames: MixedFrames::default(),
            routes: Vec::new(),
            by_channel: BTreeMap::new(),
            map_frames: BTreeSet::new(),
            has_one_map: false,
        }
    }

    /// Creates a router for channels that are added later. Whole maps are derived from map updates.
    pub(super) fn live(robots: RobotTopics, reading: RobotReading) -> Self {
        let mut router = Self::new(robots, std::iter::empty(), true, reading);
        router.derived.expect_sensors();
        router.holds_undecided = false;
        router
    }

    /// Replaces the set of channels. What was learnt from messages is kept.
    pub(super) fn set_channels<'a>(&mut self, channels: impl Iterator<Item = &'a Channel>) {
        self.roles = RobotChannels::new(self.robots.clone(), channels);
        self.derived.set_roles(&self.roles);
        for route in &mut self.routes {
            let classified = self.roles.classify(&route.channel);
            if classified.role != route.role {
                route.role = classified.role;
                route.robot = classified.robot.to_owned();
                route.tag_reader = self.roles.tag_reader(&route.channel).filter(|_| route.role == Role::TagMessage);
            }
        }
    }

    /// The roles of the channels.
    pub(super) fn roles(&self) -> &RobotChannels {
        &self.roles
    }

    /// The route with the given index.
    pub(super) fn route(&self, index: usize) -> Option<&Route> {
        self.routes.get(index)
    }

    /// A message on a route; a map with the resolution that the user has set.
    fn corrected<'a>(&self, index: usize, data: &'a [u8]) -> Cow<'a, [u8]> {
        match self.routes.get(index).filter(|route| route.role == Role::Map) {
            Some(route) => with_resolution(&self.resolutions, &route.robot, data),
            None => Cow::Borrowed(data),
        }
    }

    /// Sends a message that was received on a route. The output's log time must be the message's.
    pub(super) fn send(
        &mut self,
        index: usize,
        stamp: Stamp,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let data = &*self.corrected(index, data);
        self.pass(index, stamp, data, output)?;
        let Some(route) = self.routes.get_mut(index) else { return Ok(()) };
        if matches!(route.role, Role::Scan | Role::Odometry | Role::Map)
            && self.merged_maps.is_some()
            && let Ok(Header { frame_id, .. }) = decode(data)
            && let Some(mixed) = self.mixed_frames.add(&route.channel.topic, &route.robot, &frame_id)
        {
            // A map of two robots is worse than none. Live, the others go on.
            if self.holds_undecided {
                return Err(StageError::new("distinguish the robots", mixed));
            }
            output.warn(mixed);
            return Ok(());
        }
        self.derived.send(route, &self.roles, data, output)
    }

    /// Sends a message unchanged on the port for other messages.
    pub(super) fn pass_on(
        &mut self,
        index: usize,
        stamp: Stamp,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        match self.routes.get_mut(index) {
            Some(route) => route.send(stamp, data, &output.other, output.log_time()),
            None => Ok(()),
        }
    }

    /// Learns frames and maps from a message without sending anything.
    pub(super) fn learn(&mut self, index: usize, data: &[u8], output: &Output<RobotMessages>) {
        let data = &*self.corrected(index, data);
        if let Some(route) = self.routes.get(index) {
            self.derived.learn(route, &self.roles, data, output);
        }
    }

    /// Learns that robots localise in one map. Returns the reason why nothing of them is merged.
    pub(super) fn learn_one_map(&mut self, one_map: &OneMap) -> String {
        self.has_one_map = true;
        one_map.reason(&self.robots.map)
    }

    /// Whether anything is derived with frames of tf or of maps.
    pub(super) fn needs_frames(&self) -> bool {
        self.derived.needs_frames()
    }

    /// The robots that the user has named: whatever their maps are, they are theirs.
    pub(super) fn set_given_robots(&mut self, given: &BTreeSet<String>) {
        self.merged_maps = self.merged_maps.is_some().then(|| MergedMaps::new(given.clone()));
    }

    /// Whether a map may be a merged one of others.
    pub(super) fn seeks_merged_maps(&self) -> bool {
        self.merged_maps.is_some() && self.roles.mapped().count() > MergedMaps::LEAST_PARTS
    }

    /// Learns transforms of the log before they come; their frame names lack `prefix`.
    pub(super) fn learn_transforms(&mut self, prefix: &str, is_static: bool, transforms: &TFMessage) {
        self.merged_maps.iter_mut().for_each(|merged_maps| merged_maps.add_transforms(transforms));
        if self.derived.needs_frames() {
            self.derived.learn_ahead(prefix, is_static, transforms);
        }
    }

    /// Learns the frame of a robot's map before it comes.
    pub(super) fn learn_map_frame(&mut self, robot: &str, frame: &str) {
        self.merged_maps.iter_mut().for_each(|merged_maps| merged_maps.add_map(robot, frame));
        self.derived.set_map_frame(robot, frame);
        if !frame.is_empty() {
            self.map_frames.insert(frame_of_robot(robot, frame).into_owned());
        }
    }

    /// The channel as it is announced: one of transforms names the frames of maps.
    fn announced(&self, channel: &Channel) -> Channel {
        let mut announced = channel.clone();
        if tf_topic(channel).is_some() && !self.map_frames.is_empty() {
            let frames: Vec<&str> = self.map_frames.iter().map(String::as_str).collect();
            announced.metadata.insert(MAP_FRAMES.to_owned(), frames.join("\n"));
        }
        announced
    }

    /// Sends the maps that were updated since they were last sent.
    pub(super) fn send_updated_maps(&mut self, output: &Output<RobotMessages>) -> Result<(), StageError> {
        self.derived.send_updated_maps(output)
    }

    /// Sends a message that was [learnt](Self::learn) before.
    pub(super) fn send_learnt(
        &mut self,
        index: usize,
        stamp: Stamp,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let data = &*self.corrected(index, data);
        self.pass(index, stamp, data, output)?;
        let Some(route) = self.routes.get_mut(index) else { return Ok(()) };
        self.derived.send_of_learnt(route, data, output)
    }

    /// Sends a message on the port of its role: unchanged, but for maps whose cells have values of another convention.
    /// A map whose origin is undecided is held.
    fn pass(
        &mut self,
        index: usize,
        stamp: Stamp,
        data: &[u8],
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Some(route) = self.routes.get_mut(index) else { return Ok(()) };
        if let Some(merged_maps) = &mut self.merged_maps
            && tf_topic(&route.channel).is_some()
            && (is_static(&route.channel.topic) || route.messages < FIRST_TRANSFORMS)
            && let Ok(transforms) = decode::<TFMessage>(data)
        {
            merged_maps.add_transforms(&transforms);
        }
        match route.role {
            Role::Map => {
                self.pass_map(index, stamp, data, self.holds_undecided, output)?;
                self.pass_undecided(true, output)
            }
            Role::Tags => {
                if let Ok(TagRange { range, .. }) = decode(data) {
                    self.derived.note_range(&route.channel.topic, range, output);
                }
                route.send(stamp, data, &output.tags, output.log_time())
            }
            Role::Topology => route.send(stamp, data, &output.topology, output.log_time()),
            Role::MapUpdate
            | Role::Pose(_)
            | Role::Odometry
            | Role::TagMessage
            | Role::Scan
            | Role::Tf
            | Role::Other => route.send(stamp, data, &output.other, output.log_time()),
        }
    }

    fn pass_map(
        &mut self,
        index: usize,
        stamp: Stamp,
        data: &[u8],
        may_hold: bool,
        output: &Output<RobotMessages>,
    ) -> Result<(), StageError> {
        let Some(route) = self.routes.get_mut(index) else { return Ok(()) };
        let (topic, log_time) = (&route.channel.topic, output.log_time());
        // One that cannot be read shows nothing of the others.
        let header = decode::<Header>(data).ok();
        let merged_maps = self.merged_maps.as_mut().zip(header);
        let origin = merged_maps.map(|(maps, header)| maps.origin(&route.robot, &header.frame_id, &self.roles));
        match origin {
            Some(MapOrigin::Undecided) if may_hold => {
                self.undecided.retain(|(held, ..)| *held != index);
                self.undecided.push((index, stamp, data.to_vec()));
                Ok(())
            }
            Some(MapOrigin::Merged) => {
                // Live there is no such option.
                let option = self.holds_undecided.then(|| self.roles.robots_option(None));
                if self.noted.insert((topic.clone(), Peculiarity::Merged)) {
                    output.warn(left_out(topic, option.as_deref()));
                }
                route.send(stamp, data, &output.other, log_time)
            }
            _ => {
                if origin == Some(MapOrigin::Doubtful)
                    && self.holds_undecided
                    && self.noted.insert((topic.clone(), Peculiarity::Doubtful))
                {
                    output.warn(doubtful(topic, &route.robot, &self.roles.robots_option(Some(&route.robot))));
                }
                for (peculiarity, found) in peculiarities(data, self.map_values, route.messages) {
                    if self.noted.insert((topic.clone(), peculiarity)) {
                        output.warn(format!("maps on `{topic}`: {found}"));
                    }
                }
                match self.map_values.translate(data) {
                    Some((translated, notes)) => {
                        notes.iter().for_each(|note| output.warn(format!("maps on `{topic}`: {note}")));
                        route.send(stamp, &translated, &output.map, log_time)
                    }
                    None => route.send(stamp, data, &output.map, log_time),
                }
            }
        }
    }

    /// Sends the held maps whose origin is decided; all of them if they may be held no longer.
    pub(super) fn pass_undecided(&mut self, may_hold: bool, output: &Output<RobotMessages>) -> Result<(), StageError> {
        let undecided = std::mem::take(&mut self.undecided);
        undecided.iter().try_for_each(|(index, stamp, data)| self.pass_map(*index, *stamp, data, may_hold, output))
    }

    /// Returns the index of a channel's route, and adds the route if there is none. `None`, with a warning, if the
    /// topic's name is too long.
    pub(super) fn add(&mut self, channel: Channel, output: &Output<RobotMessages>) -> Option<usize> {
        if let Some(&index) = self.by_channel.get(&channel) {
            return Some(index);
        }
        let index = self.routes.len();
        let classified = self.roles.classify(&channel);
        let topic = match FixedText::new(&channel.topic) {
            Ok(topic) => topic,
            Err(error) => {
                output.warn(format!("messages on a topic were dropped: its name {error}"));
                return None;
            }
        };
        if let Some(mismatch) = classified.mismatch {
            output.warn(mismatch);
        }
        if let Some(note) =
            self.roles.lidar_note(&channel).filter(|_| classified.role == Role::Scan && output.scans.is_read())
        {
            output.warn(note);
        }
        // A message that is passed on unchanged needs no robot.
        let robot = FixedText::new(classified.robot).unwrap_or_default();
        let header = MessageHeader {
            // 0 is the channel of messages that no log describes.
            channel: index as u32 + 1,
            robot,
            topic,
            ..Default::default()
        };
        let (role, robot) = (classified.role, classified.robot.to_owned());
        let latch = Latch::of(&channel, role == Role::Map);
        let tag_reader = self.roles.tag_reader(&channel).filter(|_| role == Role::TagMessage);
        self.routes.push(Route {
            channel: self.announced(&channel),
            role,
            robot,
            tag_reader,
            header,
            latch,
            announced: false,
            messages: 0,
            unreadable: 0,
        });
        self.by_channel.insert(channel, index);
        Some(index)
    }
}
