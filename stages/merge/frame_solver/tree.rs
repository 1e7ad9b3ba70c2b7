//! The poses of the maps as transforms: a tree in which a frame has one parent for good.

use gridweave_runtime::ros::{Header, RobotFrame, RobotFrames, TFMessage, Transform, TransformStamped};
use std::collections::BTreeMap;

/// What of the frames was told as transforms.
///
/// A reader of static transforms keeps what it was told: it takes back no frame, and joins what was said of a frame in one
/// tree with what it hears of it in another. So a frame is told only in the tree that it stays in. The robots of a group
/// may still be tied to the reference, and are told at the end. A robot that has been in the world and is no longer keeps
/// the transform that was told; the frames of the solver say that it is not merged.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// The parent of every frame that was told, and how it lay in it.
    told: BTreeMap<String, (String, Transform)>,
}

impl Tree {
    /// The transforms to tell: none if all were told as they are. Groups are among them in the `last` ones only.
    pub(super) fn update(&mut self, message: &RobotFrames, last: bool) -> Option<TFMessage> {
        let groups = message.groups.iter().filter(|_| last).map(|group| (&group.frame_id, &group.frames));
        let all = std::iter::once((&message.header.frame_id, &message.frames)).chain(groups);
        let transforms: Vec<TransformStamped> = all
            .flat_map(|(parent, frames)| frames.iter().map(move |frame| transform(&message.header, parent, frame)))
            .filter(|one| self.told.get(&one.child_frame_id).is_none_or(|(parent, _)| *parent == one.header.frame_id))
            .collect();
        let mut is_new = false;
        for one in &transforms {
            let place = (one.header.frame_id.clone(), one.transform);
            is_new |= self.told.insert(one.child_frame_id.clone(), place.clone()) != Some(place);
        }
        is_new.then_some(TFMessage { transforms })
    }
}

fn transform(header: &Header, parent: &str, frame: &RobotFrame) -> TransformStamped {
    TransformStamped {
        header: Header { stamp: header.stamp, frame_id: parent.to_owned() },
        child_frame_id: frame.frame_id.clone(),
        transform: frame.transform_reference_robot().into(),
    }
}
