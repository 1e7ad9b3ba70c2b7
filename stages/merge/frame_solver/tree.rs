//! The poses of the maps as transforms: a tree in which a frame has one parent for good.

use gridweave_runtime::ros::{Header, RobotFrame, RobotFrames, TFMessage, Transform, TransformStamped};
use std::collections::BTreeMap;

/// Frames that were sent as transforms.
///
/// A reader of static transforms keeps what it received: it drops no frame, and a frame that is sent in two trees
/// connects them. So a frame is sent only in the tree that it stays in. The robots of a group may still be connected
/// with the reference, so they are sent at the end. A robot that has been in the world and no longer is keeps its
/// transform; the frames of the solver say that it is not merged.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// Parent of every frame that was sent, and its pose in it.
    sent: BTreeMap<String, (String, Transform)>,
}

impl Tree {
    /// The first transform, with which the world is known before any robot is in it: from the frame `header` names to a
    /// child of its own at the same place. None if anything was sent before.
    pub(super) fn open(&mut self, header: &Header) -> Option<TFMessage> {
        if !self.sent.is_empty() {
            return None;
        }
        let world = &header.frame_id;
        let origin = RobotFrame { frame_id: format!("{world}_origin"), ..Default::default() };
        let transform = transform(header, world, &origin);
        self.sent.insert(origin.frame_id, (world.clone(), transform.transform));
        Some(TFMessage { transforms: vec![transform] })
    }

    /// The transforms to send; none if all were sent before. Groups are included in the `last` ones only.
    pub(super) fn update(&mut self, message: &RobotFrames, last: bool) -> Option<TFMessage> {
        let groups = message.groups.iter().filter(|_| last).map(|group| (&group.frame_id, &group.frames));
        let all = std::iter::once((&message.header.frame_id, &message.frames)).chain(groups);
        let transforms: Vec<TransformStamped> = all
            .flat_map(|(parent, frames)| frames.iter().map(move |frame| transform(&message.header, parent, frame)))
            .filter(|one| self.sent.get(&one.child_frame_id).is_none_or(|(parent, _)| *parent == one.header.frame_id))
            .collect();
        let mut is_new = false;
        for one in &transforms {
            let pose = (one.header.frame_id.clone(), one.transform);
            is_new |= self.sent.insert(one.child_frame_id.clone(), pose.clone()) != Some(pose);
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
