//! Furniture and pillars, placed so that a robot still reaches every room.
//!
//! A piece either stands against a wall or leaves a passage on all its sides; pieces leave a passage between each
//! other, and doors stay clear. So no piece can cut a room in two.

use super::room::{Door, Room};
use super::shape::{Rectangle, Solid, between};
use crate::shared::geometry::{Point2, pose};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::FRAC_PI_2;

/// What a robot passes with ease, metres.
const PASSAGE: f64 = 0.95;
/// The least width of the way between shelves and the walls of their room, where doors stay clear, metres.
const SHELVES_FROM_WALLS: f64 = 1.3;
/// Pieces of equipment a square metre.
const EQUIPMENT: (f64, f64) = (0.05, 0.3);
/// How often a place is looked for before a piece is given up.
const TRIES: usize = 8;
/// Metres of corridor for each pilaster when there is one piece of furniture in 10 square metres.
const PILASTER_SPACING: f64 = 6.0;

/// Furniture of a room beside what stands there: `clutter` pieces a square metre, fewer where they find no place.
pub(super) fn furnish_room(room: &Room, standing: &[Solid], clutter: f64, random: &mut impl Rng) -> Vec<Solid> {
    let wanted = room.bounds.width() * room.bounds.height() * clutter;
    let doors: Vec<Rectangle> = room.doors.iter().map(|door| door.clearing(1.1)).collect();
    let standing: Vec<Rectangle> = standing.iter().filter_map(|solid| Rectangle::bounding(&solid.corners)).collect();
    let mut pieces: Vec<(Rectangle, Solid)> = Vec::new();
    for _ in 0..random_count(wanted, random) {
        for _ in 0..TRIES {
            let (against_wall, solid) = random_piece(&room.bounds, random);
            let Some(bounds) = Rectangle::bounding(&solid.corners) else { break };
            let wide = bounds.expanded(PASSAGE);
            let fits = doors.iter().all(|door| !door.overlaps(&bounds))
                && pieces.iter().map(|(other, _)| other).chain(&standing).all(|other| !other.overlaps(&wide))
                && if against_wall { leaves_passage(&room.bounds, &bounds) } else { holds(&room.bounds, &wide) };
            if fits {
                pieces.push((bounds, solid));
                break;
            }
        }
    }
    pieces.into_iter().map(|(_, solid)| solid).collect()
}

/// The equipment of a room: the same pieces at the same places in every room of its size, as seen from its door.
pub(super) fn equip_room(room: &Room) -> Vec<Solid> {
    let Some(door) = room.doors.first() else { return Vec::new() };
    let Rectangle { min, max } = room.bounds;
    // To a decimetre, as rooms of one size differ by rounding.
    let [width, depth] = [room.bounds.width(), room.bounds.height()].map(|side| (10.0 * side).floor() / 10.0);
    let mut random = ChaCha8Rng::seed_from_u64(((1e4 * width).round() + (10.0 * depth).round()) as u64);
    let clutter = between(&mut random, EQUIPMENT.0, EQUIPMENT.1);
    let door_at = Point2::new(door.centre.x - min.x, 0.0);
    let model = Room { bounds: Rectangle::new(0.0, 0.0, width, depth), doors: vec![Door { centre: door_at, ..*door }] };
    let is_door_above = door.centre.y > max.y;
    let place = |point: &Point2| {
        let y = if is_door_above { max.y - point.y } else { min.y + point.y };
        Point2::new(min.x + point.x, y)
    };
    let pieces = furnish_room(&model, &[], clutter, &mut random).into_iter();
    let placed = pieces.map(|piece| {
        let mut corners: Vec<Point2> = piece.corners.iter().map(place).collect();
        // A mirrored piece has its corners in the other order.
        if is_door_above {
            corners.reverse();
        }
        Solid { corners }
    });
    placed.collect()
}

/// Rows of shelves along the longer side of a room, with aisles between them, ways across, and a way all round. None in
/// a room that is too small.
pub(super) fn shelve_room(room: &Room, random: &mut impl Rng) -> Vec<Solid> {
    let (deep, aisle) = (between(random, 0.4, 1.0), between(random, 1.2, 2.2));
    let long = between(random, 3.0, 8.0);
    let inner = room.bounds.expanded(-aisle.max(SHELVES_FROM_WALLS));
    let is_wide = room.bounds.width() > room.bounds.height();
    let (along, across) = if is_wide { (inner.width(), inner.height()) } else { (inner.height(), inner.width()) };
    let (first, side) = (inner.min, |along: f64, across: f64| if is_wide { (along, across) } else { (across, along) });
    let mut shelves = Vec::new();
    for row in (0..).map(|row| f64::from(row) * (deep + aisle)).take_while(|row| row + deep <= across) {
        for start in (0..).map(|shelf| f64::from(shelf) * (long + aisle)).take_while(|start| start + 1.0 <= along) {
            let (low, high) = (side(start, row), side((start + long).min(along), row + deep));
            let shelf = Rectangle::new(first.x + low.0, first.y + low.1, first.x + high.0, first.y + high.1);
            shelves.push(shelf.into());
        }
    }
    shelves
}

/// Pilasters along the walls of a corridor, outside of what must stay clear.
pub(super) fn furnish_corridor(
    corridor: &Rectangle,
    clear: &[Rectangle],
    clutter: f64,
    random: &mut impl Rng,
) -> Vec<Solid> {
    let length = corridor.width().max(corridor.height());
    let wanted = length / PILASTER_SPACING * clutter * 10.0;
    let mut solids = Vec::new();
    for _ in 0..random_count(wanted, random) {
        let (long, deep) = (between(random, 0.3, 0.6), between(random, 0.12, 0.22));
        let along = between(random, 0.5, length - 0.5);
        let side = random.random_bool(0.5);
        let bounds = if corridor.width() > corridor.height() {
            let y = if side { corridor.min.y + deep / 2.0 } else { corridor.max.y - deep / 2.0 };
            Rectangle::round(Point2::new(corridor.min.x + along, y), long, deep)
        } else {
            let x = if side { corridor.min.x + deep / 2.0 } else { corridor.max.x - deep / 2.0 };
            Rectangle::round(Point2::new(x, corridor.min.y + along), deep, long)
        };
        if clear.iter().all(|clear| !clear.overlaps(&bounds)) {
            solids.push(bounds.into());
        }
    }
    solids
}

/// A whole number whose mean is `wanted`.
fn random_count(wanted: f64, random: &mut impl Rng) -> usize {
    (wanted + random.random::<f64>()).floor().clamp(0.0, 10_000.0) as usize
}

/// A cabinet or desk against a wall (`true`), a free-standing table, or a pillar.
fn random_piece(room: &Rectangle, random: &mut impl Rng) -> (bool, Solid) {
    let kind = random.random::<f64>();
    if kind < 0.6 {
        return (true, wall_piece(room, random));
    }
    let place = Point2::new(between(random, room.min.x, room.max.x), between(random, room.min.y, room.max.y));
    if kind < 0.8 {
        let yaw = between(random, -FRAC_PI_2, FRAC_PI_2);
        let table =
            Solid::turned_box(&pose(place.x, place.y, yaw), between(random, 0.8, 1.6), between(random, 0.6, 0.9));
        return (false, table);
    }
    (false, Solid::disc(place, between(random, 0.12, 0.3)))
}

fn wall_piece(room: &Rectangle, random: &mut impl Rng) -> Solid {
    let (long, deep) = (between(random, 0.6, 1.8), between(random, 0.35, 0.8));
    let along_x = random.random_bool(0.5);
    let far = random.random_bool(0.5);
    let bounds = if along_x {
        let x = between(random, room.min.x, room.max.x - long);
        let y = if far { room.max.y - deep } else { room.min.y };
        Rectangle::new(x, y, x + long, y + deep)
    } else {
        let y = between(random, room.min.y, room.max.y - long);
        let x = if far { room.max.x - deep } else { room.min.x };
        Rectangle::new(x, y, x + deep, y + long)
    };
    bounds.into()
}

/// Whether a robot can pass a piece against a wall on at least the side across from its wall, and the piece lies in the
/// room.
fn leaves_passage(room: &Rectangle, piece: &Rectangle) -> bool {
    let across = (room.width() - piece.width()).min(room.height() - piece.height());
    across >= PASSAGE && holds(&room.expanded(1e-6), piece)
}

fn holds(outer: &Rectangle, inner: &Rectangle) -> bool {
    outer.contains(&inner.min) && outer.contains(&inner.max)
}
