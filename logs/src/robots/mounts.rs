//! How sensors are mounted on their robots, by tf.

use crate::tf::FrameTree;
use gridweave_runtime::ros::Transform;
use nalgebra::Isometry3;

/// The names that the frame of a robot's base has, behind that of the robot. The first that is tied to the map counts.
pub(crate) const BASES: [&str; 4] = ["/base_link", "/base_footprint", "_base_link", "_base_footprint"];

/// The frames of robots, and what the bases among them are called.
#[derive(Clone, Debug)]
pub(crate) struct Mounts {
    tree: FrameTree,
    /// What the base of a robot is called, `{robot}` standing for its name. The first that is tied to a sensor counts.
    bases: Vec<String>,
}

/// The frame of a sensor is not tied to its robot.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Untied;

impl Mounts {
    /// For robots whose base is called `base`, or as most are.
    pub(crate) fn new(base: Option<&str>) -> Self {
        let usual = || BASES.map(|base| format!("{{robot}}{base}")).to_vec();
        Self { tree: FrameTree::default(), bases: base.map_or_else(usual, |base| vec![base.to_owned()]) }
    }

    /// Takes up how a frame lies in its parent.
    pub(crate) fn insert(&mut self, parent: &str, child: &str, transform: &Transform, is_static: bool) {
        self.tree.insert(parent, child, transform, is_static);
    }

    /// The frame of a robot's base, and how the frame of a sensor lies in it.
    pub(crate) fn mount(&self, robot: &str, frame: &str) -> Result<(String, Isometry3<f64>), Untied> {
        let tied = |base: &String| {
            let base = base.replace("{robot}", robot);
            let transform_base_sensor = self.tree.lookup(&base, frame)?;
            Some((base, transform_base_sensor))
        };
        self.bases.iter().find_map(tied).ok_or(Untied)
    }
}
