//! `gridweave render`: draws the maps of logs, or map files.

mod overlays;

use crate::job::{Inputs, NamingOptions, check_is_no_input};
use crate::merge_log::{MergeState, Opened, PlacedRobot, Placing, map_files};
use crate::status::{BadUse, Status};
use crate::terminal::{eprint_line, print_line};
use anyhow::Result;
use clap::{Args, ValueEnum};
use gridweave_logs::map_file::GridMap;
use gridweave_logs::picture::{Cells, MapLayer, Marks, Picture, PictureError, Scene, check_format, robot_colour};
use gridweave_runtime::pipeline::{list_in_words, suggest};
use nalgebra::Isometry2;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// The most robots of which an error tells the size of the cells.
const MOST_SIZES: usize = 5;

/// Arguments of `gridweave render`.
#[derive(Debug, Args)]
pub(crate) struct RenderArgs {
    /// Logs, each as LOG or ROBOT=LOG, or map files (map_server YAML). The maps of a log that a merge has written are
    /// drawn aligned, other maps beside each other.
    #[arg(required = true, value_name = "INPUT")]
    inputs: Vec<PathBuf>,
    /// The output; its ending decides the format: .png, .svg or .pdf.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Draw the merged map in grey, instead of the robots' maps in different colours.
    #[arg(long, conflicts_with_all = ["robot", "apart"])]
    merged: bool,
    /// Draw the maps of these robots only.
    #[arg(long, value_name = "ROBOT", value_delimiter = ',')]
    robot: Vec<String>,
    /// Draw the maps beside each other, not aligned.
    #[arg(long)]
    apart: bool,
    /// What to draw over the maps.
    #[arg(long, value_name = "WHAT", value_delimiter = ',')]
    show: Vec<Overlay>,
    /// Draw a line every so many metres.
    #[arg(long, value_name = "METRES")]
    grid: Option<f64>,
    /// Draw the state so many seconds after the first message, instead of that at the end.
    #[arg(long, value_name = "SECONDS")]
    at: Option<f64>,
    #[command(flatten)]
    names: NamingOptions,
}

/// What can be drawn over maps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
enum Overlay {
    /// Names, at the origins of the robots' map frames.
    Names,
    /// Where the maps contradict each other.
    Conflicts,
    /// The straight walls that were found; less reliable ones are paler.
    Segments,
    /// The direction of each map's walls.
    Directions,
    /// Tags, with ellipses of two standard deviations; less certain ones are paler.
    Tags,
    /// Where the robots drove.
    Trajectories,
    /// The deformations of the maps, as enlarged arrows.
    #[value(name = "bends")]
    Deformations,
    /// Topological maps: places and the paths between them.
    Ways,
    /// All of these.
    All,
}

/// Draws a picture.
pub(crate) fn render(args: &RenderArgs) -> Result<Status> {
    check_format(&args.output).map_err(|error| BadUse(error.to_string()))?;
    check_is_no_input(&args.inputs, &args.output)?;
    if args.at.is_some_and(|at| at.is_nan() || at < 0.0) {
        return Err(BadUse("--at must be 0 s or more".to_owned()).into());
    }
    let state = read(args)?;
    check_robots(&args.robot, &state)?;
    let placing = Placing::of(&state, &args.robot.iter().map(String::as_str).collect(), args.apart);
    let picture = draw(args, &state, &placing).map_err(|error| explain(error, args.merged, &state))?;
    picture.save(&args.output)?;
    print_line(format_args!("wrote {}: {}", args.output.display(), contents(&placing, args.merged)))?;
    Ok(Status::Done)
}

fn read(args: &RenderArgs) -> Result<MergeState> {
    if Inputs::of_maps_or_logs(&args.inputs, "render")? == Inputs::MapFiles {
        return map_files(&args.inputs);
    }
    let mut opened = Opened::new(&args.inputs, &args.names)?;
    opened.read_until(args.at, |_, _| {});
    opened.problems.iter().for_each(|problem| eprint_line(format_args!("warning: {problem}")));
    Ok(opened.state)
}

fn check_robots(wanted: &[String], state: &MergeState) -> Result<()> {
    let known: Vec<&str> = state.robots_with_maps().map(|(robot, _)| robot).collect();
    match wanted.iter().find(|robot| !known.contains(&robot.as_str())) {
        Some(robot) => {
            let nearest = suggest(robot, &known, "the robots").unwrap_or_default();
            Err(BadUse(format!("there is no map of a robot `{robot}`: {nearest}")).into())
        }
        None => Ok(()),
    }
}

fn draw(args: &RenderArgs, state: &MergeState, placing: &Placing) -> Result<Picture, PictureError> {
    let shown: BTreeSet<Overlay> = match args.show.contains(&Overlay::All) {
        true => Overlay::value_variants().iter().copied().collect(),
        false => args.show.iter().copied().collect(),
    };
    let marks: Vec<Marks> = shown.iter().flat_map(|overlay| overlays::marks(*overlay, state, placing)).collect();
    let merged = state.merged().map(|map| GridMap::from_message(&map));
    let conflicts = state.conflicts().filter(|_| shown.contains(&Overlay::Conflicts) && !args.apart);
    let conflicts = conflicts.map(|map| overlays::conflicts(&map));

    let robots = placing.robots.iter().filter_map(|robot| Some((robot, robot.map.as_ref()?)));
    let mut maps: Vec<MapLayer<'_>> =
        robots.map(|(robot, map)| layer(&robot.name, robot_colour(robot.index), map)).collect();
    let is_grey = args.merged || maps.is_empty();
    if is_grey {
        maps = merged.iter().map(|map| layer("", robot_colour(0), map)).collect();
    } else {
        maps.extend(conflicts.iter().map(|map| layer("contradictions", overlays::CONFLICT, map)));
    }
    let cells = if is_grey { Cells::Grey } else { Cells::Coloured };
    Picture::of(&Scene { maps: &maps, cells, marks: &marks, grid: args.grid })
}

fn layer<'a>(name: &'a str, colour: [u8; 3], map: &'a GridMap) -> MapLayer<'a> {
    MapLayer { name, colour, info: map.info, cells: &map.cells, transform_world_map: Isometry2::identity() }
}

/// Explains what is missing where nothing can be drawn.
fn explain(error: PictureError, is_merged_map: bool, state: &MergeState) -> anyhow::Error {
    match error {
        PictureError::Empty if state.robots_with_maps().next().is_none() && state.merged().is_none() => {
            anyhow::anyhow!(
                "there is no map to draw: a nav_msgs/msg/OccupancyGrid is needed on /map or on /ROBOT/map; `gridweave info LOG` \
             lists the topics, and --rename renames one"
            )
        }
        PictureError::Empty if !is_merged_map => {
            let sizes = state.robots_with_maps().take(MOST_SIZES);
            let sizes = sizes.map(|(robot, map)| format!("{} m in that of {robot}", map.info.resolution));
            anyhow::anyhow!(
                "nothing of the maps can be drawn: all cells are unknown, are too large to be those of a building ({}), or have no \
                 place; check the `resolution` and the `origin` of each",
                sizes.collect::<Vec<_>>().join(", ")
            )
        }
        PictureError::Empty if state.merged().is_none() => {
            anyhow::anyhow!(
                "there is no merged map to draw, or all its cells are unknown: omit --merged to draw the robots' maps"
            )
        }
        PictureError::Grid { .. } => BadUse(format!("--grid: {error}")).into(),
        error => error.into(),
    }
}

/// Describes what was drawn.
fn contents(placing: &Placing, is_merged_map: bool) -> String {
    if is_merged_map || placing.robots.is_empty() {
        return "the merged map".to_owned();
    }
    let (merged, others): (Vec<_>, Vec<_>) = placing.robots.iter().partition(|robot| robot.is_merged);
    let names = |robots: &[&PlacedRobot]| list_in_words(robots.iter().map(|robot| &robot.name));
    match (merged.is_empty(), others.is_empty()) {
        (true, _) => format!("{} beside each other", names(&others)),
        (_, true) => format!("{} aligned", names(&merged)),
        _ => format!("{} aligned, and {} beside them", names(&merged), names(&others)),
    }
}
