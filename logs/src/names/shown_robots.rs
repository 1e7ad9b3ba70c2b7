//! Robots that only the frames in a log show: that of a log whose lidars have namespaces, and that of maps on `/map`.

use super::Input;
use super::first_frames::{FirstFrames, Holds};
use super::lidars_of_one::{Lidars, NumberedChannel};
use super::map_frame_robot::{MapOwner, is_map_on, nameless_map, owner};
use crate::reader::LogFile;
use crate::robots::{RobotChannels, Role};
use crate::tf::{is_static, tf_topic};
use gridweave_runtime::message::Channel;
use gridweave_runtime::pipeline::list_in_words;
use gridweave_runtime::stage::RobotTopics;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// The only robot of a log that does not name it in its topics.
pub(super) struct ShownRobot {
    /// Its name; that of the log if `None`.
    pub(super) name: Option<String>,
    /// What shows it, in a sentence without its end.
    pub(super) sentence: String,
    /// How the user says that it is not so; empty if no option does.
    pub(super) otherwise: String,
    /// Whether its name alone shows it.
    by_name: bool,
}

/// The robots that the frames in logs show, by input.
#[derive(Default)]
pub(super) struct ShownRobots {
    only: BTreeMap<usize, ShownRobot>,
    /// The robot of the maps on a topic without a robot's name, in a log with other robots.
    of_map: BTreeMap<usize, String>,
    /// The topic of the scans that are read, of a robot none of whose lidars has a usual topic.
    scans: BTreeMap<usize, String>,
    notes: Vec<String>,
}

impl ShownRobots {
    /// Looks for robots in logs; of those that the user has named, only for the lidar that is read. `channels` are those
    /// of each input, and `given` the robots that are to be read. Only logs that have such lidars or maps are read, and
    /// only their beginnings.
    pub(super) fn find(
        files: &Arc<[LogFile]>,
        input_of: &[usize],
        inputs: &[Input],
        channels: &[Vec<NumberedChannel<'_>>],
        given: &[String],
        robots: &RobotTopics,
    ) -> Self {
        let map_topic = nameless_map(robots);
        let roles: Vec<RobotChannels> = channels
            .iter()
            .map(|of| RobotChannels::new(robots.clone(), of.iter().map(|(_, channel)| *channel)))
            .collect();
        let unnamed = || (0..inputs.len()).filter(|input| inputs[*input].robot.is_none());
        let lidars: BTreeMap<usize, Lidars<'_>> = (0..inputs.len())
            .filter_map(|input| Some((input, Lidars::of(&channels[input], &roles[input], given)?)))
            .collect();
        let is_map = |channel: &Channel| map_topic.as_ref().is_some_and(|topic| is_map_on(channel, topic));
        let mapped: BTreeSet<usize> =
            unnamed().filter(|input| channels[*input].iter().any(|(_, channel)| is_map(channel))).collect();
        let mut wanted: BTreeMap<(usize, u16), Holds> = BTreeMap::new();
        for input in (0..inputs.len()).filter(|input| lidars.contains_key(input) || mapped.contains(input)) {
            wanted
                .extend(lidars.get(&input).into_iter().flat_map(Lidars::channels).map(|scans| (scans, Holds::Header)));
            for (number, channel) in &channels[input] {
                let is_posed = matches!(roles[input].classify(channel).role, Role::Pose(_));
                let holds = match tf_topic(channel) {
                    Some(_) if is_static(&channel.topic) => Holds::StaticTransforms,
                    Some(_) => Holds::Transforms,
                    None if mapped.contains(&input) && (is_map(channel) || is_posed) => Holds::Header,
                    None => continue,
                };
                wanted.insert(*number, holds);
            }
        }
        let frames = FirstFrames::read(files, input_of, &wanted);
        let mut shown = Self::default();
        for (input, frames) in &frames {
            if let Some(one) = lidars.get(input).and_then(|lidars| lidars.of_one_robot(frames)) {
                if let Some((read, others)) = lidars.get(input).and_then(Lidars::chosen) {
                    shown.choose_scans(*input, read, &others, robots);
                }
                let otherwise = format!(", and {} takes each lidar for a robot", one.option);
                shown
                    .only
                    .insert(*input, ShownRobot { name: one.name, sentence: one.sentence, otherwise, by_name: false });
            } else if let Some(topic) = map_topic.as_ref().filter(|_| mapped.contains(input)) {
                shown.add_map(*input, owner(&channels[*input], topic, &roles[*input], frames), topic, robots);
            }
        }
        let named = |input: usize| -> BTreeSet<String> {
            let classified = channels[input].iter().map(|(_, channel)| roles[input].classify(channel));
            let named = classified.filter(|found| !matches!(found.role, Role::Other | Role::Tf));
            named.map(|found| found.robot.to_owned()).chain(inputs[input].robot.clone()).collect()
        };
        let all: Vec<BTreeSet<String>> = (0..inputs.len()).map(named).collect();
        shown.drop_taken(&all);
        shown
    }

    fn choose_scans(&mut self, input: usize, read: String, others: &[String], robots: &RobotTopics) {
        let nameless = robots.scan.replace("/{robot}", "");
        let other =
            others.first().map_or_else(String::new, |other| format!("; `--rename {other}={nameless}` reads another"));
        self.notes.push(format!("the scans on {read} are read, as those on `{nameless}`{other}"));
        self.scans.insert(input, read);
    }

    fn add_map(&mut self, input: usize, owner: Option<MapOwner>, topic: &str, robots: &RobotTopics) {
        match owner {
            Some(MapOwner::Log(robot)) => {
                let sentence = format!("the maps on `{topic}` are in the frame `{robot}/map`");
                let (name, otherwise) = (Some(robot), String::new());
                self.only.insert(input, ShownRobot { name, sentence, otherwise, by_name: true });
            }
            Some(MapOwner::Robot(robot)) => {
                self.notes.push(format!(
                    "the maps on `{topic}` are in the frame `{robot}/map`, and are read as those of {robot}; `--rename \
                     {topic}={}` makes them another robot's",
                    robots.map.replace("{robot}", "ROBOT")
                ));
                self.of_map.insert(input, robot);
            }
            Some(MapOwner::Several(frames)) => self.notes.push(format!(
                "`{topic}` has the maps of several robots, by their frames {}: record those of each robot on a topic of its \
                 own, `{}`",
                list_in_words(&frames),
                robots.map
            )),
            None => {}
        }
    }

    /// Drops names that several logs have: these are distinguished by the names of their files. `named` are the robots
    /// of each input by its topics and by the user.
    fn drop_taken(&mut self, named: &[BTreeSet<String>]) {
        let names: Vec<(usize, String)> =
            self.only.iter().filter_map(|(input, robot)| Some((*input, robot.name.clone()?))).collect();
        for (input, name) in &names {
            let is_taken = names.iter().any(|(other, same)| other != input && same == name)
                || named.iter().enumerate().any(|(other, robots)| other != *input && robots.contains(name));
            match self.only.get_mut(input).filter(|_| is_taken) {
                Some(robot) if robot.by_name => _ = self.only.remove(input),
                Some(robot) => robot.name = None,
                None => {}
            }
        }
    }

    /// The only robot of an input.
    pub(super) fn of_input(&self, input: usize) -> Option<&ShownRobot> {
        self.only.get(&input)
    }

    /// The robot of the maps on a topic without a robot's name, in an input with other robots.
    pub(super) fn of_map(&self, input: usize) -> Option<&str> {
        self.of_map.get(&input).map(String::as_str)
    }

    /// The topic of the scans that are read as those on the topic that the pipeline names.
    pub(super) fn scans(&self, input: usize) -> Option<&str> {
        self.scans.get(&input).map(String::as_str)
    }

    /// Notes for the user.
    pub(super) fn notes(&self) -> impl Iterator<Item = &str> {
        self.notes.iter().map(String::as_str)
    }
}
