//! Radio tags on walls, and the readings of their range.
//!
//! The model: a tag is read when it is within reach of the robot's centre and in line of sight. The range has
//! Gaussian noise; some readings are lost, and some are reflected and too long by 0.3 m to 2 m. The signal strength
//! falls with the square of the distance, from -45 dBm at one metre, with a deviation of 2 dB.

use super::clearances::Clearances;
use super::floor_plan::FloorPlan;
use super::ray_caster::RayCaster;
use super::room::WALL;
use super::shape::{Rectangle, between};
use crate::shared::geometry::{Point2, Pose2};
use nalgebra::Vector2;
use rand::seq::SliceRandom;
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// A tag sits so far off its wall, metres.
const OFF_WALL: f64 = 0.02;
/// Tags are not nearer to each other than this, metres.
const SPACING: f64 = 1.0;
/// A corridor counts as one place for tags in this length, metres.
const CORRIDOR_SECTION: f64 = 6.0;
/// How often a place is looked for in one round over all rooms.
const TRIES: usize = 20;

/// A radio tag.
#[derive(Clone, Debug, PartialEq)]
pub struct Tag {
    /// Its name.
    pub id: String,
    /// Where it is in the building, metres.
    pub place: Point2,
}

/// The model of a tag reader: its range and its errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReaderModel {
    /// The longest distance of a reading, metres.
    pub(super) reach: f64,
    /// Standard deviation of a range, metres.
    pub(super) noise: f64,
    /// Share of the readings that are lost, 0 to 1.
    pub(super) lost: f64,
    /// Share of the readings that come over a reflection, 0 to 1.
    pub(super) reflected: f64,
}

/// One reading of a tag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedReading {
    /// Which tag: its place in the list of tags.
    pub tag: usize,
    /// Metres.
    pub range: f64,
    /// Signal strength, dBm.
    pub rssi: f32,
}

impl ReaderModel {
    /// Reads all tags from a true pose in the building, in the order of the list.
    pub(super) fn read(
        &self,
        tags: &[Tag],
        world: &RayCaster,
        robot_pose: &Pose2,
        random: &mut impl Rng,
        mut reading: impl FnMut(SimulatedReading),
    ) {
        let antenna = Point2::from(robot_pose.translation.vector);
        for (tag, Tag { place, .. }) in tags.iter().enumerate() {
            let distance = (place - antenna).norm();
            let in_reach = distance <= self.reach;
            if !in_reach || !world.sees(&antenna, place) {
                continue;
            }
            let lost = random.random::<f64>() < self.lost;
            let reflected = random.random::<f64>() < self.reflected;
            let detour = between(random, 0.3, 2.0);
            let noise: f64 = random.sample(StandardNormal);
            let fading: f64 = random.sample(StandardNormal);
            if lost {
                continue;
            }
            let way = if reflected { distance + detour } else { distance };
            let rssi = -45.0 - 20.0 * way.max(0.1).log10() + 2.0 * fading;
            reading(SimulatedReading { tag, range: (way + self.noise * noise).max(0.0), rssi: rssi as f32 });
        }
    }
}

/// Puts tags on the walls of a building, spread over its rooms and corridors, where a robot can come near and see them.
/// There may be fewer than `count` where walls are short.
pub(super) fn place_tags(
    plan: &FloorPlan,
    space: &Clearances,
    world: &RayCaster,
    count: usize,
    random: &mut impl Rng,
) -> Vec<Tag> {
    let mut areas: Vec<Rectangle> = plan.rooms.iter().map(|room| room.bounds).collect();
    areas.extend(plan.corridors.iter().flat_map(sections));
    areas.shuffle(random);
    let mut places: Vec<Point2> = Vec::with_capacity(count);
    loop {
        let before = places.len();
        for area in &areas {
            if places.len() == count {
                break;
            }
            let mut candidates = (0..TRIES).map(|_| on_border(area, random));
            let fits = |(place, inwards): &(Point2, Vector2<f64>)| {
                places.iter().all(|other| (other - place).norm() >= SPACING)
                    && is_visible(plan, space, world, place, inwards)
            };
            if let Some((place, _)) = candidates.find(fits) {
                places.push(place);
            }
        }
        if places.len() == count || places.len() == before {
            break;
        }
    }
    places.into_iter().enumerate().map(|(number, place)| Tag { id: format!("tag{number:02}"), place }).collect()
}

/// Cuts a corridor into pieces of about one section each.
fn sections(corridor: &Rectangle) -> Vec<Rectangle> {
    let along_x = corridor.width() > corridor.height();
    let count = (corridor.width().max(corridor.height()) / CORRIDOR_SECTION).round().max(1.0);
    let size = if along_x {
        Vector2::new(corridor.width() / count, corridor.height())
    } else {
        Vector2::new(corridor.width(), corridor.height() / count)
    };
    let step = if along_x { Vector2::new(size.x, 0.0) } else { Vector2::new(0.0, size.y) };
    (0..count as usize)
        .map(|piece| corridor.min + step * piece as f64)
        .map(|min| Rectangle { min, max: min + size })
        .collect()
}

/// A random point just inside the border of an area, and the direction from the border inwards.
fn on_border(area: &Rectangle, random: &mut impl Rng) -> (Point2, Vector2<f64>) {
    let inner = area.expanded(-OFF_WALL);
    let along = random.random::<f64>() * 2.0 * (inner.width() + inner.height());
    let (x, y) = (inner.min.x + along, inner.min.y + along - inner.width());
    if along < inner.width() {
        (Point2::new(x, inner.min.y), Vector2::y())
    } else if along < inner.width() + inner.height() {
        (Point2::new(inner.max.x, y), -Vector2::x())
    } else if along < 2.0 * inner.width() + inner.height() {
        (Point2::new(x - inner.width() - inner.height(), inner.max.y), -Vector2::y())
    } else {
        (Point2::new(inner.min.x, y - inner.width() - inner.height()), Vector2::x())
    }
}

/// Whether there is a wall behind a place and a robot in front of it could read a tag there.
fn is_visible(plan: &FloorPlan, space: &Clearances, world: &RayCaster, place: &Point2, inwards: &Vector2<f64>) -> bool {
    let outwards = (-inwards.y).atan2(-inwards.x);
    world.cast(place, outwards, WALL / 2.0).is_some()
        && plan.solids.iter().all(|solid| solid.distance(place) > OFF_WALL / 2.0)
        && space.places_in(&Rectangle::round(*place, 3.0, 3.0)).iter().any(|robot| world.sees(robot, place))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shared::geometry::pose;
    use crate::simulator::shape::Solid;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const READER: ReaderModel = ReaderModel { reach: 3.0, noise: 0.05, lost: 0.0, reflected: 0.0 };

    fn world() -> (Vec<Tag>, RayCaster) {
        let walls = [Rectangle::new(2.0, -5.0, 2.2, 5.0), Rectangle::new(-6.0, -5.0, -5.8, 5.0)];
        let tag = |id: &str, x, y| Tag { id: id.into(), place: Point2::new(x, y) };
        let tags = vec![tag("near", 1.98, 1.0), tag("behind", 2.22, 1.0), tag("far", -5.78, 0.0)];
        (tags, RayCaster::new(&walls.map(Solid::from)))
    }

    fn readings(reader: ReaderModel) -> Vec<SimulatedReading> {
        let (tags, world) = world();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let mut readings = Vec::new();
        for _ in 0..4000 {
            reader.read(&tags, &world, &pose(0.0, 0.0, 1.0), &mut random, |reading| readings.push(reading));
        }
        readings
    }

    #[test]
    fn only_tags_in_reach_and_in_sight_are_read_and_with_the_noise_that_was_asked_for() {
        let readings = readings(READER);
        assert_eq!(readings.len(), 4000);
        assert!(readings.iter().all(|reading| reading.tag == 0));
        let distance = f64::hypot(1.98, 1.0);
        let squares: f64 = readings.iter().map(|reading| (reading.range - distance).powi(2)).sum();
        let deviation = (squares / 4000.0).sqrt();
        assert!((deviation - 0.05).abs() < 0.004, "{deviation}");
        let strength = readings.iter().map(|reading| f64::from(reading.rssi)).sum::<f64>() / 4000.0;
        assert!((strength + 45.0 + 20.0 * distance.log10()).abs() < 0.2, "{strength} dBm");
    }

    #[test]
    fn readings_are_lost_and_reflected_as_often_as_asked() {
        let readings = readings(ReaderModel { lost: 0.3, reflected: 0.1, ..READER });
        assert!((readings.len() as f64 / 4000.0 - 0.7).abs() < 0.03);
        let long = readings.iter().filter(|reading| reading.range > 2.45).count();
        assert!((long as f64 / readings.len() as f64 - 0.1).abs() < 0.02);
    }

    #[test]
    fn a_reach_or_a_pose_that_is_no_number_reads_nothing() {
        let (tags, world) = world();
        let mut random = ChaCha8Rng::seed_from_u64(5);
        let nan = ReaderModel { reach: f64::NAN, ..READER };
        nan.read(&tags, &world, &pose(0.0, 0.0, 0.0), &mut random, |_| panic!("read"));
        READER.read(&tags, &world, &pose(f64::NAN, 0.0, 0.0), &mut random, |_| panic!("read"));
    }

    #[test]
    fn a_long_corridor_is_several_places_for_tags() {
        let sections = sections(&Rectangle::new(1.0, 2.0, 19.0, 4.0));
        assert_eq!(sections.len(), 3);
        assert_eq!(sections[2], Rectangle::new(13.0, 2.0, 19.0, 4.0));
    }
}
