//! How sensors are mounted on their robots, by tf.

use super::inferred_poses::BASES;
use crate::tf::FrameTree;
use gridweave_runtime::ros::Transform;
use nalgebra::Isometry3;

/// The frames of robots, and what the bases among them are called.
#[derive(Clone, Debug)]
pub(super) struct Mounts {
    tree: FrameTree,
    /// What the base of a robot is called, `{robot}` standing for its name. The first that is tied to a sensor counts.
    bases: Vec<String>,
}

/// The frame of a sensor is not tied to its robot.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Untied;

impl Mounts {
    /// For robots whose base is called `base`, or as most are.
    pub(super) fn new(base: Option<&str>) -> Self {
        let usual = || BASES.map(|base| format!("{{robot}}{base}")).to_vec();
        Self { tree: FrameTree::default(), bases: base.map_or_else(usual, |base| vec![base.to_owned()]) }
    }

    /// Takes up how a frame lies in its parent.
    pub(super) fn insert(&mut self, parent: &str, child: &str, transform: &Transform, is_static: bool) {
        self.tree.insert(parent, child, transform, is_static);
    }

    /// The frame of a robot's base, and how the frame of a sensor lies in it.
    pub(super) fn mount(&self, robot: &str, frame: &str) -> Result<(String, Isometry3<f64>), Untied> {
        let tied = |base: &String| {
            let base = base.replace("{robot}", robot);
            let transform_base_sensor = self.tree.lookup(&base, frame)?;
            Some((base, transform_base_sensor))
        };
        self.bases.iter().find_map(tied).ok_or(Untied)
    }
}
