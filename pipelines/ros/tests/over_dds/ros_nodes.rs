//! The whole command among real nodes of ROS 2.
