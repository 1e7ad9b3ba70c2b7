//! Random buildings: corridors with rooms on both sides.
//!
//! A building is one or more bands, each a corridor along x between two rows of rooms; where there are several bands,
//! corridors along y join them. Every room has a door to its corridor, so that every room can be reached. Coordinates
//! are those of the building: x from 0 to its width, y from 0 to its height, metres.

use super::furniture::{equip_room, furnish_corridor, furnish_room, shelve_room};
use super::room::{Door, Room, WALL};
use super::shape::{Rectangle, Solid, between};
use crate::shared::geometry::Point2;
use rand::{Rng, RngExt};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// A building wider than this has two corridors along y, metres.
const WIDE: f64 = 30.0;

/// How the rooms of a building are laid out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Layout {
    /// No two rooms are alike.
    #[default]
    Random,
    /// A corridor and the rooms along it look the same after half a turn, but for the furniture.
    Symmetric,
    /// All rooms are alike, but for the furniture.
    Repeated,
    /// As `repeated`, and in each room the same equipment stands at the same place, as in a ward or a hotel. Rooms of
    /// one size have the same equipment in every building.
    Equipped,
    /// Rooms as in `random`, with rows of shelves all through them instead of furniture, as in a warehouse or a
    /// library.
    Shelves,
}

impl Layout {
    /// Whether no two rooms are alike.
    fn is_random(self) -> bool {
        matches!(self, Self::Random | Self::Shelves)
    }

    /// Whether all rooms are alike.
    fn is_repeated(self) -> bool {
        matches!(self, Self::Repeated | Self::Equipped)
    }
}

/// Requested dimensions of a building, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BuildingSize {
    /// Along x.
    pub(super) width: f64,
    /// Along y.
    pub(super) height: f64,
    /// The mean size of a room along its corridor.
    pub(super) room_width: f64,
    /// The mean size of a room across it.
    pub(super) room_depth: f64,
    /// Between the walls of a corridor, centre to centre.
    pub(super) corridor_width: f64,
    /// Pieces of furniture a square metre.
    pub(super) clutter: f64,
    /// How the rooms are laid out.
    pub(super) layout: Layout,
}

/// A building.
#[derive(Clone, Debug, PartialEq)]
pub struct FloorPlan {
    /// The centre lines of the outer walls.
    pub bounds: Rectangle,
    /// The rooms, in an order in which neighbours in the list are neighbours in the building.
    pub rooms: Vec<Room>,
    /// The corridors between the faces of their walls; those along y cross those along x.
    pub corridors: Vec<Rectangle>,
    /// Walls, pillars and furniture.
    pub solids: Vec<Solid>,
    /// How many of the solids, from the first on, are walls.
    pub wall_count: usize,
    /// Which of the solids are the furniture of each room.
    pub furniture: Vec<Range<usize>>,
}

/// A row of rooms on one side of a corridor.
struct Row {
    low: f64,
    high: f64,
    /// The y of the wall towards the corridor.
    door_wall: f64,
}

impl FloorPlan {
    /// A random building. The limits of [`SimulatorParameters`](super::SimulatorParameters) leave every room about 1.5
    /// m wide and deep, or more.
    pub(super) fn random(size: &BuildingSize, random: &mut impl Rng) -> Self {
        let BuildingSize { width, height, room_depth, corridor_width, .. } = *size;
        let bounds = Rectangle::new(0.0, 0.0, width, height);
        let (rooms, corridors, solids, furniture) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut plan = Self { bounds, rooms, corridors, solids, wall_count: 0, furniture };
        for y in [0.0, height] {
            plan.wall_along_x(y, (0.0, width), &[]);
        }
        for x in [0.0, width] {
            plan.wall_along_y(x, (0.0, height), &[]);
        }
        // A band is a corridor and two rows of rooms.
        let bands = (height / (2.0 * room_depth + corridor_width)).round().max(1.0);
        let crossings = crossings(bands as usize, size, random);
        let spans = spans(width, &crossings);
        for band in 0..bands as usize {
            let bottom = height / bands * band as f64;
            let top = height / bands * (band + 1) as f64;
            let below = if size.layout.is_random() { between(random, 0.42, 0.58) } else { 0.5 };
            let low = bottom + (top - bottom - corridor_width) * below;
            let high = low + corridor_width;
            plan.corridors.push(Rectangle::new(0.0, low, width, high).expanded(-WALL / 2.0));
            let (first, first_wall) = (plan.rooms.len(), plan.solids.len());
            for row in [Row { low: bottom, high: low, door_wall: low }, Row { low: high, high: top, door_wall: high }] {
                if size.layout == Layout::Symmetric && row.low > bottom {
                    plan.turn_half(first, first_wall, &Point2::new(width, bottom + top));
                    continue;
                }
                for &span in &spans {
                    plan.rooms_of_span(&row, span, size, random);
                }
            }
            if band > 0 {
                spans.iter().for_each(|span| plan.wall_along_x(bottom, *span, &[]));
            }
            let rooms = &mut plan.rooms[first..];
            rooms.sort_by(|a, b| a.bounds.centre().x.total_cmp(&b.bounds.centre().x));
            if band % 2 == 1 {
                rooms.reverse();
            }
        }
        for (low, high) in crossings {
            plan.corridors.push(Rectangle::new(low, 0.0, high, height).expanded(-WALL / 2.0));
        }
        plan.wall_count = plan.solids.len();
        plan.furnish(size, random);
        plan
    }

    /// Adds the images of the rooms and walls from the given ones on, after half a turn. `sum` is the sum of a point
    /// and its image.
    fn turn_half(&mut self, first_room: usize, first_wall: usize, sum: &Point2) {
        let turned = |point: &Point2| Point2::from(sum.coords - point.coords);
        let image = |bounds: &Rectangle| Rectangle { min: turned(&bounds.max), max: turned(&bounds.min) };
        for number in first_room..self.rooms.len() {
            let Room { bounds, doors } = &self.rooms[number];
            let doors = doors.iter().map(|door| Door { centre: turned(&door.centre), ..*door }).collect();
            self.rooms.push(Room { bounds: image(bounds), doors });
        }
        for number in first_wall..self.solids.len() {
            let corners = self.solids[number].corners.iter().map(turned).collect();
            self.solids.push(Solid { corners });
        }
    }

    /// Puts furniture into the rooms, and pilasters into the corridors.
    fn furnish(&mut self, size: &BuildingSize, random: &mut impl Rng) {
        for room in &self.rooms {
            let first = self.solids.len();
            self.solids.extend(furniture_of(room, size, random));
            self.furniture.push(first..self.solids.len());
        }
        let clutter = size.clutter;
        let doors: Vec<Door> = self.rooms.iter().flat_map(|room| room.doors.iter().copied()).collect();
        let mut pillars = Vec::new();
        for (index, corridor) in self.corridors.iter().enumerate() {
            let others = self.corridors.iter().enumerate().filter(|(other, _)| *other != index);
            let clear: Vec<Rectangle> = doors
                .iter()
                .map(|door| door.clearing(0.6))
                .chain(others.map(|(_, other)| other.expanded(0.6)))
                .collect();
            pillars.extend(furnish_corridor(corridor, &clear, clutter, random));
        }
        self.solids.extend(pillars);
    }

    /// The same building, with other furniture in a share of its rooms.
    pub(super) fn rearranged(&self, share: f64, size: &BuildingSize, random: &mut impl Rng) -> Self {
        let mut plan = Self { solids: self.solids[..self.wall_count].to_vec(), furniture: Vec::new(), ..self.clone() };
        for (room, furniture) in self.rooms.iter().zip(&self.furniture) {
            let first = plan.solids.len();
            match random.random_bool(share) {
                true => plan.solids.extend(furniture_of(room, size, random)),
                false => plan.solids.extend_from_slice(&self.solids[furniture.clone()]),
            }
            plan.furniture.push(first..plan.solids.len());
        }
        let pilasters = self.furniture.last().map_or(self.wall_count, |last| last.end);
        plan.solids.extend_from_slice(&self.solids[pilasters..]);
        plan
    }

    /// Divides the part of a row between two corridors along y into rooms.
    fn rooms_of_span(&mut self, row: &Row, (left, right): (f64, f64), size: &BuildingSize, random: &mut impl Rng) {
        let is_repeated = size.layout.is_repeated();
        let walls = divide(left, right, size, random);
        let mut doors = vec![Vec::new(); walls.len().saturating_sub(1)];
        for (pair, doors) in walls.windows(2).zip(&mut doors) {
            let centre = Point2::new(pair[0] + 1.0, row.door_wall);
            doors.push(match is_repeated {
                true => Door { centre, width: 1.0, along_x: true },
                false => corridor_door((pair[0], pair[1]), row.door_wall, random),
            });
        }
        let corridor_doors: Vec<Door> = doors.iter().flatten().copied().collect();
        self.wall_along_x(row.door_wall, (left, right), &corridor_doors);
        for (index, &x) in walls.iter().enumerate() {
            let outer = x <= self.bounds.min.x || x >= self.bounds.max.x;
            if outer {
                continue;
            }
            // A room at a corner of two corridors may have a door to both.
            let at_crossing = index == 0 || index + 1 == walls.len();
            let chance = match at_crossing {
                _ if is_repeated => 0.0,
                true => 0.3,
                false => 0.15,
            };
            let door = (random.random_bool(chance)).then(|| Door {
                centre: Point2::new(x, between(random, row.low + 0.9, row.high - 0.9)),
                width: 0.95,
                along_x: false,
            });
            self.wall_along_y(x, (row.low, row.high), door.as_slice());
            for room in [index.checked_sub(1), Some(index)].into_iter().flatten() {
                if let Some(doors) = doors.get_mut(room) {
                    doors.extend(door);
                }
            }
        }
        for (pair, doors) in walls.windows(2).zip(doors) {
            let bounds = Rectangle::new(pair[0], row.low, pair[1], row.high).expanded(-WALL / 2.0);
            self.rooms.push(Room { bounds, doors });
        }
    }

    fn wall_along_x(&mut self, y: f64, (from, to): (f64, f64), doors: &[Door]) {
        for (start, end) in between_gaps(from, to, doors) {
            self.solids.push(Rectangle::new(start, y - WALL / 2.0, end, y + WALL / 2.0).into());
        }
    }

    fn wall_along_y(&mut self, x: f64, (from, to): (f64, f64), doors: &[Door]) {
        for (start, end) in between_gaps(from, to, doors) {
            self.solids.push(Rectangle::new(x - WALL / 2.0, start, x + WALL / 2.0, end).into());
        }
    }
}

/// What stands in a room.
fn furniture_of(room: &Room, size: &BuildingSize, random: &mut impl Rng) -> Vec<Solid> {
    match size.layout {
        Layout::Shelves => shelve_room(room, random),
        Layout::Equipped => {
            let mut solids = equip_room(room);
            solids.extend(furnish_room(room, &solids, size.clutter, random));
            solids
        }
        Layout::Random | Layout::Symmetric | Layout::Repeated => furnish_room(room, &[], size.clutter, random),
    }
}

/// What is left of a wall when the gaps of doors are taken out. Its ends reach half a wall further, to close corners.
fn between_gaps(from: f64, to: f64, doors: &[Door]) -> Vec<(f64, f64)> {
    let mut gaps: Vec<(f64, f64)> = doors.iter().map(Door::gap).collect();
    gaps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let starts = std::iter::once(from - WALL / 2.0).chain(gaps.iter().map(|gap| gap.1));
    let ends = gaps.iter().map(|gap| gap.0).chain(std::iter::once(to + WALL / 2.0));
    starts.zip(ends).filter(|(start, end)| start < end).collect()
}

/// The corridors along y, as ranges of x.
fn crossings(bands: usize, size: &BuildingSize, random: &mut impl Rng) -> Vec<(f64, f64)> {
    let BuildingSize { width, corridor_width, layout, .. } = *size;
    let places: &[(f64, f64)] = match (bands, width > WIDE) {
        (0 | 1, _) => &[],
        (_, false) if !layout.is_random() => &[(0.5, 0.5)],
        (_, true) if !layout.is_random() => &[(0.3, 0.3), (0.7, 0.7)],
        (_, false) => &[(0.35, 0.65)],
        (_, true) => &[(0.2, 0.35), (0.65, 0.8)],
    };
    let middles = places.iter().map(|&(low, high)| width * between(random, low, high));
    middles.map(|middle| (middle - corridor_width / 2.0, middle + corridor_width / 2.0)).collect()
}

/// The ranges of x between the corridors along y.
fn spans(width: f64, crossings: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let starts = std::iter::once(0.0).chain(crossings.iter().map(|crossing| crossing.1));
    let ends = crossings.iter().map(|crossing| crossing.0).chain(std::iter::once(width));
    starts.zip(ends).collect()
}

/// Places of the walls that divide a span into rooms of about the given width, its ends among them.
fn divide(left: f64, right: f64, size: &BuildingSize, random: &mut impl Rng) -> Vec<f64> {
    let rooms = ((right - left) / size.room_width).round().max(1.0) as usize;
    let (narrow, wide) = if size.layout.is_repeated() { (1.0, 1.0) } else { (0.7, 1.3) };
    let weights: Vec<f64> = (0..rooms).map(|_| between(random, narrow, wide)).collect();
    let total: f64 = weights.iter().sum();
    let mut walls = vec![left];
    let mut sum = 0.0;
    for weight in &weights[1..] {
        sum += weight;
        walls.push(left + (right - left) * sum / total);
    }
    walls.push(right);
    walls
}

/// A door in the wall towards the corridor. One room in seven is wide open.
fn corridor_door((left, right): (f64, f64), y: f64, random: &mut impl Rng) -> Door {
    let open = random.random_bool(0.15) && right - left > 3.2;
    let width = if open { 2.0 } else { between(random, 0.95, 1.15) };
    let margin = width / 2.0 + 0.2;
    Door { centre: Point2::new(between(random, left + margin, right - margin), y), width, along_x: true }
}

#[cfg(test)]
mod tests;
