//! Logs of one robot whose lidars have namespaces: the topics `/front/scan` and `/rear/scan` seem to be those of two
//! robots.
//!
//! They are the lidars of one robot if transforms connect the frames of all to one base, or if their namespaces are
//! names of parts of a robot (`front`, `lidar`) and the log has odometry without the name of a robot. Such a robot does
//! not name itself.

use super::first_frames::FirstFrames;
use crate::robots::{BASES, RobotChannels, Role, is_lidar_topic, is_nameless_odometry, is_part, is_scan};
use crate::schemas::full_type_name;
use crate::tf::tf_topic;
use gridweave_runtime::message::Channel;
use gridweave_runtime::pipeline::list_in_words;
use std::collections::{BTreeMap, BTreeSet};

/// A channel of an input: the index of its file, its number in it, and what it is.
pub(super) type NumberedChannel<'a> = ((usize, u16), &'a Channel);

/// The lidars of a log whose namespaces are taken for robots.
pub(super) struct Lidars<'a> {
    /// The scans, by topic.
    scans: BTreeMap<&'a str, (usize, u16)>,
    namespaces: BTreeSet<&'a str>,
    /// The topic of odometry without the name of a robot.
    odometry: Option<&'a str>,
}

/// What shows that the lidars are those of one robot.
pub(super) struct OneRobot {
    /// The name of the robot, if frames have it.
    pub(super) name: Option<String>,
    /// The finding in a sentence without its end.
    pub(super) sentence: String,
    /// The option that takes each lidar as that of a robot.
    pub(super) option: String,
}

impl<'a> Lidars<'a> {
    /// The lidars of a log; `None` if its topics name a robot in any other way, or if the user has named one of these.
    pub(super) fn of(channels: &[NumberedChannel<'a>], roles: &RobotChannels, given: &[String]) -> Option<Self> {
        let mut lidars = Self { scans: BTreeMap::new(), namespaces: BTreeSet::new(), odometry: None };
        for &(number, channel) in channels {
            let classified = roles.classify(channel);
            let topic = channel.topic.as_str();
            match classified.role {
                Role::Scan => {
                    lidars.scans.insert(topic, number);
                    lidars.namespaces.insert(classified.robot);
                }
                Role::Tf | Role::Other if tf_topic(channel).is_some_and(|robot| !robot.is_empty()) => return None,
                Role::Tf => {}
                Role::Other if is_scan(&full_type_name(&channel.schema_name)) && topic.matches('/').count() == 1 => {
                    lidars.scans.insert(topic, number);
                }
                Role::Other => lidars.odometry = lidars.odometry.or(is_nameless_odometry(channel).then_some(topic)),
                _ => return None,
            }
        }
        let is_given = given.iter().any(|robot| lidars.namespaces.contains(robot.as_str()));
        (!lidars.namespaces.is_empty() && !is_given).then_some(lidars)
    }

    /// The topic of the lidar that is read, and those of the others, if none is on a topic that lidars usually have.
    pub(super) fn chosen(&self) -> Option<(String, Vec<String>)> {
        let is_usual = |topic: &str| is_lidar_topic(topic) || topic.matches('/').count() == 1;
        let mut topics = self.scans.keys().map(|topic| (*topic).to_owned());
        let first = topics.next().filter(|_| !self.scans.keys().any(|topic| is_usual(topic)))?;
        Some((first, topics.collect()))
    }

    /// The channels with the scans.
    pub(super) fn channels(&self) -> impl Iterator<Item = (usize, u16)> {
        self.scans.values().copied()
    }

    /// What shows that all are those of one robot; `None` if nothing does, or if their frames are on several bases.
    pub(super) fn of_one_robot(&self, frames: &FirstFrames) -> Option<OneRobot> {
        let topics = list_in_words(self.scans.keys());
        let namespaces: Vec<&str> = self.namespaces.iter().copied().collect();
        let one = |name: Option<String>, why: String| OneRobot {
            name,
            sentence: format!("the scans on {topics} are those of one robot, as {why}"),
            option: format!("--robots {}", namespaces.join(",")),
        };
        let of_scans: Vec<Vec<&str>> = self.channels().map(|channel| frames.of(channel).collect()).collect();
        let bases: Vec<BTreeSet<&str>> = of_scans
            .iter()
            .flatten()
            .map(|frame| frames.path(frame).filter(|frame| is_base(frame)).collect::<BTreeSet<&str>>())
            .filter(|bases| !bases.is_empty())
            .collect();
        let common = bases.iter().skip(1).fold(bases.first().cloned(), |common, bases| Some(&common? & bases));
        // Robots whose frames lack their names may all have a frame `laser`, on a frame `base_link`.
        let distinct: BTreeSet<&str> = of_scans.iter().flatten().copied().collect();
        let are_lidars =
            of_scans.len() > 1 && of_scans.iter().all(|of| of.len() == 1) && distinct.len() == of_scans.len();
        match common.map(|common| common.into_iter().next()) {
            // Two bases are those of two robots, whatever the topics are.
            Some(None) => None,
            Some(Some(base)) if are_lidars && bases.len() == of_scans.len() => {
                let name = base.rsplit_once('/').map(|(robot, _)| robot.to_owned());
                Some(one(name, format!("tf has their frames on `{base}`")))
            }
            _ => {
                let odometry = self.odometry.filter(|_| namespaces.iter().all(|name| is_part(name)))?;
                Some(one(None, format!("the log has the odometry of one, `{odometry}`")))
            }
        }
    }
}

/// Whether a frame is the base of a robot, with or without its name.
fn is_base(frame: &str) -> bool {
    BASES.iter().any(|base| frame.ends_with(base) || Some(frame) == base.get(1..))
}
