//! The edges of the Voronoi diagrams of two maps, and those that determine the translation.

use crate::log::last_maps;
use crate::results::Results;
use anyhow::{Context, Result, bail};
use clap::Args;
use gridweave::table::Table;
use gridweave_logs::drawing::{Colour, Drawing, Group, Paint, Path};
use gridweave_logs::map_file::GridMap;
use gridweave_published::edge_matcher::{Edge, EdgeMatcherParameters, Election, edges, match_edges, votes};
use gridweave_published::pgvd_extractor::{PgvdExtractorParameters, topological_map};
use gridweave_published::radon_aligner::{NamedMap, PreparedMap, RadonAlignerParameters, align};
use gridweave_stages::shared::geometry::{Grid, GridGeometry, Point2, Pose2};
use image::{Rgb, RgbImage};
use std::path::PathBuf;

/// Angles of a quarter turn: a quarter of a degree apart.
const STEPS: usize = 360;
/// Pixels a metre.
const SCALE: f64 = 20.0;
/// Metres round the maps.
const MARGIN: f64 = 1.0;
/// Those of Okabe and Ito: the first map, the second, and a line between edges that belong together.
const FIRST: Colour = [0, 114, 178];
const SECOND: Colour = [213, 94, 0];
const BETWEEN: Colour = [0, 158, 115];
const WALL: Rgb<u8> = Rgb([150, 150, 150]);

#[derive(Debug, Args)]
pub(super) struct EdgesArgs {
    /// A log with maps of two robots or more.
    #[arg(long, value_name = "FILE")]
    log: PathBuf,
}

pub(super) fn run(args: &EdgesArgs, results: &mut Results) -> Result<()> {
    let maps: Vec<(String, GridMap)> = last_maps(&args.log)?.into_iter().collect();
    let [(first, map_a), (second, map_b), ..] = &maps[..] else {
        bail!("{} holds no maps of two robots; another log may", args.log.display());
    };
    let grid = |map| grid_of(map).with_context(|| format!("a map of {} cannot be used", args.log.display()));
    let (grid_a, grid_b) = (grid(map_a)?, grid(map_b)?);
    let [prepared_a, prepared_b] = [&grid_a, &grid_b].map(|grid| PreparedMap::new(grid, STEPS));
    let a = NamedMap { robot: first, grid: grid_a, prepared: &prepared_a };
    let b = NamedMap { robot: second, grid: grid_b, prepared: &prepared_b };
    let by_directions = align(&a, &b, &RadonAlignerParameters::default()).context("cannot estimate the rotation")?;
    let rotation = by_directions.transform_a_b.rotation;
    let parameters = EdgeMatcherParameters::default();
    let [edges_a, edges_b] = [&grid_a, &grid_b]
        .map(|grid| edges(&topological_map(grid, &PgvdExtractorParameters::default()), parameters.min_length));
    let votes = votes(&edges_a, &edges_b, &rotation, &parameters);
    let election = Election::of(&votes, parameters.vote_radius).context("no edges are alike")?;
    let transform_a_b = Pose2::from_parts(election.translation.into(), rotation);
    let pairs: Vec<[usize; 2]> = election.votes.iter().map(|vote| votes[*vote].edges).collect();
    let picture = draw(&grid_a, [&edges_a, &edges_b], &pairs, &transform_a_b);
    results.file("edges_matched.png", &picture.png().context("cannot draw the edges")?)?;

    let outcome = match match_edges(&edges_a, &edges_b, &rotation, by_directions.covariance.m33, &parameters) {
        Ok(found) => found.reason(),
        Err(refusal) => refusal.to_string(),
    };
    let mut table = Table::new(["edges of the first", "of the second", "votes", "for the place", "outcome"]);
    let counts = [edges_a.len(), edges_b.len(), votes.len(), pairs.len()].map(|count| count.to_string());
    table.row(counts.into_iter().chain([outcome]));
    results.table("edges", &format!("Edges of {first} and {second}"), &table)
}

fn grid_of(map: &GridMap) -> Result<Grid<'_>> {
    Ok(Grid::new(GridGeometry::from(&map.info), &map.cells)?)
}

/// The walls of map a in grey, its edges and those of map b where they lie on it: paler those that are for no place or
/// for another.
fn draw(grid_a: &Grid<'_>, edges: [&[Edge]; 2], pairs: &[[usize; 2]], transform_a_b: &Pose2) -> Drawing {
    let lines: [Vec<Vec<Point2>>; 2] = [0, 1].map(|map| {
        let place = |point: Point2| if map == 0 { point } else { transform_a_b * point };
        edges[map].iter().map(|edge| edge.shape.iter().map(|offset| place(edge.middle + offset)).collect()).collect()
    });
    let walls: Vec<Point2> = grid_a.occupied().map(|cell| grid_a.geometry.centre(cell)).collect();
    let all = || walls.iter().chain(lines.iter().flatten().flatten());
    let (low, high) = all().fold(
        (Point2::new(f64::INFINITY, f64::INFINITY), Point2::new(f64::NEG_INFINITY, f64::NEG_INFINITY)),
        |(low, high), point| (low.inf(point), high.sup(point)),
    );
    // The y axis points up.
    let pixel = |point: &Point2| Point2::new((point.x - low.x + MARGIN) * SCALE, (high.y - point.y + MARGIN) * SCALE);
    let side = |metres: f64| ((metres + 2.0 * MARGIN) * SCALE).ceil().max(1.0) as u32;
    let (width, height) = (side(high.x - low.x), side(high.y - low.y));
    let mut image = RgbImage::from_pixel(width, height, Rgb([255; 3]));
    for place in walls.iter().map(pixel) {
        if let Some(shown) = image.get_pixel_mut_checked(place.x as u32, place.y as u32) {
            *shown = WALL;
        }
    }
    let is_paired = |map: usize, edge: usize| pairs.iter().any(|pair| pair[map] == edge);
    let mut paths: Vec<Path> = Vec::new();
    for paired in [false, true] {
        for (map, colour) in [FIRST, SECOND].into_iter().enumerate() {
            let chosen = lines[map].iter().enumerate().filter(|(edge, _)| is_paired(map, *edge) == paired);
            let (opacity, thick) = if paired { (1.0, 3.0) } else { (0.35, 1.5) };
            let stroke = Paint { colour, opacity };
            paths.extend(chosen.map(|(_, line)| Path::lines(line.iter().map(pixel)).stroked(stroke, thick)));
        }
    }
    for [one, other] in pairs {
        let middles = [edges[0][*one].middle, transform_a_b * edges[1][*other].middle].map(|middle| pixel(&middle));
        paths.extend(middles.map(|middle| Path::circle(middle, 4.0).filled(BETWEEN)));
        paths.push(Path::lines(middles).stroked(BETWEEN, 2.0));
    }
    let groups = vec![Group { name: "edges".into(), is_on_image: false, paths }];
    Drawing { width, height, image, image_at: (0, 0), groups }
}
