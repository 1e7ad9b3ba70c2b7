//! The warning when no robot is found.

use super::node_identity::Owner;
use super::publishers::DiscoveredPublishers;
use crate::advice::Findings;
use crate::liveliness::Entity;
use crate::middleware::Middleware;
use crate::node::Node;
use gridweave_runtime::stage::RobotTopics;
use std::time::{Duration, Instant};

/// The time that a router may take to answer before a warning.
const PATIENCE: Duration = Duration::from_secs(3);

/// The interval between two checks of the published topics.
const LOOK_PERIOD: Duration = Duration::from_secs(1);

/// Decides when to warn that no robot is found, and names the likely reasons.
pub(crate) struct NoRobotWarning {
    /// The time without any publisher after which the likely reasons are named.
    discovery_timeout: Duration,
    is_connected: bool,
    since: Instant,
    publishers: DiscoveredPublishers,
    /// When the first node outside of Gridweave began to publish.
    published_since: Option<Instant>,
    /// When the published topics were last checked.
    looked: Option<Instant>,
    /// Whether a topic fits the pipeline, or the warning was given.
    is_settled: bool,
}

impl NoRobotWarning {
    pub(crate) fn new(discovery_timeout: Duration) -> Self {
        Self {
            discovery_timeout,
            is_connected: false,
            since: Instant::now(),
            publishers: DiscoveredPublishers::default(),
            published_since: None,
            looked: None,
            is_settled: false,
        }
    }

    /// Records that a publisher of another node has appeared, or has gone.
    pub(crate) fn note(&mut self, middleware: Middleware, entity: Entity, owner: Owner, is_there: bool) {
        self.publishers.note(middleware, entity, owner, is_there);
        if !self.publishers.has_no_robots() {
            self.published_since.get_or_insert_with(Instant::now);
        }
    }

    /// The warning if nodes publish, but no topic of a robot of a pipeline with these topics. `hears_any` is whether the
    /// pipeline receives any topic, and `draws_maps` whether it builds maps from scans.
    pub(crate) fn misfit(&mut self, robots: &RobotTopics, [hears_any, draws_maps]: [bool; 2]) -> Option<String> {
        let is_late = self.published_since.is_some_and(|since| since.elapsed() > self.discovery_timeout);
        let is_due = self.looked.is_none_or(|last| last.elapsed() > LOOK_PERIOD);
        if self.is_settled || !is_late || !is_due {
            return None;
        }
        self.looked = Some(Instant::now());
        let findings = Findings::new(&self.publishers.topics(), robots);
        if !findings.maps.is_empty() || draws_maps && !findings.scanning.is_empty() {
            self.is_settled = true;
            return None;
        }
        let (advice, pattern) = (findings.advice(draws_maps), &robots.map);
        self.is_settled = !advice.is_empty();
        match self.is_settled {
            true => Some(format!("no robot publishes a map on `{pattern}`: {}", advice.join("; "))),
            false if hears_any || self.publishers.has_no_robots() || !findings.wrong_types.is_empty() => None,
            false => Some(format!(
                "no robot publishes a map on `{pattern}`, nor anything else that is taken: `gridweave-ros doctor` lists what there is"
            )),
        }
    }

    /// The warning if no node publishes.
    pub(crate) fn warning(&mut self, node: &Node) -> Option<String> {
        if self.published_since.is_some() {
            return None;
        }
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

/// Settings of ROS on DDS in the environment that are not supported here.
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
    use super::super::publishers::tests::publisher;
    use super::*;
    use gridweave_runtime::ros::{OccupancyGrid, RosMessage};

    #[test]
    fn the_warning_of_publishers_without_a_fitting_topic_comes_once() {
        let map = |topic| publisher(["/robot1", "slam_toolbox"], topic, OccupancyGrid::NAME, 1);
        let (mut no_robot, robots) = (NoRobotWarning::new(Duration::ZERO), RobotTopics::default());
        let warning = |entity: Entity, no_robot: &mut NoRobotWarning| {
            no_robot.note(Middleware::Dds, entity, Owner::Other, true);
            no_robot.looked = None;
            no_robot.published_since = Instant::now().checked_sub(LOOK_PERIOD);
            no_robot.misfit(&robots, [false, false])
        };
        let text = warning(publisher(["/", "a"], "/a", "std_msgs/msg/String", 1), &mut no_robot);
        assert!(text.unwrap().contains("gridweave-ros doctor"));
        let text = warning(map("/map"), &mut no_robot).unwrap();
        assert!(text.contains("-r /map:=map") && text.lines().count() == 1, "{text}");
        assert_eq!(warning(map("/b"), &mut no_robot), None);
        let mut no_robot = NoRobotWarning::new(Duration::ZERO);
        assert_eq!(warning(map("/robot1/map"), &mut no_robot), None);
        assert!(no_robot.is_settled);
    }

    #[test]
    fn settings_that_are_not_supported_are_named() {
        let with = |set: &'static str, value: &'static str| {
            not_spoken(|name| if name == set { value.to_owned() } else { String::new() })
        };
        assert!(with("ROS_DISCOVERY_SERVER", "127.0.0.1:11811").contains("discovery servers are not spoken"));
        assert!(with("ROS_SECURITY_ENABLE", "true").contains("DDS Security"));
        assert_eq!(with("ROS_SECURITY_ENABLE", "false") + &with("ROS_DOMAIN_ID", "5"), "");
    }
}
