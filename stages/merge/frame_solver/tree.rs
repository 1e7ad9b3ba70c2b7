//! The poses of the maps as transforms: a tree in which a frame has one parent for good.

use gridweave_runtime::ros::{Header, RobotFrame, RobotFrames, TFMessage, Transform, TransformStamped};
use std::collections::BTreeMap;

/// Frames that were sent as transforms.
///
/// A reader of static transforms keeps what it received: it drops no frame, and a frame that is sent in two trees connects
/// them. So a frame is sent only in the tree that it stays in. The robots of a group may still be connected with the
/// reference, so they are sent at the end. A robot that has been in the world and no longer is keeps its transform; the
/// frames of the solver say that it is not merged.
#[derive(Debug, Default)]
pub(super) struct Tree {
    /// Parent of every frame that was sent, and its pose in it.
    sent: BTreeMap<String, (String, Transform)>,
}

impl Tree {
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
