//! Random buildings: corridors with rooms on both sides.
//!
//! A building is one or more bands, each a corridor along x between two rows of rooms; where there are several bands,
//! corridors along y join them. Every room has a door to its corridor, so that every room can be reached. Coordinates
//! are those of the building: x from 0 to its width, y from 0 to its height, metres.

use super::furniture::{furnish_corridor, furnish_room};
use super::room::{Door, Room, WALL};
use super::shape::{Rectangle, Solid, between};
use crate::geometry::Point2;
use rand::{Rng, RngExt};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// About how deep a band is: a corridor and two rows of rooms, metres.
const BAND: f64 = 14.0;
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
}

/// What a building is asked to be, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BuildingSize {
    /// Along x.
    pub(super) width: f64,
    /// Along y.
    pub(super) height: f64,
    /// The mean size of a room along its corridor.
    pub(super) room_width: f64,
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
}

/// A row of rooms on one side of a corridor.
struct Row {
    low: f64,
    high: f64,
    /// The y of the wall towards the corridor.
    door_wall: f64,
}

impl FloorPlan {
    /// A random building. The limits of [`SimulatorParameters`](super::SimulatorParameters) leave every room about 1.5 m wide and deep, or more.
    pub(super) fn random(size: &BuildingSize, random: &mut impl Rng) -> Self {
        let BuildingSize { width, height, corridor_width, .. } = *size;
        let bounds = Rectangle::new(0.0, 0.0, width, height);
        let mut plan = Self { bounds, rooms: Vec::new(), corridors: Vec::new(), solids: Vec::new(), wall_count: 0 };
        for y in [0.0, height] {
            plan.wall_along_x(y, (0.0, width), &[]);
        }
        for x in [0.0, width] {
            plan.wall_along_y(x, (0.0, height), &[]);
        }
        let bands = (height / BAND).round().max(1.0);
        let crossings = crossings(bands as usize, size, random);
        let spans = spans(width, &crossings);
        for band in 0..bands as usize {
            let bottom = height / bands * band as f64;
            let top = height / bands * (band + 1) as f64;
            let below = if size.layout == Layout::Random { between(random, 0.42, 0.58) } else { 0.5 };
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
        plan.furnish(size.clutter, random);
        plan
    }

    /// Adds the images of the rooms and walls from the given ones on, after half a turn. `sum` is the sum of a point and
    /// its image.
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

    /// Puts `clutter` pieces of furniture a square metre into the rooms, and pilasters into the corridors.
    fn furnish(&mut self, clutter: f64, random: &mut impl Rng) {
        for room in &self.rooms {
            self.solids.extend(furnish_room(room, clutter, random));
        }
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

    /// Divides the part of a row between two corridors along y into rooms.
    fn rooms_of_span(&mut self, row: &Row, (left, right): (f64, f64), size: &BuildingSize, random: &mut impl Rng) {
        let is_repeated = size.layout == Layout::Repeated;
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
        (_, false) if layout != Layout::Random => &[(0.5, 0.5)],
        (_, true) if layout != Layout::Random => &[(0.3, 0.3), (0.7, 0.7)],
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
    let (narrow, wide) = if size.layout == Layout::Repeated { (1.0, 1.0) } else { (0.7, 1.3) };
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
mod tests {
    use super::*;
    use crate::geometry::PointIndex;
    use crate::simulator::free_space::FreeSpace;
    use proptest::prelude::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn size() -> impl Strategy<Value = BuildingSize> {
        let layout = prop_oneof![Just(Layout::Random), Just(Layout::Symmetric), Just(Layout::Repeated)];
        (10.0..45.0, 9.0..45.0, 2.5..8.0, 1.4..3.0, 0.0..0.5, layout).prop_map(
            |(width, height, room_width, corridor_width, clutter, layout)| BuildingSize {
                width,
                height,
                room_width,
                corridor_width,
                clutter,
                layout,
            },
        )
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        #[test]
        fn every_room_and_corridor_can_be_reached(size in size(), seed: u64) {
            let plan = FloorPlan::random(&size, &mut ChaCha8Rng::seed_from_u64(seed));
            prop_assert!(plan.rooms.len() >= 2);
            let space = FreeSpace::new(&plan.bounds, &plan.solids, &plan.corridors[0].centre());
            for area in plan.rooms.iter().map(|room| &room.bounds).chain(&plan.corridors) {
                let places = space.places_in(area).len();
                let cells = area.expanded(-0.3).width() * area.expanded(-0.3).height() / 0.01;
                prop_assert!(places as f64 > 0.15 * cells, "{places} of {cells} cells of {area:?}");
            }
        }

        #[test]
        fn the_building_is_closed_and_its_rooms_do_not_overlap(size in size(), seed: u64) {
            let plan = FloorPlan::random(&size, &mut ChaCha8Rng::seed_from_u64(seed));
            let space = FreeSpace::new(&plan.bounds.expanded(1.0), &plan.solids, &plan.corridors[0].centre());
            for place in space.places_in(&plan.bounds.expanded(2.0)) {
                prop_assert!(plan.bounds.contains(&place), "{place} is outside");
            }
            for (index, room) in plan.rooms.iter().enumerate() {
                prop_assert!(plan.rooms[..index].iter().all(|other| !other.bounds.overlaps(&room.bounds)));
                prop_assert!(plan.corridors.iter().all(|corridor| !corridor.overlaps(&room.bounds)));
                prop_assert!(room.bounds.width() > 1.3 && room.bounds.height() > 1.3, "{:?}", room.bounds);
            }
        }
    }

    #[test]
    fn a_symmetric_building_is_the_same_after_half_a_turn() {
        let size = BuildingSize {
            width: 20.0,
            height: 15.0,
            room_width: 4.5,
            corridor_width: 2.0,
            clutter: 0.0,
            layout: Layout::Symmetric,
        };
        for seed in 0..5 {
            let plan = FloorPlan::random(&size, &mut ChaCha8Rng::seed_from_u64(seed));
            let space = FreeSpace::new(&plan.bounds, &plan.solids, &plan.corridors[0].centre());
            let places = space.places_in(&plan.bounds);
            let turned: Vec<Point2> = places.iter().map(|place| Point2::new(20.0 - place.x, 15.0 - place.y)).collect();
            let (turned, _) = PointIndex::new(&turned, 0.2);
            let same = places.iter().filter(|place| turned.nearest(place, 0.11).is_some()).count();
            assert!(same as f64 > 0.98 * places.len() as f64, "{same} of {}", places.len());
        }
    }

    #[test]
    fn doors_are_gaps_in_walls() {
        let doors = [3.0, 1.0].map(|x| Door { centre: Point2::new(x, 0.0), width: 1.0, along_x: true });
        let parts = between_gaps(0.0, 5.0, &doors);
        assert_eq!(parts, [(-WALL / 2.0, 0.5), (1.5, 2.5), (3.5, 5.0 + WALL / 2.0)]);
    }
}
