//! The verb `doctor`: what robots there are on the network, and what is missing for a merge.

use super::definitions::Definitions;
use super::key_expression::NO_HASH;
use super::liveliness::{Entity, Kind};
use super::middleware::Middleware;
use super::node::Node;
use super::qos::Qos;
use super::source_parameters::SourceParameters;
use anyhow::{Result, bail};
use gridweave::Verb;
use gridweave::table::Table;
use gridweave_logs::names::rename_advice;
use gridweave_runtime::ros::{OccupancyGrid, RosMessage};
use gridweave_runtime::stage::{Parameters, RobotTopics, match_robot};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// The topics of every node, whatever it does.
const OF_EVERY_NODE: [&str; 2] = ["/rosout", "/parameter_events"];

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
    let node = Node::start(parameters.connection(), "doctor")?;
    let seen = Arc::<Mutex<BTreeSet<(Middleware, Entity)>>>::default();
    let to = Arc::clone(&seen);
    node.watch(move |middleware, entity, is_there| {
        let mut seen = to.lock().unwrap_or_else(PoisonError::into_inner);
        match is_there {
            true => seen.insert((middleware, entity)),
            false => seen.remove(&(middleware, entity)),
        };
    })?;
    // Who is there says so again and again.
    thread::sleep(longest);
    let seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
    let topics = published(&seen);
    let mut text = networks(&node);
    write_topics(&mut text, &topics, &definitions)?;
    write_advice(&mut text, &topics)?;
    for problem in node.take_problems() {
        writeln!(text, "warning: {problem}")?;
    }
    Ok(text)
}

/// A published topic.
struct Published {
    ros_type: String,
    type_hash: String,
    middleware: Middleware,
    qos: Qos,
    nodes: Vec<String>,
}

/// What is published, by topic; several for one topic where types, QoS or middlewares differ.
fn published(seen: &BTreeSet<(Middleware, Entity)>) -> BTreeMap<String, Vec<Published>> {
    let mut topics = BTreeMap::<String, Vec<Published>>::new();
    for (middleware, entity) in seen {
        let Kind::Publisher(topic, qos) = &entity.kind else { continue };
        if OF_EVERY_NODE.contains(&topic.name.as_str()) {
            continue;
        }
        let of_topic = topics.entry(topic.name.clone()).or_default();
        let is_same = |known: &&mut Published| {
            (&known.ros_type, &known.type_hash, known.middleware) == (&topic.ros_type, &topic.type_hash, *middleware)
                && (known.qos.is_reliable, known.qos.is_latched) == (qos.is_reliable, qos.is_latched)
        };
        match of_topic.iter_mut().find(is_same) {
            Some(known) => known.nodes.push(entity.full_node_name()),
            None => of_topic.push(Published {
                ros_type: topic.ros_type.clone(),
                type_hash: topic.type_hash.clone(),
                middleware: *middleware,
                qos: *qos,
                nodes: vec![entity.full_node_name()],
            }),
        }
    }
    topics
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

fn write_topics(
    text: &mut String,
    topics: &BTreeMap<String, Vec<Published>>,
    definitions: &Definitions,
) -> std::fmt::Result {
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
            let topic = super::key_expression::Topic {
                name: name.clone(),
                ros_type: ros_type.clone(),
                type_hash: published.type_hash.clone(),
            };
            let has_other_hash = |here: &String| *here != topic.type_hash && topic.type_hash != NO_HASH;
            if definitions.hash(&topic).is_some_and(|here| has_other_hash(&here)) {
                others.push(format!("warning: `{name}` has another definition of {ros_type} than the one known here"));
            }
        }
    }
    writeln!(text, "\n{table}")?;
    others.iter().try_for_each(|other| writeln!(text, "{other}"))
}

/// Says which robots have a map, what is missing for a merge, and what to write.
fn write_advice(text: &mut String, topics: &BTreeMap<String, Vec<Published>>) -> std::fmt::Result {
    let pattern = RobotTopics::default().map;
    let is_map = |of_topic: &[Published]| of_topic.iter().any(|published| published.ros_type == OccupancyGrid::NAME);
    let maps: Vec<&str> =
        topics.iter().filter(|(_, of_topic)| is_map(of_topic)).map(|(name, _)| name.as_str()).collect();
    let robots: BTreeSet<&str> = maps.iter().filter_map(|topic| match_robot(&pattern, topic)).collect();
    for robot in &robots {
        let topic = pattern.replace("{robot}", robot);
        let count = topics.get(&topic).map_or(0, |of_topic| of_topic.iter().map(|of| of.nodes.len()).sum::<usize>());
        match count {
            1 => writeln!(text, "{robot} has a map")?,
            count => writeln!(text, "warning: {robot} has {count} maps: are there two robots of one name?")?,
        }
    }
    if robots.len() >= 2 {
        return writeln!(text, "to merge these: gridweave-ros run live_ros.toml");
    }
    writeln!(text, "for a merge two robots must publish a map on `{pattern}`; there are {}", robots.len())?;
    // What the option of logs says is what the pipeline says here.
    let advised = rename_advice(maps.iter().copied(), &pattern);
    let template = |option: &String| Some(option.strip_prefix("--rename '")?.split_once('=')?.0.to_owned());
    match advised.first().and_then(template).filter(|template| template.contains("{robot}")) {
        Some(template) => writeln!(text, "in a copy of live_ros.toml, below [robots], write: map = \"{template}\"")?,
        None if maps.iter().any(|topic| match_robot(&pattern, topic).is_none()) => writeln!(
            text,
            "maps of other names: {}; run the nodes of each robot in a namespace of its own, as `namespace:=robot1`",
            maps.join(", ")
        )?,
        None => {}
    }
    Ok(())
}
