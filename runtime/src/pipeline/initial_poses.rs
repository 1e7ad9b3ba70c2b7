//! What the user knows of where robots' maps lie: `[robots.ROBOT]` in a pipeline file, and `--initial`.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item};
use super::values::{entries, unknown_key, wrong_type};
use crate::stage::{InitialPose, InitialPoses};

/// The fields that must be given: a place and a direction.
const NEEDED: usize = 3;

/// Takes in the section `[robots.ROBOT]`.
pub(super) fn read_robot(robot: &str, section: &[Entry], poses: &mut InitialPoses, problems: &mut Problems) {
    for Entry { key, key_at, item } in section {
        match key.as_str() {
            "initial" => {
                let pose = read_pose(item, problems);
                poses.insert(robot.to_owned(), pose);
            }
            _ => problems.push(unknown_key(key, key_at, &format!("[robots.{robot}]"), &["initial"])),
        }
    }
}

fn read_pose(item: &Item, problems: &mut Problems) -> InitialPose {
    let mut pose = InitialPose::default();
    let mut given = [false; InitialPose::FIELDS.len()];
    for Entry { key, key_at, item } in entries(item, "initial", problems) {
        let Some(field) = InitialPose::FIELDS.iter().position(|field| field == key) else {
            problems.push(unknown_key(key, key_at, "initial", &InitialPose::FIELDS));
            continue;
        };
        given[field] = true;
        let value = item.as_float().or_else(|| item.as_integer().map(|value| value as f64));
        if let Err(expected) = pose.set(field, value.unwrap_or(f64::NAN)) {
            problems.push(wrong_type(key, item, expected));
        }
    }
    if let Some(missing) = given[..NEEDED].iter().position(|given| !given) {
        let problem = Diagnostic::new(format!("`initial` has no `{}`", InitialPose::FIELDS[missing]));
        let problem = problem.at(&item.at, "a place needs x, y and yaw");
        problems
            .push(problem.help("write `initial = { x = 5.0, y = 3.0, yaw = 1.57 }`, in metres and radians".to_owned()));
    }
    pose
}

/// Takes in `ROBOT=X,Y,YAW[,STDDEV[,YAW_STDDEV]]`.
pub(super) fn read_typed(typed: &str, poses: &mut InitialPoses, problems: &mut Problems) {
    let source = problems.add_source("command line", typed);
    let mut report = |range: std::ops::Range<usize>, label: &str| {
        let problem = Diagnostic::new("this is no initial pose").at(&Location::new(source, range), label);
        let form = "write ROBOT=X,Y,YAW in metres and radians, and if it is known STDDEV and YAW_STDDEV behind them";
        problems.push(problem.help(form.to_owned()));
    };
    let Some((robot, numbers)) = typed.rsplit_once('=').filter(|(robot, _)| !robot.is_empty()) else {
        return report(0..typed.len(), "expected ROBOT=X,Y,YAW");
    };
    let count = numbers.split(',').count();
    if !(NEEDED..=InitialPose::FIELDS.len()).contains(&count) {
        return report(robot.len() + 1..typed.len(), &format!("expected 3 to 5 numbers, found {count}"));
    }
    let mut pose = InitialPose::default();
    let mut start = robot.len() + 1;
    for (field, number) in numbers.split(',').enumerate() {
        if let Err(expected) = pose.set(field, number.trim().parse().unwrap_or(f64::NAN)) {
            return report(
                start..start + number.len(),
                &format!("{}: expected {expected}", InitialPose::FIELDS[field]),
            );
        }
        start += number.len() + 1;
    }
    poses.insert(robot.to_owned(), pose);
}

/// The reference lies at the origin of all initial poses where none is given for it. One pose alone says nothing.
pub(super) fn complete(poses: &mut InitialPoses, reference: Option<&str>, problems: &mut Problems) {
    if poses.is_empty() {
        return;
    }
    if let Some(reference) = reference {
        poses.entry(reference.to_owned()).or_insert(InitialPose::ORIGIN);
    }
    if poses.len() == 1 {
        let robot = poses.keys().next().map_or("", String::as_str);
        let problem =
            Diagnostic::new(format!("the initial pose of `{robot}` alone does not say how it lies to another"));
        problems.push(
            problem.help("give that of another robot, too, or name the reference, which lies at the origin".to_owned()),
        );
    }
}
