//! Data that are valid from the beginning of a log although they are logged later: the mounts of sensors, and the frames
//! of maps.
//!
//! A program that joins a live robot receives the static transforms and the last map before anything else. A recorder
//! writes them when they come: a driver that starts after its robot, or a map that is first published after a minute,
//! would leave what was recorded before it without a mount or a map frame.

use super::channel_router::ChannelRouter;
use crate::names::Names;
use crate::reader::{ChannelPart, LogFile, LogReader};
use crate::robots::Role;
use crate::tf::{is_static, tf_topic};
use gridweave_runtime::ros::{Header, TFMessage, decode};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Teaches `router` the static transforms of the files, the first transforms of others, and the frames of the first
/// maps.
pub(super) fn learn_ahead(files: &Arc<[LogFile]>, names: &Names, router: &mut ChannelRouter) {
    let needs_frames = router.needs_frames() || router.seeks_merged_maps();
    // Whoever writes transforms needs the frames of the maps.
    if !needs_frames && names.channels().all(|channel| tf_topic(channel).is_none()) {
        return;
    }
    let mut wanted = BTreeMap::new();
    for (file, log) in files.iter().enumerate() {
        for (number, _) in log.channels() {
            let Some(channel) = names.channel(file, number).filter(|_| names.wants(file, number)) else { continue };
            let classified = router.roles().classify(channel);
            let ahead = match classified.role {
                Role::Tf if needs_frames && is_static(&channel.topic) => Ahead::StaticTransforms,
                Role::Tf if needs_frames => Ahead::Transforms,
                Role::Map => Ahead::Map,
                _ => continue,
            };
            wanted.insert((file, number), (classified.robot.to_owned(), ahead));
        }
    }
    let mut reader = LogReader::of(Arc::clone(files));
    reader.limit_to(|file, number| match wanted.get(&(file, number))? {
        (_, Ahead::StaticTransforms) => Some(ChannelPart::Whole),
        (_, Ahead::Transforms | Ahead::Map) => Some(ChannelPart::Beginning),
    });
    // The first transform is valid from the beginning; a later one is read when it comes.
    let mut placed = BTreeSet::new();
    let mut renamed = Vec::new();
    while let Some(message) = reader.next_message() {
        let Some((robot, ahead)) = wanted.get(&(message.file, message.channel)) else { continue };
        let data = names.named(&message, &mut renamed);
        if *ahead == Ahead::Map {
            if let Ok(header) = decode::<Header>(data) {
                router.learn_map_frame(robot, &header.frame_id);
            }
        } else if let Ok(mut message) = decode::<TFMessage>(data) {
            message.transforms.retain(|edge| placed.insert((robot.clone(), edge.child_frame_id.clone())));
            router.learn_transforms(robot, *ahead == Ahead::StaticTransforms, &message);
        }
    }
}

/// The data of a channel that are read ahead.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ahead {
    /// Transforms that hold for the whole log.
    StaticTransforms,
    /// Transforms that hold for a while.
    Transforms,
    /// The frame of a map.
    Map,
}
