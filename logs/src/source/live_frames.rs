//! Which robots the frames in transforms of all robots follow, learnt while maps and transforms come.

use crate::names::SharedFrames;
use gridweave_runtime::ros::{Header, TFMessage, decode};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

/// The maximum numbers of static messages that are kept, and of edges: more than programs of robots have.
const MAX_STATIC: usize = 256;
const MAX_EDGES: usize = 4096;

/// The frames in the transforms of all robots. A log shows all of its maps and transforms from the start;
/// live they come one by one.
#[derive(Debug, Default)]
pub(super) struct LiveFrames {
    /// The frame of the last map of each robot.
    maps: BTreeMap<String, String>,
    /// Parents and children.
    edges: BTreeSet<(String, String)>,
    shared: Option<Arc<SharedFrames>>,
    /// The static messages, each with its channel: they are sent once, maybe before the maps.
    kept: VecDeque<(usize, Vec<u8>)>,
}

impl LiveFrames {
    /// The frames so far; `None` if no frame is to be renamed.
    pub(super) fn shared(&self) -> Option<&Arc<SharedFrames>> {
        self.shared.as_ref()
    }

    /// The static messages that have come, each with its channel.
    pub(super) fn kept(&self) -> impl Iterator<Item = &(usize, Vec<u8>)> {
        self.kept.iter()
    }

    /// Learns the frame of a robot's map. Returns whether that changes what is known.
    pub(super) fn note_map(&mut self, robot: &str, map: &[u8]) -> bool {
        let Ok(Header { frame_id, .. }) = decode(map) else { return false };
        let frame = SharedFrames::plain(&frame_id);
        if self.maps.get(robot).is_some_and(|known| known == frame) {
            return false;
        }
        self.maps.insert(robot.to_owned(), frame.to_owned());
        self.update()
    }

    /// Learns the frames in transforms of all robots. Returns whether that changes what is known.
    pub(super) fn note_transforms(&mut self, channel: usize, is_static: bool, message: &[u8]) -> bool {
        let Ok(transforms) = decode::<TFMessage>(message) else { return false };
        if is_static && !self.kept.iter().any(|(of, kept)| *of == channel && kept == message) {
            if self.kept.len() == MAX_STATIC {
                self.kept.pop_front();
            }
            self.kept.push_back((channel, message.to_vec()));
        }
        let before = self.edges.len();
        for one in &transforms.transforms {
            let (parent, child) = (SharedFrames::plain(&one.header.frame_id), SharedFrames::plain(&one.child_frame_id));
            if self.edges.len() < MAX_EDGES {
                self.edges.insert((parent.to_owned(), child.to_owned()));
            }
        }
        self.edges.len() > before && self.update()
    }

    fn update(&mut self) -> bool {
        if self.maps.is_empty() {
            return false;
        }
        let maps = self.maps.iter().map(|(robot, frame)| (robot.clone(), frame.clone()));
        let shared = SharedFrames::of(maps, &self.edges);
        let has_changed = shared.as_ref() != self.shared.as_deref();
        if has_changed {
            self.shared = shared.map(Arc::new);
        }
        has_changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::message::LogTime;
    use gridweave_runtime::ros::{OccupancyGrid, TransformStamped, encode};

    fn map_in(frame: &str) -> Vec<u8> {
        encode(&OccupancyGrid { header: Header::new(LogTime(1), frame), ..Default::default() }).unwrap()
    }

    fn edge(parent: &str, child: &str) -> Vec<u8> {
        let header = Header::new(LogTime(1), parent);
        let one = TransformStamped { header, child_frame_id: child.to_owned(), ..Default::default() };
        encode(&TFMessage { transforms: vec![one] }).unwrap()
    }

    #[test]
    fn what_is_known_changes_with_each_map_frame_and_with_what_ties_it() {
        let mut frames = LiveFrames::default();
        assert!(!frames.note_transforms(0, false, &edge("map", "a/base_link")) && frames.shared().is_none());
        assert!(frames.note_map("a", &map_in("map")) && frames.note_map("b", &map_in("/map")));
        assert!(!frames.note_map("a", &map_in("map")), "known");
        let renamed =
            |frames: &LiveFrames| frames.shared().and_then(|shared| shared.renamed(&edge("map", "a/base_link")));
        assert_eq!(renamed(&frames), Some(edge("a/map", "a/base_link")));
        // `map` is another frame than that of its map.
        assert!(frames.note_transforms(0, true, &edge("map", "a/map")));
        assert_eq!(renamed(&frames), None);
    }

    #[test]
    fn what_programs_send_without_end_is_kept_within_bounds() {
        let mut frames = LiveFrames::default();
        for number in 0..MAX_EDGES + 10 {
            frames.note_transforms(0, true, &edge("map", &format!("frame{number}")));
        }
        assert_eq!((frames.edges.len(), frames.kept().count()), (MAX_EDGES, MAX_STATIC));
        assert!(!frames.note_map("a", b"no map") && !frames.note_transforms(0, true, b"none"));
    }
}
