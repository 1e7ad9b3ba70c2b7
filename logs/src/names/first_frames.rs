//! The frames at the beginning of logs: those of the first messages of channels, and of the first transforms.

use super::SharedFrames;
use crate::reader::{ChannelPart, LogFile, LogReader};
use gridweave_runtime::ros::{Header, TFMessage, decode};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The number of messages in which frames are looked for, as the first blocks of a log may hold many.
const SEARCHED: usize = 20_000;
/// The number of transforms that are followed from one frame to another, as in tf2.
const LONGEST_PATH: usize = 1000;

/// The messages of a channel in which frames are looked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Holds {
    /// Messages with a header, of which those at the beginning are read.
    Header,
    /// Transforms that move.
    Transforms,
    /// Static transforms, which are all read, wherever in the log they are.
    StaticTransforms,
}

/// The frames at the beginning of the logs of an input.
#[derive(Clone, Debug, Default)]
pub(super) struct FirstFrames {
    /// By channel, which is the index of a file and a number in it.
    of_channel: BTreeMap<(usize, u16), BTreeSet<String>>,
    /// The parent of each frame in transforms.
    parents: BTreeMap<String, String>,
}

impl FirstFrames {
    /// Reads the frames of some channels, by input, where `input_of` is the index of the input that each file belongs
    /// to.
    pub(super) fn read(
        files: &Arc<[LogFile]>,
        input_of: &[usize],
        wanted: &BTreeMap<(usize, u16), Holds>,
    ) -> BTreeMap<usize, Self> {
        let mut found: BTreeMap<usize, Self> = BTreeMap::new();
        if wanted.is_empty() {
            return found;
        }
        let mut reader = LogReader::of(Arc::clone(files));
        reader.limit_to(|file, number| match wanted.get(&(file, number))? {
            Holds::Header | Holds::Transforms => Some(ChannelPart::Beginning),
            Holds::StaticTransforms => Some(ChannelPart::Whole),
        });
        for _ in 0..SEARCHED {
            let Some(message) = reader.next_message() else { break };
            let channel = (message.file, message.channel);
            let (Some(holds), Some(input)) = (wanted.get(&channel), input_of.get(message.file)) else { continue };
            let frames = found.entry(*input).or_default();
            match holds {
                Holds::Header => {
                    if let Ok(Header { frame_id, .. }) = decode(message.data) {
                        let frame = SharedFrames::plain(&frame_id).to_owned();
                        frames.of_channel.entry(channel).or_default().insert(frame);
                    }
                }
                Holds::Transforms | Holds::StaticTransforms => {
                    let transforms = decode::<TFMessage>(message.data).map(|message| message.transforms);
                    for one in transforms.unwrap_or_default() {
                        let [child, parent] =
                            [&one.child_frame_id, &one.header.frame_id].map(|frame| SharedFrames::plain(frame));
                        frames.parents.insert(child.to_owned(), parent.to_owned());
                    }
                }
            }
        }
        found
    }

    /// The frames of the first messages on a channel.
    pub(super) fn of(&self, channel: (usize, u16)) -> impl Iterator<Item = &str> {
        self.of_channel.get(&channel).into_iter().flatten().map(String::as_str)
    }

    /// A frame, and those that transforms connect it to on the way to the root.
    pub(super) fn path<'a>(&'a self, frame: &'a str) -> impl Iterator<Item = &'a str> {
        let parent = |frame: &&'a str| self.parents.get(*frame).map(String::as_str);
        std::iter::successors(Some(frame), parent).take(self.parents.len().min(LONGEST_PATH) + 1)
    }

    /// The transforms, each as the names of parent and child.
    pub(super) fn edges(&self) -> impl Iterator<Item = (&str, &str)> {
        self.parents.iter().map(|(child, parent)| (parent.as_str(), child.as_str()))
    }
}
