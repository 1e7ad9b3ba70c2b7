//! The mounting poses of sensors on their robots, from tf.

use crate::tf::FrameTree;
use gridweave_runtime::ros::Transform;
use nalgebra::Isometry3;

/// Usual names of a robot's base frame, without the robot's name. The first that tf connects to the map is used.
pub(crate) const BASES: [&str; 7] =
    ["/base_link", "/base_footprint", "_base_link", "_base_footprint", "/base", "/chassis", "_base"];

/// The tf frames of robots, and the names of their base frames.
#[derive(Clone, Debug)]
pub(crate) struct Mounts {
    tree: FrameTree,
    /// Names of the base frame, in which `{robot}` is replaced by the robot's name. The first that tf connects to the
    /// sensor is used.
    bases: Vec<String>,
}

/// tf has no transform between a sensor and the base of its robot.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct NoTransform;

impl Mounts {
    /// Creates an empty tree for robots with the base frame `base`, or one of the usual names.
    pub(crate) fn new(base: Option<&str>) -> Self {
        let usual = || BASES.map(|base| format!("{{robot}}{base}")).to_vec();
        Self { tree: FrameTree::default(), bases: base.map_or_else(usual, |base| vec![base.to_owned()]) }
    }

    /// Adds a transform to the tree.
    pub(crate) fn insert(&mut self, parent: &str, child: &str, transform: &Transform, is_static: bool) {
        self.tree.insert(parent, child, transform, is_static);
    }

    /// Whether a frame is a base frame of a robot.
    pub(crate) fn is_base(&self, robot: &str, frame: &str) -> bool {
        self.bases.iter().any(|base| base.replace("{robot}", robot) == frame)
    }

    /// The robot's base frame, and the pose of the sensor frame `frame` in it.
    pub(crate) fn mount(&self, robot: &str, frame: &str) -> Result<(String, Isometry3<f64>), NoTransform> {
        let connected = |base: &String| {
            let base = base.replace("{robot}", robot);
            let transform_base_sensor = self.tree.lookup(&base, frame)?;
            Some((base, transform_base_sensor))
        };
        self.bases.iter().find_map(connected).ok_or(NoTransform)
    }
}
