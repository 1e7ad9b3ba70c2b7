//! The verb `doctor`: what robots there are on the network, and what is missing for a merge.

use super::advice::Findings;
use super::definitions::Definitions;
use super::discovery::doctor_subscriptions::DoctorSubscriptions;
use super::discovery::node_identity::NodeIdentity;
use super::discovery::publishers::{DiscoveredPublishers, Published, Topics};
use super::discovery::running_merges::RunningMerges;
use super::key_expression::{NO_HASH, Topic};
use super::node::Node;
use super::qos::Qos;
use super::source_parameters::SourceParameters;
use anyhow::{Result, bail};
use gridweave::Verb;
use gridweave::table::Table;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::stage::{Parameters, RobotTopics};
use std::fmt::Write;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// The interval between two checks for topics to subscribe to.
const PERIOD: Duration = Duration::from_millis(100);

/// The verb `doctor`.
pub fn doctor() -> Verb {
    Verb {
        name: "doctor",
        about: "Show which robots are on the ROS 2 network, what they publish, and what is missing for a merge",
        look,
    }
}

fn look(parameters: toml::Table, longest: Duration) -> Result<String> {
    let parameters: SourceParameters = parameters.try_into()?;
    if let Some(wrong) = parameters.check_together().first() {
        bail!("{wrong}");
    }
    let definitions = Definitions::new(&parameters.definitions);
    let name = NodeIdentity::of_program("doctor", parameters.node.as_ref());
    let mut node = Node::start(parameters.connection(), name.clone())?;
    let publishers = Arc::<Mutex<DiscoveredPublishers>>::default();
    let merges = Arc::<Mutex<RunningMerges>>::default();
    let (to, to_merges, own) = (Arc::clone(&publishers), Arc::clone(&merges), name.node.clone());
    node.watch(move |middleware, entity, is_there| {
        let owner = name.owner(&entity);
        to_merges.lock().unwrap_or_else(PoisonError::into_inner).note(&entity, owner, is_there);
        to.lock().unwrap_or_else(PoisonError::into_inner).note(middleware, entity, owner, is_there);
    })?;
    let topics = || publishers.lock().unwrap_or_else(PoisonError::into_inner).topics();
    let (robots, until) = (RobotTopics::default(), Instant::now() + longest);
    let mut subscriptions = DoctorSubscriptions::default();
    // Nodes announce themselves again and again.
    while let Some(rest) = until.checked_duration_since(Instant::now()) {
        subscriptions.subscribe(&mut node, &topics(), &robots)?;
        thread::sleep(rest.min(PERIOD));
    }
    let mut topics = topics();
    let mut text = networks(&node);
    write_topics(&mut text, &topics, &definitions)?;
    remove_unreadable(&mut topics, &definitions);
    let findings = Findings::new(&topics, &robots);
    let running = merges.lock().unwrap_or_else(PoisonError::into_inner).text(&read_topics(&findings, &robots), &own);
    write_robots(&mut text, &findings, running, &subscriptions, &robots)?;
    for problem in node.take_problems() {
        writeln!(text, "warning: {problem}")?;
    }
    Ok(text)
}

/// The topic by which a merge reads each robot.
fn read_topics(findings: &Findings, robots: &RobotTopics) -> Vec<(String, String)> {
    let with_maps = findings.maps.keys().map(|robot| (robot.clone(), robots.map.replace("{robot}", robot)));
    let scanning = findings.scanning.keys().map(|robot| (robot.clone(), robots.scan.replace("{robot}", robot)));
    with_maps.chain(scanning).collect()
}

/// Where it was looked.
fn networks(node: &Node) -> String {
    let zenoh = match (node.has_zenoh(), node.looks_for_router()) {
        (false, _) => "",
        (true, None) => "Zenoh",
        (true, Some(_)) => "Zenoh, where no router answers",
    };
    let dds = if node.has_dds() { "DDS" } else { "" };
    let both: Vec<&str> = [dds, zenoh].into_iter().filter(|name| !name.is_empty()).collect();
    format!("domain {}, over {}\n", node.domain(), both.join(" and "))
}

fn write_topics(text: &mut String, topics: &Topics, definitions: &Definitions) -> std::fmt::Result {
    if topics.is_empty() {
        return writeln!(text, "nobody publishes anything");
    }
    let mut table = Table::new(["topic", "type", "over", "QoS", "published by"]);
    let mut others = Vec::new();
    for (name, of_topic) in topics {
        for published in of_topic {
            let Qos { is_reliable, is_latched, .. } = published.qos;
            let qos = [
                if is_reliable { "reliable" } else { "best effort" },
                if is_latched { "transient local" } else { "volatile" },
            ];
            let Published { ros_type, middleware, nodes, .. } = published;
            table.row([name.clone(), ros_type.clone(), middleware.to_string(), qos.join(", "), nodes.join(", ")]);
            if has_other_definition(&published.topic(name), definitions) {
                others.push(format!(
                    "warning: `{name}` has another definition of {ros_type} than the one known here: its messages are not taken"
                ));
            }
        }
    }
    writeln!(text, "\n{table}")?;
    others.iter().try_for_each(|other| writeln!(text, "{other}"))
}

/// Whether the type of a topic has another definition than the one that is known here.
fn has_other_definition(topic: &Topic, definitions: &Definitions) -> bool {
    topic.type_hash != NO_HASH && definitions.hash(topic).is_some_and(|here| here != topic.type_hash)
}

/// Leaves out what no run takes.
fn remove_unreadable(topics: &mut Topics, definitions: &Definitions) {
    for (name, of_topic) in &mut *topics {
        of_topic.retain(|published| !has_other_definition(&published.topic(name), definitions));
    }
    topics.retain(|_, of_topic| !of_topic.is_empty());
}

/// Says which robots have a map, what is missing for a merge, and what to write; or which are merged by a run that is
/// `running`.
fn write_robots(
    text: &mut String,
    findings: &Findings,
    running: Option<String>,
    subscriptions: &DoctorSubscriptions,
    robots: &RobotTopics,
) -> std::fmt::Result {
    for (topic, nodes) in &findings.merged {
        match nodes.as_slice() {
            [node] => writeln!(text, "`{topic}` of {node} is a map that a run of Gridweave publishes, and no robot's")?,
            all => writeln!(
                text,
                "warning: {} runs of Gridweave publish `{topic}`, by {}: end all but one",
                all.len(),
                list_in_words(all)
            )?,
        }
    }
    for (robot, nodes) in &findings.maps {
        let seen = subscriptions.map(&robots.map.replace("{robot}", robot));
        writeln!(text, "{robot} has a map, {seen}{}", subscriptions.tree(robot))?;
        if nodes.len() > 1 {
            let (count, nodes) = (nodes.len(), list_in_words(nodes));
            writeln!(text, "warning: {robot} has {count} maps, of {nodes}: are there two robots of one name?")?;
        }
    }
    for (robot, moves) in &findings.scanning {
        let lack = if *moves { "" } else { ", and no odometry, poses or tf" };
        writeln!(text, "{robot} has scans and no map{lack}{}", subscriptions.tree(robot))?;
    }
    if let Some(tree) = subscriptions.shared_tree() {
        writeln!(text, "{tree}")?;
    }
    for (topic, ros_type) in &findings.wrong_types {
        writeln!(text, "warning: `{topic}` is no map, but {ros_type}")?;
    }
    let (with_map, with_scans) = (findings.maps.len(), findings.scanning.len());
    match (running, with_map + with_scans >= 2, with_scans) {
        (Some(running), ..) => writeln!(text, "{running}")?,
        (None, true, 0) => writeln!(text, "to merge these: gridweave-ros run live_ros")?,
        (None, true, _) => {
            writeln!(text, "to merge these, with maps drawn of scans: gridweave-ros run live_ros_scans")?
        }
        (None, false, _) => {
            writeln!(text, "for a merge two robots must publish a map on `{}`; there are {with_map}", robots.map)?
        }
    }
    let is_said = with_map + with_scans >= 2;
    findings.advice(is_said).iter().try_for_each(|advice| writeln!(text, "{advice}"))
}

#[cfg(test)]
mod tests {
    use super::super::discovery::node_identity::Owner;
    use super::super::liveliness::{Entity, Kind};
    use super::super::middleware::Middleware;
    use super::*;
    use gridweave_runtime::ros::{OccupancyGrid, RosMessage};

    #[test]
    fn a_map_whose_type_has_another_definition_is_no_map_of_a_robot() {
        let mut publishers = DiscoveredPublishers::default();
        let known = Topic::known("/robot1/map", OccupancyGrid::NAME).unwrap();
        for (number, type_hash) in [known.type_hash.as_str(), NO_HASH, "RIHS01_00"].into_iter().enumerate() {
            let topic = Topic { name: format!("/robot{number}/map"), type_hash: type_hash.to_owned(), ..known.clone() };
            let entity = Entity {
                domain: 0,
                session: "a".into(),
                node_number: 0,
                number: number as u32,
                enclave: "/".into(),
                namespace: format!("/robot{number}"),
                node: "slam".into(),
                kind: Kind::Publisher(topic, Qos::reliable(1)),
            };
            publishers.note(Middleware::Dds, entity, Owner::Other, true);
        }
        let mut topics = publishers.topics();
        remove_unreadable(&mut topics, &Definitions::new(&[]));
        let findings = Findings::new(&topics, &RobotTopics::default());
        assert_eq!(findings.maps.keys().collect::<Vec<_>>(), ["robot0", "robot1"]);
    }
}
