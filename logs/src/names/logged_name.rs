//! The names that a log has for the robot, or the robots, that the user gives another name.

use super::{Input, NameRules, TopicNaming};
use crate::robots::{RobotChannels, Role};
use crate::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::stage::RobotTopics;
use std::collections::BTreeSet;

/// The robots in the topics of a log that the user assigns to one robot.
pub(super) enum LoggedName {
    /// None, or the one that the user names.
    Same,
    /// One, which gets the name that the user gives.
    Other(String),
    /// Several, of which these others have maps.
    Several(BTreeSet<String>),
}

impl LoggedName {
    /// The robots in the channels of an input.
    pub(super) fn of(input: &Input, channels: &[&Channel], rules: &NameRules, robots: &RobotTopics) -> Self {
        let Some(robot) = &input.robot else { return Self::Same };
        let roles = RobotChannels::new(robots.clone(), channels.iter().copied());
        let of_role = |is_of: fn(Role) -> bool| -> BTreeSet<String> {
            let classified = channels.iter().map(|channel| roles.classify(channel));
            let named = classified.filter(|found| is_of(found.role) && !found.robot.is_empty());
            named.map(|found| found.robot.to_owned()).collect()
        };
        let topics: BTreeSet<&str> = channels.iter().map(|channel| channel.topic.as_str()).collect();
        // The robot's topics are under its name, and none of them equals another topic without it.
        let can_drop = |name: &String| {
            let under = format!("/{name}");
            channels.iter().all(|channel| {
                match channel.topic.strip_prefix(&under).filter(|rest| rest.starts_with('/')) {
                    Some(rest) => tf_topic(channel).is_some() || !topics.contains(rest),
                    None => roles.classify(channel).robot != name,
                }
            })
        };
        let mut all = of_role(|role| !matches!(role, Role::Other | Role::Tf));
        if all.len() == 1
            && let Some(only) = all.pop_first().filter(|only| only != robot && can_drop(only))
        {
            return Self::Other(only);
        }
        let mut with_maps = of_role(|role| role == Role::Map);
        with_maps.remove(robot);
        // A missing robot matters only if robots are looked for.
        let matters = !with_maps.is_empty() && rules.convention == TopicNaming::ByRobot;
        if matters { Self::Several(with_maps) } else { Self::Same }
    }

    /// The name of the robot in the log, if it is another than the user gives.
    pub(super) fn other(&self) -> Option<&str> {
        match self {
            Self::Other(name) => Some(name),
            Self::Same | Self::Several(_) => None,
        }
    }

    /// A note for the user if the maps of the log match no robot, with the name that the user gives in front of theirs.
    pub(super) fn note(&self, input: &Input) -> Option<String> {
        let (Self::Several(named), Some(robot)) = (self, &input.robot) else { return None };
        let first = named.first()?;
        Some(format!(
            "the topics of {} already contain robot names ({}), and `{robot}` is put before them: omit `{robot}=`, or use \
             `--rename /{first}/map=/map` to make one of them {robot}'s",
            input.path.display(),
            list_in_words(named)
        ))
    }
}
