//! The transforms, as a program receives them that subscribes to all.

use super::*;
use proptest::prelude::*;
use std::collections::BTreeMap;

/// Static transforms as a reader keeps them: the last of each frame, which has one parent for good.
#[derive(Default)]
struct Buffer {
    /// By child: the parent, and the pose of the child in it.
    edges: BTreeMap<String, (String, Pose2)>,
}

impl Buffer {
    /// Receives what was sent since the last call.
    fn listen(&mut self, run: &mut Run) {
        for one in run.stage.take::<TFMessage>("tf").unwrap().into_iter().flat_map(|message| message.transforms) {
            let (parent, place) = (one.header.frame_id, one.transform.planar());
            if let Some((before, _)) = self.edges.insert(one.child_frame_id.clone(), (parent.clone(), place)) {
                assert_eq!(before, parent, "{} has another parent", one.child_frame_id);
            }
        }
    }

    /// The root above a frame, and the pose of the frame in it.
    fn root(&self, frame: &str) -> (String, Pose2) {
        match self.edges.get(frame) {
            None => (frame.to_owned(), Pose2::identity()),
            Some((parent, place)) => {
                let (root, above) = self.root(parent);
                (root, above * place)
            }
        }
    }

    #[track_caller]
    fn assert_at(&self, frame: &str, root: &str, place: &Pose2) {
        let (found, pose) = self.root(frame);
        assert_eq!(found, root, "{frame}");
        assert!(is_near(&pose, place, 1e-9), "{frame}: {pose} and not {place}");
    }
}

#[test]
fn a_robot_that_is_the_reference_for_a_while_only_is_not_in_the_world() {
    let (mut run, mut buffer) = (Run::new(None), Buffer::default());
    run.map("robot2", "map");
    run.map("robot1", "map");
    run.finish().unwrap();
    buffer.listen(&mut run);
    buffer.assert_at("robot1/map", "world", &place(1));
    assert_eq!(buffer.root("robot2/map").0, "robot2/map");
}

#[test]
fn a_robot_that_has_been_in_the_world_is_sent_in_no_other_tree() {
    let (mut run, mut buffer) = (Run::new(None), Buffer::default());
    run.align(&between(1, 2));
    run.align(&between(2, 3));
    buffer.listen(&mut run);
    run.align(&refused("robot1", "robot2", 0.1, "the larger maps disagree"));
    run.align(&between(3, 4));
    run.finish().unwrap();
    buffer.listen(&mut run);
    buffer.assert_at("robot3/map", "world", &place(3));
    assert_eq!(buffer.root("robot4/map").0, "world/robot2");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// The buffer checks that no frame ever changes its parent.
    #[test]
    fn merged_robots_are_in_the_world_whatever_was_sent_before(
        statements in prop::collection::vec((1..7_usize, 1..7_usize, 0..4), 1..25),
    ) {
        let (mut run, mut buffer) = (Run::new(None), Buffer::default());
        for (a, b, kind) in statements {
            match (a == b, kind) {
                (true, _) => run.map(&format!("robot{a}"), "map"),
                (_, 0) => run.align(&refused(&format!("robot{}", a.min(b)), &format!("robot{}", a.max(b)), 0.1, "no")),
                _ => run.align(&between(a.min(b), a.max(b))),
            }
            buffer.listen(&mut run);
            let Some(frames) = run.latest().filter(|frames| frames.frames.len() > 1) else { continue };
            for frame in &frames.frames {
                buffer.assert_at(&frame.frame_id, "world", &frame.transform_reference_robot());
            }
        }
        run.finish().unwrap();
        buffer.listen(&mut run);
        for frame in run.latest().into_iter().flat_map(|frames| frames.frames) {
            buffer.assert_at(&frame.frame_id, "world", &frame.transform_reference_robot());
        }
    }
}
