//! Buildings whose rooms are alike down to their equipment, as wards, hotels and laboratories are: what a map merger
//! takes most easily for another place.

use super::kinds::Kind;
use super::library::SimulatedPair;
use super::worlds::{PairWorld, Seeds};
use gridweave_runtime::stage::Registry;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

/// The name of the kind of building.
pub(crate) const WARDS: &str = "wards";
/// What the pairs of maps of two such buildings with the same rooms are called.
pub(crate) const SAME_ROOMS: &str = "two simulated buildings of the same rooms";
/// Worlds of this kind have numbers from here on.
const FIRST: u64 = 1_000_000;
/// How often the robots have no room in common.
const APART: f64 = 0.5;

/// Two buildings of the same rooms, and two robots in each. They differ in the number of rooms, in what else stands
/// there, and in what the robots see by.
pub(crate) struct SameRooms {
    /// A name for both.
    pub(crate) name: String,
    pub(crate) buildings: [SimulatedPair; 2],
}

/// So many pairs of buildings. Those in which robots find no way are left out.
pub(crate) fn same_rooms(count: u64, seeds: Seeds, registry: &Registry) -> Vec<SameRooms> {
    let pair = |number: u64| {
        let first = FIRST + 2 * number;
        let building = |number: u64| {
            let seed = seeds.seed(number);
            let [mut rooms, mut random] = [seeds.seed(first) << 8, seed].map(ChaCha8Rng::seed_from_u64);
            let world = PairWorld::simulate(WARDS, &settings(&mut rooms, &mut random), seed, registry)?;
            SimulatedPair::of(world, number)
        };
        Some(SameRooms { name: format!("{WARDS} {number}"), buildings: [building(first)?, building(first + 1)?] })
    };
    (0..count).into_par_iter().filter_map(pair).collect()
}

/// Settings of the simulator for a building whose rooms are those of one random number generator, and all else of it
/// those of another one.
fn settings(rooms: &mut impl Rng, random: &mut impl Rng) -> Vec<String> {
    let mut between = |low: f64, high: f64| low + (high - low) * rooms.random::<f64>();
    let (room_width, room_depth) = (between(2.6, 7.0), between(4.0, 8.0));
    let (corridor_width, clutter) = (between(1.6, 3.0), between(0.0, 0.12));
    let bands = if random.random_bool(0.7) { 1.0 } else { 2.0 };
    let in_a_row = (f64::from(random.random_range(10_u8..50)) / room_width).floor().max(3.0);
    let mut settings = vec![
        "robots=2".to_owned(),
        "tags=0".to_owned(),
        "snapshots=1".to_owned(),
        "layout=\"equipped\"".to_owned(),
        format!("width={:.2}", in_a_row * room_width),
        format!("height={:.2}", bands * (2.0 * room_depth + corridor_width)),
        format!("room_width={room_width:.2}"),
        format!("room_depth={room_depth:.2}"),
        format!("corridor_width={corridor_width:.2}"),
        format!("clutter={clutter:.3}"),
    ];
    settings.extend(Kind::Repeated.robot(random));
    let overlap = if random.random_bool(APART) { 0.0 } else { random.random::<f64>() };
    settings.push(format!("overlap={overlap:.3}"));
    settings
}
