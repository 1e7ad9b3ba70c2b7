//! What to say where no robot is heard.

use super::node::Node;
use std::time::{Duration, Instant};

/// The time that a router may take to answer before a warning.
const PATIENCE: Duration = Duration::from_secs(3);

/// Whether anybody is heard, and since when that has been so.
pub(crate) struct Silence {
    /// The time without any publisher after which the likely reasons are named.
    discovery_timeout: Duration,
    is_connected: bool,
    since: Instant,
}

impl Silence {
    pub(crate) fn new(discovery_timeout: Duration) -> Self {
        Self { discovery_timeout, is_connected: false, since: Instant::now() }
    }

    /// What to warn of as long as nobody publishes.
    pub(crate) fn warning(&mut self, node: &Node) -> Option<String> {
        let router = node.looks_for_router();
        if node.has_zenoh() && router.is_none() && !self.is_connected {
            (self.is_connected, self.since) = (true, Instant::now());
            tracing::info!("connected");
        }
        let (elapsed, domain) = (self.since.elapsed(), node.domain());
        let is_late = elapsed > self.discovery_timeout;
        match (node.has_dds(), node.has_zenoh(), router) {
            (false, _, Some(routers)) if !self.is_connected && elapsed > PATIENCE => Some(format!(
                "no Zenoh router answers at {routers}: start one with `ros2 run rmw_zenoh_cpp rmw_zenohd`, or name it in `connect`. \
                 It is looked for until it answers"
            )),
            (false, _, None) if is_late => Some(format!(
                "connected, but nobody publishes in the domain {domain}: is the ROS_DOMAIN_ID of the robots another one? Robots on Fast \
                 DDS or Cyclone DDS are heard with `middleware = \"auto\"`, or if they run with RMW_IMPLEMENTATION=rmw_zenoh_cpp"
            )),
            (true, has_zenoh, router) if is_late => {
                let zenoh = match (has_zenoh, router) {
                    (false, _) => String::new(),
                    (true, None) => ", nor over the Zenoh router".to_owned(),
                    (true, Some(routers)) => format!(", and no Zenoh router answers at {routers}"),
                };
                Some(format!(
                    "nobody publishes over DDS in the domain {domain}{zenoh}: is the ROS_DOMAIN_ID of the robots another one, or is \
                     ROS_LOCALHOST_ONLY or ROS_AUTOMATIC_DISCOVERY_RANGE set there or here? Where the network has no multicast, \
                     `static_peers` names the robots' machines{}",
                    not_spoken(|name| std::env::var(name).unwrap_or_default())
                ))
            }
            _ => None,
        }
    }
}

/// What the environment asks of programs of ROS on DDS and is not spoken here.
fn not_spoken(variable: impl Fn(&str) -> String) -> String {
    let mut text = String::new();
    if !variable("ROS_DISCOVERY_SERVER").trim().is_empty() {
        text.push_str(
            ". ROS_DISCOVERY_SERVER is set, and discovery servers are not spoken: robots that use one are not found",
        );
    }
    if variable("ROS_SECURITY_ENABLE") == "true" {
        text.push_str(". ROS_SECURITY_ENABLE is set, and robots with DDS Security are not heard");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_keeps_robots_from_being_heard_is_named() {
        let with = |set: &'static str, value: &'static str| {
            not_spoken(|name| if name == set { value.to_owned() } else { String::new() })
        };
        assert!(with("ROS_DISCOVERY_SERVER", "127.0.0.1:11811").contains("discovery servers are not spoken"));
        assert!(with("ROS_SECURITY_ENABLE", "true").contains("DDS Security"));
        assert_eq!(with("ROS_SECURITY_ENABLE", "false") + &with("ROS_DOMAIN_ID", "5"), "");
    }
}
