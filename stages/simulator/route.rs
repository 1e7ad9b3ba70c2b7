//! Which rooms each robot visits, and the way through them.

use super::clearances::Clearances;
use super::floor_plan::FloorPlan;
use super::planner::{plan_path, smooth_path};
use super::room::Room;
use crate::shared::geometry::Point2;
use rand::{Rng, RngExt};
use std::ops::Range;

/// Floor area that one stop in a room is made for, square metres.
const AREA_PER_STOP: f64 = 9.0;
/// Stops are not nearer to obstacles than this where there is room, metres.
const STOP_CLEARANCE: f64 = 0.45;

/// Deals `rooms` rooms out to `robots` robots: each gets a run of neighbouring rooms, all runs about as long, and of
/// the rooms of one robot the next one visits the share `overlap` (0 to 1) as well.
///
/// Every robot gets at least one room, if there is one.
pub(super) fn share_rooms(rooms: usize, robots: usize, overlap: f64) -> Vec<Range<usize>> {
    let last = robots.saturating_sub(1) as f64;
    let length = rooms as f64 / (1.0 + last * (1.0 - overlap));
    let run = |robot: usize| {
        let start = robot as f64 * length * (1.0 - overlap);
        let first = (start.round() as usize).min(rooms.saturating_sub(1));
        let end = ((start + length).round() as usize).clamp(first, rooms).max((first + 1).min(rooms));
        first..end
    };
    (0..robots).map(run).collect()
}

/// A way through the given rooms of a building, with a few stops in each, as points about 0.1 m apart. Empty if no room
/// can be reached.
pub(super) fn plan_route(
    plan: &FloorPlan,
    space: &Clearances,
    rooms: Range<usize>,
    random: &mut impl Rng,
) -> Vec<Point2> {
    let mut rooms: Vec<&Room> = plan.rooms.get(rooms).unwrap_or_default().iter().collect();
    if random.random_bool(0.5) {
        rooms.reverse();
    }
    let mut route: Vec<Point2> = Vec::new();
    for room in rooms {
        let mut stops = stops_in(space, room, random);
        while !stops.is_empty() {
            let nearest = match route.last() {
                Some(here) => nearest(here, &stops),
                None => 0,
            };
            let stop = stops.swap_remove(nearest);
            match route.last().and_then(|here| plan_path(space, here, &stop)) {
                Some(path) => route.extend(path.into_iter().skip(1)),
                None if route.is_empty() => route.push(stop),
                None => {}
            }
        }
    }
    smooth_path(space, &mut route);
    route
}

/// Places in a room that are far from each other.
fn stops_in(space: &Clearances, room: &Room, random: &mut impl Rng) -> Vec<Point2> {
    let mut places = space.places_in(&room.bounds.expanded(-STOP_CLEARANCE));
    if places.iter().any(|place| space.clearance(place) >= STOP_CLEARANCE) {
        places.retain(|place| space.clearance(place) >= STOP_CLEARANCE);
    }
    if places.is_empty() {
        return Vec::new();
    }
    let wanted = (room.bounds.width() * room.bounds.height() / AREA_PER_STOP).round().clamp(2.0, 8.0) as usize;
    let mut stops = vec![places[random.random_range(0..places.len())]];
    while stops.len() < wanted {
        let from_stops = |place: &Point2| stops.iter().map(|stop| (stop - place).norm()).fold(f64::INFINITY, f64::min);
        match places.iter().max_by(|a, b| from_stops(a).total_cmp(&from_stops(b))) {
            Some(&place) if from_stops(&place) > 0.5 => stops.push(place),
            _ => break,
        }
    }
    stops
}

fn nearest(here: &Point2, places: &[Point2]) -> usize {
    let distances = places.iter().map(|place| (place - here).norm_squared()).enumerate();
    distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_share_as_many_rooms_as_asked() {
        assert_eq!(share_rooms(12, 3, 0.5), [0..6, 3..9, 6..12]);
        assert_eq!(share_rooms(12, 3, 0.0), [0..4, 4..8, 8..12]);
        assert_eq!(share_rooms(12, 3, 1.0), [0..12, 0..12, 0..12]);
        assert_eq!(share_rooms(5, 1, 0.5).as_slice(), std::slice::from_ref(&(0..5)));
    }

    #[test]
    fn every_robot_gets_a_room_however_few_there_are() {
        for robots in 1..=64 {
            for rooms in 1..20 {
                for overlap in [0.0, 0.3, 0.7, 1.0] {
                    let runs = share_rooms(rooms, robots, overlap);
                    assert_eq!(runs.len(), robots);
                    assert!(runs.iter().all(|run| run.start < run.end && run.end <= rooms));
                    assert_eq!((runs[0].start, runs[robots - 1].end), (0, rooms), "all rooms are visited");
                }
            }
        }
    }
}
