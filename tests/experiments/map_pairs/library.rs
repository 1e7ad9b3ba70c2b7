//! Maps of many buildings, and parts of them.

use super::kinds::Kind;
use super::worlds::{self, PairWorld, Seeds};
use crate::log::last_maps;
use crate::map_pairs::truth::Closeness;
use crate::trial::files;
use anyhow::{Context, Result};
use gridweave_logs::map_file::{GridMap, Thresholds, load_as};
use gridweave_runtime::ros::Time;
use gridweave_runtime::stage::Registry;
use gridweave_stages::shared::geometry::{Grid, GridGeometry, Pose2, UNKNOWN, is_known, pose};
use nalgebra::Point2;
use rand::{Rng, RngExt};
use rayon::prelude::*;
use serde::Deserialize;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

/// The share of a map's known part that is cut out, along x and along y.
const SHARE: (f64, f64) = (0.4, 1.0);
/// Cells become wider by at most this.
const MOST_WIDER: f64 = 1.3;

/// A map, and which building it is of.
#[derive(Clone, Debug)]
pub(crate) struct MapOfBuilding {
    pub(crate) building: String,
    /// What it may be one building with; none if it surely is none.
    doubt: Option<String>,
    pub(crate) name: String,
    geometry: GridGeometry,
    cells: Vec<i8>,
}

impl MapOfBuilding {
    fn new(name: String, map: GridMap) -> Self {
        let building = name.split(['_', '-']).next().unwrap_or(&name).to_owned();
        Self { building, doubt: None, name, geometry: GridGeometry::from(&map.info), cells: map.cells }
    }

    /// Whether another map is surely of another building.
    pub(crate) fn is_of_another_building(&self, other: &Self) -> bool {
        self.building != other.building && (self.doubt.is_none() || self.doubt != other.doubt)
    }

    /// The map in a file.
    pub(crate) fn of_file(yaml: &Path) -> Result<Self> {
        // As the stage `map_file_source` reads it.
        let (map, _) =
            load_as(yaml, Thresholds::ByPicture).with_context(|| format!("cannot read {}", yaml.display()))?;
        Ok(Self::new(yaml.file_stem().unwrap_or_default().to_string_lossy().into_owned(), map))
    }

    /// Its cells.
    pub(crate) fn grid(&self) -> Result<Grid<'_>> {
        Grid::new(self.geometry, &self.cells).with_context(|| format!("the map {} cannot be used", self.name))
    }

    /// It as it is written to a file.
    pub(crate) fn to_file(&self) -> GridMap {
        GridMap { info: self.geometry.meta_data(Time::default()), cells: self.cells.clone() }
    }

    /// A part of it, turned, in other cells.
    pub(crate) fn part(&self, random: &mut impl Rng) -> Self {
        let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let (width, height) = (self.geometry.width, self.geometry.height);
        let known = (0..self.cells.len()).filter(|index| is_known(self.cells[*index]));
        let bounds = known.fold([width, 0, height, 0], |[left, right, low, high], index| {
            let (column, row) = (index % width, index / width);
            [left.min(column), right.max(column + 1), low.min(row), high.max(row + 1)]
        });
        let [left, right, low, high] = bounds.map(|bound| bound as f64);
        let mut window = |from: f64, to: f64| {
            let share = between(SHARE.0, SHARE.1);
            let start = from + between(0.0, 1.0) * (1.0 - share) * (to - from);
            (start, start + share * (to - from))
        };
        let (columns, rows) = (window(left, right), window(low, high));
        let (yaw, wider) = (between(0.0, TAU), between(1.0, MOST_WIDER));
        // The part, turned about its middle, in a square that holds it.
        let middle = Point2::new(0.5 * (columns.0 + columns.1), 0.5 * (rows.0 + rows.1));
        let diagonal = (columns.1 - columns.0).hypot(rows.1 - rows.0);
        let side = (diagonal / wider).ceil() as usize + 2;
        let transform_part_map = pose(0.0, 0.0, yaw);
        let cells = (0..side * side).map(|index| {
            let place = |number: usize| (number as f64 + 0.5 - 0.5 * side as f64) * wider;
            let place = middle
                + transform_part_map.inverse() * nalgebra::Vector2::new(place(index % side), place(index / side));
            let is_inside = (columns.0..columns.1).contains(&place.x) && (rows.0..rows.1).contains(&place.y);
            if is_inside { self.cells[place.y as usize * width + place.x as usize] } else { UNKNOWN }
        });
        let resolution = self.geometry.resolution * wider;
        let geometry = GridGeometry { width: side, height: side, resolution, origin: pose(0.0, 0.0, 0.0) };
        Self { cells: cells.collect(), geometry, ..self.clone() }
    }
}

/// What the `index.json` of a collection says of a map.
#[derive(Debug, Deserialize)]
struct Indexed {
    name: String,
    place: String,
    doubt: Option<String>,
}

/// The maps of a collection: those that its `index.json` names, in the folder `maps`.
fn of_collection(folder: &Path, index: &Path) -> Result<Vec<MapOfBuilding>> {
    let text = std::fs::read(index).with_context(|| format!("cannot read {}", index.display()))?;
    let indexed: Vec<Indexed> =
        serde_json::from_slice(&text).with_context(|| format!("cannot read {}", index.display()))?;
    let map = |Indexed { name, place, doubt }: Indexed| {
        let map = MapOfBuilding::of_file(&folder.join("maps").join(format!("{name}.yaml")))?;
        Ok(MapOfBuilding { building: place, doubt, ..map })
    };
    indexed.into_iter().map(map).collect()
}

/// The last map of each robot of a log.
pub(crate) fn maps_of_log(log: &Path) -> Result<Vec<MapOfBuilding>> {
    let name = log.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let last = last_maps(log)?.into_iter();
    Ok(last.map(|(topic, map)| MapOfBuilding::new(format!("{name}{topic}"), map)).collect())
}

/// Maps of many buildings.
pub(crate) struct Library {
    pub(crate) maps: Vec<MapOfBuilding>,
}

impl Library {
    /// The map files of folders, and the last maps of their logs.
    pub(crate) fn of_folders(folders: &[PathBuf]) -> Result<Self> {
        let mut maps = Vec::new();
        for folder in folders {
            let index = folder.join("index.json");
            if index.exists() {
                maps.extend(of_collection(folder, &index)?);
            }
        }
        for file in folders.iter().map(|folder| files(folder)).collect::<Result<Vec<_>>>()?.into_iter().flatten() {
            match file.extension().and_then(|extension| extension.to_str()) {
                Some("yaml") => maps.push(MapOfBuilding::of_file(&file)?),
                Some("mcap") => maps.extend(maps_of_log(&file)?),
                _ => {}
            }
        }
        Ok(Self { maps })
    }

    /// The maps of simulated worlds, each of another building.
    pub(crate) fn of_worlds(pairs: Vec<SimulatedPair>) -> Self {
        Self { maps: pairs.into_iter().flat_map(|pair| pair.maps).collect() }
    }

    /// Whether there are maps of two buildings.
    pub(crate) fn has_two_buildings(&self) -> bool {
        self.maps.iter().any(|map| map.is_of_another_building(&self.maps[0]))
    }

    /// Any two maps of different buildings, of which there are two.
    pub(crate) fn two_buildings(&self, random: &mut impl Rng) -> [&MapOfBuilding; 2] {
        let first = &self.maps[random.random_range(0..self.maps.len())];
        let others: Vec<&MapOfBuilding> = self.maps.iter().filter(|map| map.is_of_another_building(first)).collect();
        [first, others[random.random_range(0..others.len())]]
    }
}

/// The last maps of the two robots of a simulated world.
pub(crate) struct SimulatedPair {
    /// The number of the world among those of its seeds.
    pub(crate) number: u64,
    pub(crate) world: PairWorld,
    pub(crate) maps: [MapOfBuilding; 2],
}

impl SimulatedPair {
    pub(super) fn of(world: PairWorld, number: u64) -> Option<Self> {
        let last = last_maps(&world.world.log).ok()?.into_iter();
        let mut maps = last.map(|(topic, map)| MapOfBuilding::new(format!("{number}-{}{topic}", world.name), map));
        let maps = [maps.next()?, maps.next()?];
        Some(Self { number, world, maps })
    }

    /// The kind of building.
    pub(crate) fn kind(&self) -> &'static str {
        self.world.kind
    }

    /// How near `T_a_b` is to the truth.
    pub(crate) fn closeness(&self, transform_a_b: &Pose2) -> Closeness {
        self.world.closeness(worlds::ROBOTS, transform_a_b).unwrap_or(Closeness::Wrong)
    }

    /// Whether `T_a_b` aligns the places that both robots have seen.
    pub(crate) fn is_right(&self, transform_a_b: &Pose2) -> bool {
        self.world.is_right(worlds::ROBOTS, transform_a_b).unwrap_or(false)
    }
}

/// The robots of so many simulated worlds, of one kind if that is named. Worlds in which robots find no way are left
/// out.
pub(crate) fn simulated_pairs(count: u64, kind: Option<&str>, seeds: Seeds, registry: &Registry) -> Vec<SimulatedPair> {
    let is_wanted = |number: &u64| kind.is_none_or(|kind| Kind::of(*number).name() == kind);
    // A kind that there is not makes no worlds, and must not be looked for without end.
    let kinds = Kind::ALL.len() as u64;
    let numbers: Vec<u64> = (0..count.saturating_mul(kinds)).filter(is_wanted).take(count as usize).collect();
    let pair = |number: u64| SimulatedPair::of(worlds::varied(seeds, number, registry)?, number);
    numbers.into_par_iter().filter_map(pair).collect()
}
