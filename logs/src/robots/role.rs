//! The roles that channels can have.

/// The role of a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Occupancy grids of a robot.
    Map,
    /// Updates of parts of a robot's map.
    MapUpdate,
    /// Poses of a robot.
    Pose(PoseSource),
    /// Odometry of a robot without a pose topic. It gives the robot's poses if its frame is the map frame; scans can be
    /// matched along it in any frame.
    Odometry,
    /// Tag readings of a robot.
    Tags,
    /// Tag readings of a robot in messages of another type, such as those of detectors.
    TagMessage,
    /// Topological maps of a robot.
    Topology,
    /// Scans of a robot without maps.
    Scan,
    /// Transforms, from which poses of robots are derived.
    Tf,
    /// Anything else.
    Other,
}

/// A message type that contains a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PoseSource {
    /// `geometry_msgs/msg/PoseStamped`.
    Pose,
    /// `nav_msgs/msg/Odometry`.
    Odometry,
    /// `geometry_msgs/msg/PoseWithCovarianceStamped`.
    PoseWithCovariance,
}

/// The role of a channel, and the robot that it belongs to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Classified<'a> {
    /// The role.
    pub(crate) role: Role,
    /// The robot; empty if the channel belongs to none.
    pub(crate) robot: &'a str,
    /// Why the role is not the one that the topic suggests.
    pub(crate) mismatch: Option<String>,
}
