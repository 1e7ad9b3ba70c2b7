//! Features and hypotheses as shapes. Each list replaces all that was shown before on its topic.

use gridweave_runtime::covariance_ellipse::CovarianceEllipse;
use gridweave_runtime::ros::{
    Alignment, ColorRGBA, Header, MapDirection, Marker, MarkerArray, Point, Pose, Quaternion, Segments, TagEstimates,
    TopologicalMap, Vector3,
};
use nalgebra::Matrix2;

/// Colour of accepted hypotheses.
const ACCEPTED: [u8; 3] = [0, 158, 115];
/// Colour of refused hypotheses.
const REFUSED: [u8; 3] = [213, 94, 0];
/// Width of walls, metres.
const WALL_WIDTH: f64 = 0.08;
/// Width of paths and of the lines of hypotheses, metres.
const LINE_WIDTH: f64 = 0.05;
const TEXT_HEIGHT: f64 = 0.35;
/// Height of shapes above the map, so that it does not hide them, metres.
const HEIGHT: f64 = 0.05;
/// Length of the arrows of directions and axes, metres.
const ARROW_LENGTH: f64 = 2.0;
const DEVIATIONS: f64 = 2.0;
/// Least visible thickness, metres.
const THINNEST: f64 = 0.02;

/// Straight walls as lines, fainter the less reliable they are.
pub fn segments(found: &Segments, colour: [u8; 3]) -> MarkerArray {
    let sound =
        found.segments.iter().filter(|wall| [wall.x1, wall.y1, wall.x2, wall.y2].iter().all(|at| at.is_finite()));
    let mut lines = Lines::default();
    for wall in sound {
        let colour = rgba(colour, 0.25 + 0.75 * wall.reliability);
        lines.add([(wall.x1, wall.y1), (wall.x2, wall.y2)], colour);
    }
    array(&found.header, [lines.marker("walls", WALL_WIDTH)])
}

/// The direction of a map's walls as an arrow, and another across it, at the origin of the map frame. Nothing if there
/// is none.
pub fn direction(found: &MapDirection, colour: [u8; 3]) -> MarkerArray {
    let angles = [0.0, std::f64::consts::FRAC_PI_2].map(|turn| found.direction + turn);
    let is_sound = found.valid && found.direction.is_finite();
    let arrows =
        angles.into_iter().filter(|_| is_sound).map(|angle| arrow("direction", 0.0, 0.0, angle, rgba(colour, 0.9)));
    array(&found.header, arrows)
}

/// Tags as ellipses of two standard deviations with their names, fainter the less certain they are.
pub fn tags(found: &TagEstimates, colour: [u8; 3]) -> MarkerArray {
    let sound = found.tags.iter().filter(|tag| tag.x.is_finite() && tag.y.is_finite());
    let shapes = sound.flat_map(|tag| {
        let ([first, second], angle) = half_axes(&tag.covariance);
        let ellipse = Marker {
            ns: "ellipses".into(),
            shape: Marker::SPHERE,
            pose: pose(tag.x, tag.y, angle),
            scale: Vector3 { x: 2.0 * first, y: 2.0 * second, z: THINNEST },
            color: rgba(colour, 0.15 + 0.35 * tag.certainty),
            ..Marker::default()
        };
        let words = format!("{} {:.0} %", tag.tag_id, 100.0 * tag.certainty);
        [ellipse, text("tags", tag.x, tag.y, words, rgba(colour, 1.0))]
    });
    array(&found.header, shapes)
}

/// A topological map: paths as lines, nodes as balls, fainter the less probable they are.
pub fn ways(found: &TopologicalMap, colour: [u8; 3]) -> MarkerArray {
    let mut lines = Lines::default();
    for way in &found.paths {
        let colour = rgba(colour, 0.2 + 0.8 * way.probability);
        for pair in way.points.windows(2) {
            lines.add([(pair[0].x, pair[0].y), (pair[1].x, pair[1].y)], colour);
        }
    }
    let sound = || found.nodes.iter().filter(|node| node.x.is_finite() && node.y.is_finite());
    let places = Marker {
        ns: "places".into(),
        shape: Marker::SPHERE_LIST,
        scale: Vector3 { x: 4.0 * LINE_WIDTH, y: 4.0 * LINE_WIDTH, z: 4.0 * LINE_WIDTH },
        color: rgba(colour, 1.0),
        points: sound().map(|node| point(node.x, node.y)).collect(),
        colors: sound().map(|node| rgba(colour, 0.2 + 0.8 * node.probability)).collect(),
        ..Marker::default()
    };
    array(&found.header, [lines.marker("ways", LINE_WIDTH), places])
}

/// Relative poses of hypotheses: the x axis of map b's frame in map a's, a line from one origin to the other, and the
/// score; bluish green where it is accepted, vermilion where it is refused.
pub fn hypotheses<'a>(found: impl Iterator<Item = &'a Alignment> + Clone) -> MarkerArray {
    let stamps = found.clone().filter(|one| is_shown(one)).map(|one| one.header.stamp);
    let header = Header { stamp: stamps.max().unwrap_or_default(), ..Header::default() };
    array(&header, hypothesis_shapes(found))
}

/// Whether a hypothesis has a relative pose to show.
fn is_shown(hypothesis: &Alignment) -> bool {
    let Alignment { has_transform, x, y, yaw, .. } = *hypothesis;
    has_transform && [x, y, yaw].iter().all(|value| value.is_finite())
}

/// The shapes of hypotheses, without numbers.
pub(super) fn hypothesis_shapes<'a>(found: impl Iterator<Item = &'a Alignment>) -> Vec<Marker> {
    let mut shapes = Vec::new();
    for alignment in found.filter(|one| is_shown(one)) {
        let Alignment { x, y, yaw, .. } = *alignment;
        let sort = if alignment.accepted { "accepted" } else { "refused" };
        let colour = rgba(if alignment.accepted { ACCEPTED } else { REFUSED }, 0.9);
        let mut line = Lines::default();
        line.add([(0.0, 0.0), (x, y)], colour);
        let Alignment { a, b, rank, score, .. } = alignment;
        let words = format!("{b} on {a}, no. {}: {score:.3}", rank + 1);
        for marker in [arrow(sort, x, y, yaw, colour), line.marker(sort, LINE_WIDTH), text(sort, x, y, words, colour)] {
            shapes.push(Marker { header: alignment.header.clone(), ..marker });
        }
    }
    shapes
}

/// Numbers the shapes, after one that deletes all earlier ones; those without a frame get that of the header.
fn array(header: &Header, shapes: impl IntoIterator<Item = Marker>) -> MarkerArray {
    let numbered = (0..).zip(shapes).map(|(id, marker)| {
        let own = if marker.header.frame_id.is_empty() { header.clone() } else { marker.header.clone() };
        // Transforms may arrive later, so shapes are to follow the latest ones.
        Marker { id, header: own, frame_locked: true, ..marker }
    });
    let shapes: Vec<Marker> = numbered.collect();
    // Some viewers require a frame even of this one.
    let header = shapes.first().map_or(header, |shape| &shape.header).clone();
    let clear = Marker { action: Marker::DELETE_ALL, header, ..Marker::default() };
    MarkerArray { markers: std::iter::once(clear).chain(shapes).collect() }
}

/// Lines, each with its colour.
#[derive(Default)]
struct Lines {
    points: Vec<Point>,
    colours: Vec<ColorRGBA>,
}

impl Lines {
    fn add(&mut self, ends: [(f64, f64); 2], colour: ColorRGBA) {
        if ends.iter().all(|(x, y)| x.is_finite() && y.is_finite()) {
            self.points.extend(ends.map(|(x, y)| point(x, y)));
            self.colours.extend([colour; 2]);
        }
    }

    fn marker(self, sort: &str, width: f64) -> Marker {
        Marker {
            ns: sort.to_owned(),
            shape: Marker::LINE_LIST,
            scale: Vector3 { x: width, ..Vector3::default() },
            color: self.colours.first().copied().unwrap_or_default(),
            points: self.points,
            colors: self.colours,
            ..Marker::default()
        }
    }
}

/// A colour with an `opacity` from 0 to 1.
fn rgba([r, g, b]: [u8; 3], opacity: f64) -> ColorRGBA {
    let part = |value: u8| f32::from(value) / 255.0;
    let opacity = if opacity.is_finite() { opacity.clamp(0.0, 1.0) } else { 1.0 };
    ColorRGBA { r: part(r), g: part(g), b: part(b), a: opacity as f32 }
}

fn point(x: f64, y: f64) -> Point {
    Point { x, y, z: HEIGHT }
}

fn pose(x: f64, y: f64, yaw: f64) -> Pose {
    Pose { position: point(x, y), orientation: Quaternion::from_yaw(yaw) }
}

fn arrow(sort: &str, x: f64, y: f64, yaw: f64, color: ColorRGBA) -> Marker {
    let scale = Vector3 { x: ARROW_LENGTH, y: 2.0 * LINE_WIDTH, z: 2.0 * LINE_WIDTH };
    Marker { ns: sort.to_owned(), shape: Marker::ARROW, pose: pose(x, y, yaw), scale, color, ..Marker::default() }
}

fn text(sort: &str, x: f64, y: f64, words: String, color: ColorRGBA) -> Marker {
    let mut at = pose(x, y, 0.0);
    at.position.z += TEXT_HEIGHT;
    let scale = Vector3 { z: TEXT_HEIGHT, ..Vector3::default() };
    Marker { ns: sort.to_owned(), shape: Marker::TEXT, pose: at, scale, color, text: words, ..Marker::default() }
}

/// Half axes of two standard deviations, and the direction of the first.
fn half_axes(covariance: &[f64; 4]) -> ([f64; 2], f64) {
    match CovarianceEllipse::new(&Matrix2::from_row_slice(covariance), DEVIATIONS) {
        Some(ellipse) => (ellipse.half_axes.map(|half| half.max(THINNEST)), ellipse.direction),
        None => ([THINNEST; 2], 0.0),
    }
}
