//! Maps for the tests of the aligners.

use super::RatedPose;
use gridweave_stages::registration::search::{NamedMap, SearchRefusal};
use gridweave_stages::shared::geometry::{Grid, GridGeometry, pose};
use gridweave_stages::shared::test_world::floor_plan::DrawnMap;

/// A drawn map as that of a robot.
pub(crate) fn named<'a>(robot: &'a str, map: &'a DrawnMap) -> NamedMap<'a> {
    NamedMap { robot, grid: Grid::new(map.geometry, &map.cells).unwrap() }
}

/// Checks that a method refuses a map without walls and a map that is longer than a maximum extent, and aligns a single
/// wall cell, with `around` in the other cells, with any map.
pub(crate) fn check_extreme_maps(
    office: &DrawnMap,
    around: i8,
    align: impl Fn(&NamedMap<'_>, &NamedMap<'_>, f64) -> Result<Vec<RatedPose>, SearchRefusal>,
) {
    let geometry = GridGeometry { width: 10, height: 10, resolution: 0.05, origin: pose(1e6, -1e6, 0.3) };
    let (empty, mut cells) = ([0; 100], [around; 100]);
    cells[37] = 100;
    let [empty, one_cell] =
        [&empty, &cells].map(|cells| NamedMap { robot: "b", grid: Grid::new(geometry, cells).unwrap() });
    let office = named("a", office);
    assert_eq!(align(&office, &empty, 400.0).unwrap_err().to_string(), "the map of b has no walls");
    for (a, b) in [(&office, &one_cell), (&one_cell, &office), (&one_cell, &one_cell)] {
        let found = align(a, b, 400.0).unwrap();
        assert!(found.iter().all(|one| one.covariance.iter().all(|value| value.is_finite())), "{found:?}");
    }
    let refusal = align(&office, &one_cell, 15.0).unwrap_err();
    assert!(refusal.to_string().contains("longer than 15 m"), "{refusal}");
}
