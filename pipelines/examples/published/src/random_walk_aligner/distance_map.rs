//! How far it is from every cell to the nearest one of a class.

use gridweave_stages::registration::search::{Content, Raster};
use nalgebra::Vector2;

/// The Manhattan distance, in cells, from every cell of a raster to the nearest one of a class: Carpin, Birk and
/// Jucikas 2005, who find it in two sweeps over the map.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceMap {
    width: usize,
    height: usize,
    /// Row by row.
    distances: Vec<u32>,
}

impl DistanceMap {
    /// The distances to a class; `None` if no cell is of it.
    pub fn new(raster: &Raster, class: Content) -> Option<Self> {
        let (width, height) = (raster.width, raster.height);
        // Longer than any way there is.
        let far = (width + height) as u32;
        let mut distances: Vec<u32> =
            raster.cells.iter().map(|content| if *content == class { 0 } else { far }).collect();
        if !distances.contains(&0) {
            return None;
        }
        for index in 0..distances.len() {
            let left = if index % width > 0 { distances[index - 1] + 1 } else { far };
            let below = if index >= width { distances[index - width] + 1 } else { far };
            distances[index] = distances[index].min(left).min(below);
        }
        for index in (0..distances.len()).rev() {
            let right = if index % width + 1 < width { distances[index + 1] + 1 } else { far };
            let above = distances.get(index + width).map_or(far, |above| above + 1);
            distances[index] = distances[index].min(right).min(above);
        }
        Some(Self { width, height, distances })
    }

    /// The distance from a place in cells: that of the cell it lies in or, outside, that of the nearest cell and the
    /// way to it. NaN for one that is no place.
    pub fn at(&self, place: &Vector2<f64>) -> f64 {
        let inside = |place: f64, count: usize| place.clamp(0.0, count as f64 - 1.0);
        let (x, y) = (inside(place.x.floor(), self.width), inside(place.y.floor(), self.height));
        let way = (place.x.floor() - x).abs() + (place.y.floor() - y).abs();
        let cell = self.distances.get(y as usize * self.width + x as usize);
        cell.map_or(f64::NAN, |distance| f64::from(*distance) + way)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn raster(width: usize, cells: Vec<Content>) -> Raster {
        let height = cells.len() / width;
        Raster { corner: Vector2::zeros(), cell: 1.0, width, height, cells }
    }

    proptest! {
        #[test]
        fn distances_are_the_least_over_all_cells_of_the_class(
            width in 1usize..12, walls in prop::collection::vec(prop::bool::weighted(0.1), 60), x in -9.0..20.0, y in -9.0..20.0,
        ) {
            let cells: Vec<Content> = walls[..60 / width * width]
                .iter()
                .map(|wall| if *wall { Content::Wall } else { Content::Free })
                .collect();
            let raster = raster(width, cells);
            let of_class = |(index, content): (usize, &Content)| (*content == Content::Wall).then_some((index % width, index / width));
            let all: Vec<(usize, usize)> = raster.cells.iter().enumerate().filter_map(of_class).collect();
            let map = DistanceMap::new(&raster, Content::Wall);
            prop_assert_eq!(map.is_none(), all.is_empty());
            if let Some(map) = map {
                let (x, y): (f64, f64) = (x, y);
                let column = x.floor().clamp(0.0, width as f64 - 1.0);
                let row = y.floor().clamp(0.0, raster.height as f64 - 1.0);
                let way = (x.floor() - column).abs() + (y.floor() - row).abs();
                let distance = |(i, j): &(usize, usize)| (*i as f64 - column).abs() + (*j as f64 - row).abs();
                let expected = all.iter().map(distance).fold(f64::INFINITY, f64::min) + way;
                prop_assert_eq!(map.at(&Vector2::new(x, y)), expected);
            }
        }
    }
}
