//! Pairs of robots, put together to be merged.

use super::building::Building;
use super::known::Known;
use super::look_alike::{look_alikes, spread};
use crate::cut::{Kept, Member};
use nalgebra::{Point2, Vector2};
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

/// Tags that are to be taken for shared ones are located with this certainty.
const CERTAIN: f64 = 0.9;

/// A pair of robots to be merged.
pub(super) struct Trial<'a> {
    /// Which.
    pub(super) name: String,
    /// The two.
    pub(super) members: [Member<'a>; 2],
    /// The truth; none if they do not belong together.
    pub(super) truth: Option<&'a Path>,
}

/// Two robots of a building.
type Housemates<'a> = [(&'a str, &'a Known); 2];

/// Each two robots of a building.
fn housemates(building: &Building) -> Vec<Housemates<'_>> {
    let robots = building.robots.iter().map(|(name, known)| (name.as_str(), known));
    each_two(&robots.collect::<Vec<_>>())
}

/// Each two of some things, the earlier one first.
fn each_two<T: Copy>(things: &[T]) -> Vec<[T; 2]> {
    let later = |(index, one): (usize, &T)| {
        let one = *one;
        things[index + 1..].iter().map(move |other| [one, *other])
    };
    things.iter().enumerate().flat_map(later).collect()
}

/// In each pair of a building's robots, choices of two of their common tags.
pub(super) fn two_tags(buildings: &[Building], choices: usize) -> Vec<Trial<'_>> {
    let mut trials = Vec::new();
    for building in buildings {
        for [(a, known_a), (b, known_b)] in housemates(building) {
            let common: Vec<&String> = known_a.tags.keys().filter(|tag| known_b.tags.contains_key(*tag)).collect();
            for two in spread(each_two(&common), choices) {
                let tags: BTreeMap<String, Kept> = two.map(|tag| (tag.clone(), Kept::named(tag))).into();
                let members = [a, b].map(|robot| Member { log: &building.world.log, robot, tags: tags.clone() });
                let name = format!("{} {a} {b} {} {}", building.name, two[0], two[1]);
                let truth = building.related.then_some(building.world.truth.as_path());
                trials.push(Trial { name, members, truth });
            }
        }
    }
    trials
}

/// In each pair of a building's robots, one choice of two tags that both have located, and that are `metres` away for
/// the second robot, both in one of the directions of its walls: each direction in turn.
pub(super) fn moved_alike(buildings: &[Building], metres: f64) -> Vec<Trial<'_>> {
    let mut trials = Vec::new();
    for building in buildings.iter().filter(|building| building.related) {
        for [(a, known_a), (b, known_b)] in housemates(building) {
            let located_a = known_a.located(CERTAIN);
            let mut common = known_b.located(CERTAIN);
            common.retain(|(tag, _)| located_a.iter().any(|(other, _)| other == tag));
            let Some(direction) = known_b.direction else { continue };
            for two in spread(each_two(&common), 1) {
                let angle = direction + trials.len() as f64 * FRAC_PI_2;
                let shift = Vector2::new(angle.cos(), angle.sin()) * metres;
                let kept = |moves: bool| -> BTreeMap<String, Kept> {
                    let tags = two.map(|(tag, place): (&str, Point2<f64>)| {
                        let moved = moves.then_some([place, place + shift]);
                        (tag.to_owned(), Kept { moved, ..Kept::named(tag) })
                    });
                    tags.into()
                };
                let member = |robot, moves| Member { log: &building.world.log, robot, tags: kept(moves) };
                let name = format!("{} {a} {b} {} {}", building.name, two[0].0, two[1].0);
                let truth = Some(building.world.truth.as_path());
                trials.push(Trial { name, members: [member(a, false), member(b, true)], truth });
            }
        }
    }
    trials
}

/// Each two buildings in either order. Logs whose robots come from two buildings do not say which these are, and are
/// left out.
fn strangers(buildings: &[Building]) -> impl Iterator<Item = (&Building, &Building)> {
    let related = || buildings.iter().filter(|building| building.related);
    related()
        .flat_map(move |one| related().map(move |other| (one, other)))
        .filter(|(one, other)| one.name != other.name)
}

/// Strangers that have each located tags, of which `shared` bear the same ids.
pub(super) fn with_shared_ids(buildings: &[Building], shared: usize) -> Vec<Trial<'_>> {
    let mut trials = Vec::new();
    for (number, (one, other)) in strangers(buildings).enumerate() {
        let (Some((a, known_a)), Some((b, known_b))) = (one.robot("robot1"), other.robot("robot2")) else { continue };
        // Which tags these are changes from pair to pair; places are at random among their ids.
        let some = |known: &Known| -> BTreeMap<String, Kept> {
            let located = known.located(CERTAIN);
            let chosen = located.iter().cycle().skip(number % located.len().max(1)).take(shared.min(located.len()));
            chosen
                .enumerate()
                .map(|(index, (tag, _))| ((*tag).to_owned(), Kept::named(format!("tag{index}"))))
                .collect()
        };
        let members = [
            Member { log: &one.world.log, robot: a, tags: some(known_a) },
            Member { log: &other.world.log, robot: b, tags: some(known_b) },
        ];
        trials.push(Trial { name: format!("{} {a}, {} {b}", one.name, other.name), members, truth: None });
    }
    trials
}

/// Strangers with two tags that look alike.
pub(super) fn with_look_alikes(buildings: &[Building], choices: usize) -> Vec<Trial<'_>> {
    let mut trials = Vec::new();
    for (one, other) in strangers(buildings) {
        let (Some((a, known_a)), Some((b, known_b))) = (one.robot("robot1"), other.robot("robot2")) else { continue };
        for (number, alike) in look_alikes(known_a, known_b, choices).into_iter().enumerate() {
            let members = [
                Member { log: &one.world.log, robot: a, tags: alike.a },
                Member { log: &other.world.log, robot: b, tags: alike.b },
            ];
            let name = format!("{} {a}, {} {b}, choice {}", one.name, other.name, number + 1);
            trials.push(Trial { name, members, truth: None });
        }
    }
    trials
}
