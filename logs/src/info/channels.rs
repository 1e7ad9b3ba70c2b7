//! The robots of logs by their channels, before any message is read.

use crate::names::{self, Input, NameError, NameRules};
use crate::robots::{RobotChannels, Role};
use gridweave_runtime::stage::RobotTopics;

/// Whether logs contain tag readings and no map or scans of any robot, so that only frames can be merged. Only the
/// channels are read.
///
/// # Errors
/// A log cannot be read, or the rules do not match the logs.
pub fn holds_tags_alone(inputs: &[Input], rules: &NameRules, robots: &RobotTopics) -> Result<bool, NameError> {
    let (_, names) = names::open(inputs, rules, robots)?;
    let channels = RobotChannels::new(robots.clone(), names.channels());
    let roles: Vec<Role> = names.channels().map(|channel| channels.classify(channel).role).collect();
    let holds_tags = roles.iter().any(|role| matches!(role, Role::Tags | Role::TagMessage));
    Ok(holds_tags && !roles.contains(&Role::Map) && !roles.contains(&Role::Scan))
}

/// The robots with scans and without maps, by name, as far as they are read; maps can be built from their scans. Only the
/// channels are read.
///
/// # Errors
/// A log cannot be read, or the rules do not match the logs.
pub fn robots_with_scans_only(
    inputs: &[Input],
    rules: &NameRules,
    robots: &RobotTopics,
) -> Result<Vec<String>, NameError> {
    let (_, names) = names::open(inputs, rules, robots)?;
    let channels = RobotChannels::new(robots.clone(), names.channels());
    let is_read = |robot: &&str| rules.robots.is_empty() || rules.robots.iter().any(|one| one == robot);
    Ok(channels.scanned().filter(is_read).map(str::to_owned).collect())
}
