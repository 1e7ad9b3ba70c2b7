//! The topics of stages' outputs in a log.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item};
use super::nearest::suggest;
use super::values::{entries, text};
use crate::message::{LONGEST_ROBOT_NAME, LONGEST_TOPIC};
use crate::stage::{OutputPort, StageKind};

/// The topic of an output port, and its location in the file.
#[derive(Debug)]
pub(super) struct Topic {
    pub(super) template: String,
    pub(super) at: Location,
}

/// The default topics of a stage's outputs: those of the ports, or `/{robot}/STAGE/PORT`.
pub(super) fn default_topics(kind: &StageKind, stage: &str) -> Vec<String> {
    let topic = |port: &OutputPort| match port.topic {
        Some(own) => own.replace("{stage}", stage),
        None => format!("/{{robot}}/{stage}/{}", port.name),
    };
    kind.outputs.iter().map(topic).collect()
}

/// The topics of a stage's outputs: those given in `topics`, or the default ones.
pub(super) fn read_topics(
    stage: &Entry,
    kind: &StageKind,
    given: Option<&Item>,
    problems: &mut Problems,
) -> Vec<Topic> {
    let own = |topic: &str| topic.replace("{stage}", &stage.key);
    let defaults = default_topics(kind, &stage.key).into_iter();
    let mut topics: Vec<Topic> = defaults.map(|template| Topic { template, at: stage.key_at.clone() }).collect();
    for Entry { key, key_at, item } in given.map(|item| entries(item, "topics", problems)).unwrap_or_default() {
        let port = kind.outputs.iter().position(|port| port.name == key);
        let Some(topic) = port.and_then(|port| topics.get_mut(port)) else {
            problems.push(unknown_output(kind, key, key_at));
            continue;
        };
        if let Some(template) = text(key, item, problems) {
            *topic = Topic { template: own(template), at: item.at.clone() };
            check_form(topic, problems);
        }
    }
    for (topic, port) in topics.iter().zip(&kind.outputs) {
        check_length(topic, port.name, problems);
    }
    topics
}

fn unknown_output(kind: &StageKind, port: &str, at: &Location) -> Diagnostic {
    let names: Vec<&str> = kind.outputs.iter().map(|port| port.name).collect();
    let label = match names.is_empty() {
        true => format!("`{}` has no outputs", kind.name),
        false => format!("`{}` has no such output", kind.name),
    };
    Diagnostic::new(format!("unknown output `{port}`")).at(at, label).help(suggest(port, &names, "its outputs"))
}

fn check_form(topic: &Topic, problems: &mut Problems) {
    let template = topic.template.as_str();
    let parts: Vec<&str> = template.split('/').collect();
    let robots = parts.iter().filter(|part| **part == "{robot}").count();
    let wrong = if !template.starts_with('/') {
        "a topic starts with `/`"
    } else if template.ends_with('/') || template.contains("//") {
        "a part of this path is empty"
    } else if parts.iter().any(|part| *part != "{robot}" && part.contains(['{', '}'])) {
        "the only placeholders are `{robot}` and `{stage}`, and `{robot}` is a whole part of the path"
    } else if robots > 1 || template == "/{robot}" {
        "expected a path with `{robot}` in it at most once, and more than that"
    } else {
        return;
    };
    problems.push(Diagnostic::new("this is not a valid topic").at(&topic.at, wrong));
}

fn check_length(topic: &Topic, port: &str, problems: &mut Problems) {
    let length = topic.template.replace("{robot}", "").len()
        + if topic.template.contains("{robot}") { LONGEST_ROBOT_NAME } else { 0 };
    if length > LONGEST_TOPIC {
        let label = format!("up to {length} bytes with the robot's name, and at most {LONGEST_TOPIC} fit");
        problems.push(Diagnostic::new(format!("the topic of the output `{port}` is too long")).at(&topic.at, label));
    }
}
