//! Discovery of other nodes: what they publish, which of them are of Gridweave, and the warnings about them.

pub(crate) mod doctor_subscriptions;
pub(crate) mod duplicate_publisher_warning;
pub(crate) mod no_robot_warning;
pub(crate) mod node_identity;
pub(crate) mod publishers;
pub(crate) mod running_merges;
pub(crate) mod topics;
