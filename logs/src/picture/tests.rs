use super::*;
use gridweave_runtime::ros::{MapMetaData, Point, TopologicalMap, TopologicalNode, TopologicalPath};
use nalgebra::{Isometry2, Vector2};

fn info(width: u32, height: u32, resolution: f32) -> MapMetaData {
    MapMetaData { width, height, resolution, ..Default::default() }
}

fn layer(info: MapMetaData, cells: &[i8]) -> MapLayer<'_> {
    MapLayer { name: "", colour: robot_colour(0), info, cells, transform_world_map: Isometry2::identity() }
}

fn render_map(map: &MapLayer<'_>) -> Result<Picture, PictureError> {
    Picture::of(&Scene { maps: &[*map], ..Scene::default() })
}

fn render_overlay(maps: &[MapLayer<'_>], marks: &[Marks]) -> Result<Picture, PictureError> {
    Picture::of(&Scene { maps, cells: Cells::Coloured, marks, grid: None })
}

fn pixels(picture: &Picture) -> RgbImage {
    picture.drawing.pixels().unwrap()
}

fn at(x: f64, y: f64, yaw: f64) -> Isometry2<f64> {
    Isometry2::new(Vector2::new(x, y), yaw)
}

/// The number of pixels with a colour.
fn count(picture: &Picture, colour: [u8; 3]) -> usize {
    pixels(picture).pixels().filter(|pixel| pixel.0 == colour).count()
}

/// The colour of the cell in a column from the left and a row from the top, each of 8 x 8 pixels.
fn cell(picture: &Picture, column: u32, row: u32) -> [u8; 3] {
    pixels(picture).get_pixel(8 + column * 8 + 4, 8 + row * 8 + 4).0
}

#[test]
fn cells_are_grey_white_and_black_with_row_0_at_the_bottom() {
    // Far from the origin of the world, so that no axis covers the cells.
    let layer = MapLayer { transform_world_map: at(50.0, 50.0, 0.0), ..layer(info(2, 2, 0.1), &[0, 100, -1, 0]) };
    let picture = render_map(&layer).unwrap();
    assert_eq!(picture.drawing.image.dimensions(), (16, 16));
    let cells = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(column, row)| cell(&picture, column, row));
    assert_eq!(cells, [[205; 3], [255; 3], [255; 3], [0; 3]]);
    assert!((picture.metres_per_pixel - 0.0125).abs() < 1e-9);
    assert!((picture.scale_bar - 0.05).abs() < 1e-12);
}

#[test]
fn a_rotated_map_is_drawn_at_its_pose() {
    // A wall along x, rotated by a quarter turn about its corner, points up.
    let layer = MapLayer {
        transform_world_map: at(50.0, 50.0, std::f64::consts::FRAC_PI_2),
        ..layer(info(5, 1, 0.1), &[100; 5])
    };
    let (width, height) = render_map(&layer).unwrap().drawing.image.dimensions();
    assert_eq!((width, height), (8, 40));
    let mut turned = info(5, 1, 0.1);
    turned.origin = at(50.0, 50.0, std::f64::consts::FRAC_PI_2).into();
    let by_origin = MapLayer { info: turned, transform_world_map: Isometry2::identity(), ..layer };
    assert_eq!(render_map(&by_origin).unwrap().drawing.image.dimensions(), (width, height));
}

#[test]
fn every_robot_has_a_colour_and_common_space_is_visible() {
    let place = at(50.0, 50.0, 0.0);
    let left = MapLayer { transform_world_map: place, ..layer(info(4, 1, 0.1), &[100, 0, 100, 0]) };
    let right = MapLayer { cells: &[-1, -1, 100, 0], colour: robot_colour(1), ..left };
    let picture = render_overlay(&[left, right], &[]).unwrap();
    let [own_wall, own_free, common_wall, common_free] = [0, 1, 2, 3].map(|column| cell(&picture, column, 0));
    assert_eq!(own_wall, robot_colour(0));
    assert!(own_free[0] < 220 && own_free[2] > 235, "a light blue, not {own_free:?}");
    assert!(common_wall.iter().all(|&channel| channel < 100), "dark, not {common_wall:?}");
    assert!(common_free.iter().all(|&channel| channel > 245), "nearly white, not {common_free:?}");
}

#[test]
fn six_robots_have_different_colours() {
    let colours: std::collections::BTreeSet<_> = (0..6).map(robot_colour).collect();
    assert_eq!(colours.len(), 6);
    assert_eq!(robot_colour(6), robot_colour(0));
}

#[test]
fn a_large_map_is_reduced_and_keeps_its_thin_walls() {
    let side = 6000;
    let mut cells = vec![0; side * side];
    cells[side / 2 * side..][..side].fill(100);
    let picture = render_map(&layer(info(side as u32, side as u32, 0.05), &cells)).unwrap();
    let image = &picture.drawing.image;
    let (width, height) = image.dimensions();
    assert!(width.max(height) <= 2400, "{width} x {height}");
    let middle = (0..height).filter(|&v| image.get_pixel(width / 2, v).0.iter().all(|&c| c < 100)).count();
    assert!(middle >= 1, "the wall can be seen");
    assert_eq!(picture.scale_bar, 100.0);
}

#[test]
fn axes_are_drawn_at_the_origin_of_the_world() {
    let map = MapLayer { transform_world_map: at(-5.0, -5.0, 0.0), ..layer(info(100, 100, 0.1), &[0; 10_000]) };
    let picture = render_map(&map).unwrap();
    assert!(count(&picture, [200, 30, 30]) > 100 && count(&picture, [30, 150, 30]) > 100);
    let far = MapLayer { transform_world_map: at(1e300, 1e12, 0.0), ..map };
    assert!(render_map(&far).is_err() || count(&render_map(&far).unwrap(), [200, 30, 30]) == 0);
}

#[test]
fn topological_maps_are_drawn_at_their_pose() {
    let cells = [0; 4000];
    let map = MapLayer { transform_world_map: at(50.0, 50.0, 0.0), ..layer(info(100, 40, 0.1), &cells) };
    let node = |x: f64, kind: &str| TopologicalNode { x, y: 2.0, kind: kind.into(), probability: 1.0 };
    let points = [2.0, f64::NAN, 4.0, 8.0].map(|x| Point { x, y: 2.0, z: 0.0 }).to_vec();
    let topology = TopologicalMap {
        nodes: vec![node(2.0, "junction"), node(8.0, "door"), node(1e12, "end")],
        paths: vec![TopologicalPath { start: 0, end: 1, points, ..Default::default() }],
        ..Default::default()
    };
    let ways = ways(&topology, &at(50.0, 50.0, 0.0));
    let picture = render_overlay(&[map], &[ways]).unwrap();
    let image = pixels(&picture);
    let margin = f64::from(picture.drawing.image_at.0);
    let colour = |x: f64| {
        let [u, v] = [x, 2.0].map(|along| margin + along / picture.metres_per_pixel);
        image.get_pixel(u as u32, v as u32).0
    };
    // The edges of lines are smoothed.
    for (x, expected) in [(2.0, [200, 30, 30]), (6.0, [40, 40, 160]), (8.0, [220, 120, 0])] {
        let found: [u8; 3] = colour(x);
        assert!(found.iter().zip(expected).all(|(one, other)| one.abs_diff(other) < 10), "{x}: {found:?}");
    }
    let plain = render_overlay(&[map], &[]).unwrap();
    let differ = image.pixels().zip(pixels(&plain).pixels()).filter(|(one, other)| one != other).count();
    assert!(differ < 40_000, "values that are not finite are not drawn: {differ}");
}

#[test]
fn invalid_maps_are_errors() {
    let text = |layers: &[MapLayer<'_>]| render_overlay(layers, &[]).unwrap_err().to_string();
    let good = layer(info(1, 1, 0.1), &[0]);
    assert_eq!(text(&[]), "there is nothing to show: no cell of any map is known");
    assert_eq!(text(&[layer(info(2, 1, 0.1), &[-1, -1])]), "there is nothing to show: no cell of any map is known");
    assert_eq!(text(&[good, layer(info(2, 2, 0.1), &[0])]), "map 1 of the picture does not have width x height cells");
    assert!(text(&[layer(info(1, 1, f32::NAN), &[0])]).contains("resolution"));
    assert!(text(&[MapLayer { transform_world_map: at(f64::NAN, 0.0, 0.0), ..good }]).contains("pose"));
    assert!(text(&[layer(info(0, 0, 0.1), &[])]).contains("nothing to show"));
}

#[test]
fn maps_far_apart_give_a_picture_of_bounded_size() {
    let near = layer(info(1, 1, 0.1), &[100]);
    for distance in [1e3, 1e9, 1e200] {
        let far = MapLayer { transform_world_map: at(distance, 0.0, 1.0), ..near };
        if let Ok(picture) = render_overlay(&[near, far], &[]) {
            assert!(picture.drawing.image.width() <= 2400 && picture.drawing.image.height() <= 2400);
        }
    }
}

#[test]
fn a_picture_is_the_same_every_time_and_is_saved_in_the_format_of_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let map = MapLayer { transform_world_map: at(1.0, 2.0, 0.3), ..layer(info(3, 1, 0.1), &[0, 100, -1]) };
    let picture = render_overlay(&[map, map], &[]).unwrap();
    let path = folder.path().join("picture.PNG");
    picture.save(&path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!(bytes, render_overlay(&[map, map], &[]).unwrap().encode(&path).unwrap());
    assert_eq!(image::load_from_memory(&bytes).unwrap().to_rgb8(), pixels(&picture));
    assert!(picture.encode(Path::new("a.svg")).unwrap().starts_with(b"<svg"));
    assert!(picture.encode(Path::new("a.pdf")).unwrap().starts_with(b"%PDF"));
    let error = picture.save(Path::new("picture.jpg")).unwrap_err().to_string();
    assert!(error.contains("picture.jpg has an unsupported extension; use .png, .svg or .pdf"), "{error}");
    let error = picture.save(&folder.path().join("missing/picture.png")).unwrap_err().to_string();
    assert!(error.contains("missing/picture.png") && error.contains("folder exists"), "{error}");
}

#[test]
fn the_legend_names_every_map_in_its_colour_and_fits_into_the_picture() {
    let cells = [0; 400];
    let place = at(50.0, 50.0, 0.0);
    let names: Vec<String> = (0..12).map(|index| format!("a robot of number {index}")).collect();
    let named = |(index, name)| MapLayer {
        name,
        colour: robot_colour(index),
        transform_world_map: place,
        ..layer(info(20, 20, 0.1), &cells)
    };
    let maps: Vec<MapLayer<'_>> = names.iter().map(String::as_str).enumerate().map(named).collect();
    let picture = render_overlay(&maps, &[]).unwrap();
    for index in 0..6 {
        assert!(count(&picture, robot_colour(index)) > 50, "{index}");
    }
    let margin = 4.0;
    let inside = |place: &nalgebra::Point2<f64>| {
        place.x > margin
            && place.x < f64::from(picture.drawing.width) - margin
            && place.y < f64::from(picture.drawing.height) - margin
    };
    let paths = picture.drawing.groups.iter().filter(|group| !group.is_on_image).flat_map(|group| &group.paths);
    for path in paths {
        for step in &path.steps {
            if let crate::drawing::Step::Move(place) | crate::drawing::Step::Line(place) = step {
                assert!(inside(place), "{place} in {} x {}", picture.drawing.width, picture.drawing.height);
            }
        }
    }
}

#[test]
fn grid_lines_have_round_coordinates_and_a_limited_number() {
    let map = MapLayer { transform_world_map: at(50.3, 50.0, 0.0), ..layer(info(40, 20, 0.1), &[0; 800]) };
    let maps = [map];
    let scene = |grid| Scene { maps: &maps, grid: Some(grid), ..Scene::default() };
    let picture = Picture::of(&scene(1.0)).unwrap();
    let image = pixels(&picture);
    let shade = |x: f64| {
        let u = f64::from(picture.drawing.image_at.0) + (x - 50.3) / picture.metres_per_pixel;
        image.get_pixel(u as u32, 50).0[0]
    };
    assert!([51.0, 52.0, 53.0].iter().all(|x| shade(*x) < 250) && shade(51.5) > 254);
    for wrong in [0.0, -1.0, f64::NAN, 1e-9, f64::INFINITY] {
        assert!(Picture::of(&scene(wrong)).is_err(), "{wrong}");
    }
}

#[test]
fn marks_are_drawn_at_their_world_coordinates() {
    let map = MapLayer { transform_world_map: at(50.0, 50.0, 0.0), ..layer(info(100, 100, 0.1), &[0; 10_000]) };
    let at = nalgebra::Point2::new(55.0, 55.0);
    let mark = |shape| Mark { shape, paint: [0, 0, 255].into() };
    let shapes = [
        Shape::Ellipse { middle: at, covariance: nalgebra::Matrix2::new(1.0, 0.0, 0.0, 0.01), deviations: 2.0 },
        Shape::Arrow { from: at, to: nalgebra::Point2::new(55.0, 58.0) },
        Shape::Arrow { from: at, to: at },
        Shape::Dot { at: nalgebra::Point2::new(51.0, 51.0), width: 6.0 },
        Shape::Label { at: nalgebra::Point2::new(51.0, 58.0), words: "a tag".into() },
        Shape::Ellipse { middle: at, covariance: nalgebra::Matrix2::from_element(f64::NAN), deviations: 2.0 },
        Shape::Ellipse { middle: at, covariance: nalgebra::Matrix2::identity() * 1e300, deviations: 2.0 },
    ];
    let marks = Marks { name: "marks".into(), legend: Some([0, 0, 255]), marks: shapes.map(mark).to_vec() };
    let picture = render_overlay(&[map], &[marks]).unwrap();
    let image = pixels(&picture);
    let is_blue = |x: f64, y: f64| {
        let [u, v] = [x - 50.0, 60.0 - y].map(|metres| metres / picture.metres_per_pixel);
        let (left, top) = picture.drawing.image_at;
        let pixel = image.get_pixel(left + u as u32, top + v as u32).0;
        pixel[2] > 200 && pixel[0] < 100
    };
    assert!(is_blue(57.0, 55.0) && is_blue(53.0, 55.0), "the ends of the long axis");
    assert!(is_blue(55.0, 56.5) && is_blue(51.0, 51.0) && !is_blue(58.5, 58.5));
}

#[test]
fn the_legend_of_thousands_of_maps_names_the_first_ones_and_how_many_follow() {
    let map = MapLayer { name: "robot", ..layer(info(2, 2, 0.1), &[0, 100, -1, 0]) };
    let named = |count: usize| {
        let picture = render_overlay(&vec![map; count], &[]).unwrap();
        let legend = picture.drawing.groups.iter().find(|group| group.name == "legend").unwrap();
        // A patch and a text for each.
        legend.paths.len() / 2
    };
    // With a text that says how many follow.
    assert_eq!([500, 501, 3000].map(named), [500, 501, 501]);
}
