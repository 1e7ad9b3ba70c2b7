//! Naming of channels, from the content of logs and the rules of the user.

use super::channel::{NamedChannel, Recoders};
use super::infer_robots::infer_robots;
use super::lidars_of_one::NumberedChannel;
use super::logged_name::LoggedName;
use super::map_frame_robot::nameless_map;
use super::one_name_for_two::check_robots;
use super::rules::fits;
use super::shown_robots::ShownRobots;
use super::{Input, NameError, NameRules, Names, TopicNaming};
use crate::reader::LogFile;
use crate::robots::{RobotChannels, Role, robots_with_unread_maps};
use crate::tf::{is_static, tf_topic};
use gridweave_runtime::message::Channel;
use gridweave_runtime::stage::RobotTopics;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// A channel that is being named.
struct Draft {
    file: usize,
    number: u16,
    channel: Channel,
    /// Its topic as the log has it.
    logged: String,
    /// Whether the user renamed the topic.
    is_renamed: bool,
    /// The robot that its frames are put under.
    robot: Option<String>,
}

impl Draft {
    /// Takes the name of the robot in the log off the topic.
    fn strip(&mut self, logged_as: Option<&str>) {
        let rest =
            logged_as.and_then(|name| self.channel.topic.strip_prefix('/')?.strip_prefix(name)?.strip_prefix('/'));
        if let Some(rest) = rest.filter(|_| shared_topic(&self.channel).is_none()) {
            self.channel.topic = format!("/{rest}");
        }
    }
}

/// Names the channels of `files`, where `input_of` is the index of the input that each file belongs to.
pub(super) fn name(
    files: &Arc<[LogFile]>,
    input_of: &[usize],
    inputs: &[Input],
    rules: &NameRules,
    robots: &RobotTopics,
) -> Result<Names, NameError> {
    let mut drafts: Vec<Draft> = drafts(files, rules);
    let shown = match rules.convention {
        TopicNaming::AsLogged => ShownRobots::default(),
        TopicNaming::ByRobot => {
            let channels: Vec<Vec<NumberedChannel<'_>>> =
                of_inputs(&drafts, input_of, inputs.len(), |draft| ((draft.file, draft.number), &draft.channel));
            ShownRobots::find(files, input_of, inputs, &channels, &rules.robots, robots)
        }
    };
    name_by_frames(&mut drafts, input_of, &shown, robots);
    let of_inputs: Vec<Vec<&Channel>> = of_inputs(&drafts, input_of, inputs.len(), |draft| &draft.channel);
    let (of_input, note) = match rules.convention {
        TopicNaming::AsLogged => (inputs.iter().map(|input| input.robot.clone()).collect(), None),
        TopicNaming::ByRobot => infer_robots(inputs, &of_inputs, robots, &shown)?,
    };
    let logged_names: Vec<LoggedName> =
        inputs.iter().zip(&of_inputs).map(|(input, channels)| LoggedName::of(input, channels, rules, robots)).collect();
    let notes = inputs.iter().zip(&logged_names).filter_map(|(input, logged)| logged.note(input));
    let note = note.into_iter().chain(notes).reduce(|one, other| format!("{one}; {other}"));
    let robot_of_file: Vec<Option<String>> =
        input_of.iter().map(|&input| of_input.get(input).cloned().flatten()).collect();
    let logged_as = |file: usize| input_of.get(file).and_then(|&input| logged_names.get(input)?.other());
    drafts.iter_mut().for_each(|draft| draft.strip(logged_as(draft.file)));
    put_under_robots(&mut drafts, &robot_of_file, rules);
    check_renamed(&drafts)?;

    let roles = RobotChannels::new(robots.clone(), drafts.iter().map(|draft| &draft.channel));
    if rules.convention == TopicNaming::ByRobot {
        let channels = drafts.iter().map(|draft| (draft.file, draft.number, &draft.channel));
        check_robots(channels, &roles, files, input_of)?;
    }
    let mut known = known_robots(&roles, &drafts);
    known.extend(robots_with_unread_maps(drafts.iter().map(|draft| &draft.channel), &roles, &robots.map).into_keys());
    check_wanted(rules, &known, &drafts)?;
    let mut channels: Vec<BTreeMap<u16, NamedChannel>> = files.iter().map(|_| BTreeMap::new()).collect();
    let mut recoders = Recoders::default();
    for Draft { file, number, channel, robot, .. } in drafts {
        let classified = roles.classify(&channel);
        let is_map = matches!(classified.role, Role::Map | Role::MapUpdate);
        // Maps, and poses in them, are always in the robot's map frame.
        let is_robots =
            is_map || matches!(classified.role, Role::Pose(_) | Role::Odometry | Role::TagMessage | Role::Scan);
        let by_role = is_robots && rules.convention == TopicNaming::ByRobot;
        let robot = robot.or(by_role.then(|| classified.robot.to_owned())).unwrap_or_default();
        let is_wanted = rules.wants(&channel.topic, robot_of(&known, robots, &channel.topic));
        if let Some(of_file) = channels.get_mut(file) {
            let later = files.get(file).map_or(0, LogFile::later);
            let named = NamedChannel::sharing(&mut recoders, channel, robot, is_map, later, is_wanted);
            of_file.insert(number, named.logged_as(logged_as(file)));
        }
    }
    let given = inputs.iter().filter_map(|input| input.robot.clone()).chain(rules.robots.iter().cloned()).collect();
    Ok(Names { channels, robots: robot_of_file, note, given })
}

/// Something of every channel, by the input that it belongs to.
fn of_inputs<'a, T>(
    drafts: &'a [Draft],
    input_of: &[usize],
    inputs: usize,
    of: impl Fn(&'a Draft) -> T,
) -> Vec<Vec<T>> {
    let mut of_inputs: Vec<Vec<T>> = (0..inputs).map(|_| Vec::new()).collect();
    for draft in drafts {
        if let Some(of_input) = input_of.get(draft.file).and_then(|&input| of_inputs.get_mut(input)) {
            of_input.push(of(draft));
        }
    }
    of_inputs
}

/// The robots and topics that the user selects must exist.
fn check_wanted(rules: &NameRules, known: &BTreeSet<String>, drafts: &[Draft]) -> Result<(), NameError> {
    if let Some(unknown) = rules.robots.iter().find(|robot| !known.contains(robot.as_str())) {
        return Err(NameError::NoSuchRobot { robot: unknown.clone(), known: known.iter().cloned().collect() });
    }
    if let Some(unknown) =
        rules.topics.iter().find(|topic| !drafts.iter().any(|draft| fits(topic, &draft.channel.topic)))
    {
        let known: BTreeSet<&str> = drafts.iter().map(|draft| draft.channel.topic.as_str()).collect();
        let known = known.into_iter().map(str::to_owned).collect();
        let renamed = rules.renamed(unknown);
        return Err(NameError::NoSuchTopic { topic: unknown.clone(), renamed, known });
    }
    Ok(())
}

/// The channels of all files, with the user's renames applied. Where robots are looked for, channels without messages
/// are left out: one with maps would stand for a map, and hide the scans of its robot.
fn drafts(files: &[LogFile], rules: &NameRules) -> Vec<Draft> {
    let draft = |file: usize, number: u16, channel: Channel| {
        let renamed = rules.renamed(&channel.topic);
        let is_renamed = renamed.is_some();
        let logged = channel.topic.clone();
        let topic = renamed.unwrap_or_else(|| logged.clone());
        Draft { file, number, channel: Channel { topic, ..channel }, logged, is_renamed, robot: None }
    };
    let of_file = |(file, log): (usize, &LogFile)| {
        let is_silent = |number: u16| rules.convention == TopicNaming::ByRobot && log.is_silent(number);
        let channels = log.channels().filter(|(number, _)| !is_silent(*number));
        channels.map(|(number, channel)| draft(file, number, channel)).collect::<Vec<_>>()
    };
    files.iter().enumerate().flat_map(of_file).collect()
}

/// Puts maps, and their updates, on a topic without a robot's name on that of the robot that their frame shows, and the
/// scans that are read of a robot with several lidars on the topic that the pipeline names, without its name.
fn name_by_frames(drafts: &mut [Draft], input_of: &[usize], shown: &ShownRobots, robots: &RobotTopics) {
    let scan = robots.scan.replace("/{robot}", "");
    let nameless = nameless_map(robots);
    for Draft { file, channel, .. } in drafts {
        let Some(&input) = input_of.get(*file) else { continue };
        if shown.scans(input) == Some(&*channel.topic) {
            channel.topic.clone_from(&scan);
        }
        let (Some(robot), Some(nameless)) = (shown.of_map(input), &nameless) else { continue };
        if let Some(rest @ ("" | "_updates")) = channel.topic.strip_prefix(nameless.as_str()) {
            channel.topic = format!("{}{rest}", robots.map.replace("{robot}", robot));
        }
    }
}

/// Puts topics and frames under the robots of their files or namespaces.
fn put_under_robots(drafts: &mut [Draft], robot_of_file: &[Option<String>], rules: &NameRules) {
    let of_file = |file: usize| robot_of_file.get(file).and_then(Option::as_deref);
    let trees = own_trees(drafts.iter().filter(|draft| of_file(draft.file).is_none()).map(|draft| &draft.channel));
    for Draft { file, channel, is_renamed, robot, .. } in drafts {
        let prefix = match of_file(*file) {
            Some(robot) => robot,
            None if rules.convention == TopicNaming::AsLogged => continue,
            None => match tree_of(&trees, &channel.topic) {
                Some(robot) => robot,
                None => continue,
            },
        };
        if let Some(topic) = shared_topic(channel) {
            channel.topic = topic.to_owned();
        } else if of_file(*file).is_some() {
            channel.topic = topic_of_robot(prefix, &channel.topic);
        }
        if let Some(topic) = rules.renamed(&channel.topic).filter(|_| !*is_renamed) {
            channel.topic = topic;
            *is_renamed = true;
        }
        *robot = Some(prefix.to_owned());
    }
}

/// Transforms of all robots share a topic. Two others with one name would be taken for one: of two maps, each would
/// replace the other.
fn check_renamed(drafts: &[Draft]) -> Result<(), NameError> {
    let mut first: BTreeMap<&str, &Draft> = BTreeMap::new();
    for draft in drafts.iter().filter(|draft| tf_topic(&draft.channel).is_none()) {
        let known = first.entry(&draft.channel.topic).or_insert(draft);
        if known.logged != draft.logged && (known.is_renamed || draft.is_renamed) {
            let [topic, one, other] = [&draft.channel.topic, &known.logged, &draft.logged].map(String::clone);
            return Err(NameError::OneTopicForTwo { topic, one, other });
        }
    }
    Ok(())
}

/// The topic for the transforms of all robots, if the channel carries transforms.
fn shared_topic(channel: &Channel) -> Option<&'static str> {
    tf_topic(channel)?;
    Some(if is_static(&channel.topic) { "/tf_static" } else { "/tf" })
}

fn topic_of_robot(robot: &str, topic: &str) -> String {
    let topic = topic.trim_start_matches('/');
    match topic.strip_prefix(robot).is_some_and(|rest| rest.starts_with('/')) {
        true => format!("/{topic}"),
        false => format!("/{robot}/{topic}"),
    }
}

/// The namespaces with their own transforms, and their robots: `/robot1/` for `/robot1/tf`.
fn own_trees<'a>(channels: impl Iterator<Item = &'a Channel>) -> BTreeMap<String, String> {
    let tree = |channel: &'a Channel| {
        let robot = tf_topic(channel).filter(|robot| !robot.is_empty())?;
        let (namespace, _) = channel.topic.rsplit_once('/')?;
        Some((format!("{namespace}/"), robot.to_owned()))
    };
    channels.filter_map(tree).collect()
}

/// The robot whose namespace contains a topic.
fn tree_of<'a>(trees: &'a BTreeMap<String, String>, topic: &str) -> Option<&'a str> {
    // Of nested namespaces the innermost is used.
    let within = trees.iter().filter(|(namespace, _)| topic.starts_with(namespace.as_str()));
    within.max_by_key(|(namespace, _)| namespace.len()).map(|(_, robot)| robot.as_str())
}

/// The robots in topics.
fn known_robots(roles: &RobotChannels, drafts: &[Draft]) -> BTreeSet<String> {
    let robot = |draft: &Draft| {
        let classified = roles.classify(&draft.channel);
        (!matches!(classified.role, Role::Other | Role::Tf)).then(|| classified.robot.to_owned())
    };
    drafts.iter().filter_map(robot).collect()
}

/// The known robot under whose name a topic is.
fn robot_of<'a>(known: &BTreeSet<String>, robots: &RobotTopics, topic: &'a str) -> Option<&'a str> {
    let (namespace, _) = robots.map.split_once("{robot}")?;
    let (robot, _) = topic.strip_prefix(namespace)?.split_once('/')?;
    known.contains(robot).then_some(robot)
}
