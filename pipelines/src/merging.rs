//! Merging maps and running pipelines from a program, as `gridweave merge` and `gridweave run` do it from the command
//! line.
//!
//! ```no_run
//! use gridweave::merging::{MergeRequest, merge_files};
//!
//! # fn main() -> anyhow::Result<()> {
//! let merged = merge_files(&["a.yaml".into(), "b.yaml".into()], &MergeRequest::default(), &())?;
//! for (robot, frame) in merged.summary.merge.iter().flat_map(|merge| &merge.frames) {
//!     println!("{robot} at {:.2} m, {:.2} m, turned by {:.1} degrees", frame.x, frame.y, frame.yaw.to_degrees());
//! }
//! # Ok(())
//! # }
//! ```

use crate::commands::merge::MergeArgs;
use crate::job::{Inputs, Job, NamingOptions, Output, ReadingOptions, RunOptions, Watcher};
use crate::shipped;
use crate::status::BadUse;
use crate::summary::RunSummary;
use anyhow::Result;
use gridweave_logs::map_file::GridMap;
use gridweave_logs::source::map_file::kind_of_maps;
use gridweave_runtime::engine::{EngineKind, Observer};
use gridweave_runtime::message::Message;
use gridweave_runtime::pipeline::{Mode, Pipeline};
use gridweave_runtime::ros::OccupancyGrid;
use gridweave_runtime::stage::{Context, Output as StageOutput, Received, StageError, StageKind};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// The topic of the merged map.
const MERGED: &str = "/map";

/// The settings of a merge or of another pipeline: the options of `gridweave merge`, in the same format.
#[derive(Clone, Debug, Default)]
pub struct MergeRequest {
    /// The robot whose map frame is that of the merged map; by default the first by name when the first two are merged.
    pub reference: Option<String>,
    /// Known poses of map frames, as `ROBOT=X,Y,YAW[,STDDEV[,YAW_STDDEV]]`.
    pub initial: Vec<String>,
    /// Hypotheses to accept, as `ROBOT=N`.
    pub accept: Vec<String>,
    /// Other names of topics of logs, as `OLD=NEW`; `{robot}` matches one part of both.
    pub rename: Vec<String>,
    /// Poses of lidars on their robots, as `ROBOT=X,Y,YAW[,ROLL]`.
    pub lidar: Vec<String>,
    /// Whether the thresholds of map files are applied literally, even where these leave no walls.
    pub literal_thresholds: bool,
    /// Parameters of stages, as `STAGE.PARAMETER=VALUE`.
    pub set: Vec<String>,
    /// The seed of all random numbers.
    pub seed: Option<u64>,
    /// The engine that runs the stages; the result is the same.
    pub engine: Option<EngineKind>,
    /// The log to write; none if `None`.
    pub output: Option<PathBuf>,
}

/// The result of a merge.
#[derive(Debug)]
pub struct Merged {
    /// The frames, the robots that could not be merged with the reason, and the evidence.
    pub summary: RunSummary,
    /// The merged map in the frame of the reference; none if no stage sends one, or all cells of the maps are unknown.
    pub map: Option<GridMap>,
}

/// Merges the maps in files: logs, or map files of nav2's map server, each the map of the robot that is called as the
/// file.
///
/// # Errors
/// A file cannot be read, has no map, or the request is wrong; or the observer stops the run.
pub fn merge_files(files: &[PathBuf], request: &MergeRequest, observer: &dyn Observer) -> Result<Merged> {
    if files.is_empty() {
        return Err(BadUse("there is nothing to merge: give logs or map files".to_owned()).into());
    }
    let args = MergeArgs { inputs: files.to_vec(), output: PathBuf::new(), options: request.options() };
    let pipeline = Path::new(args.pipeline()?);
    request.run(pipeline, (files, Inputs::of(files)?), request.log_or(Output::MapOnly), Vec::new(), observer)
}

/// Runs a pipeline file, or the shipped pipeline of that name, on files, with the stage kinds of Gridweave and the
/// given ones.
///
/// # Errors
/// The pipeline or the request is wrong, the pipeline has no stage of a given kind, or a stage fails; or the observer
/// stops the run.
pub fn run_pipeline(
    pipeline: &Path,
    files: &[PathBuf],
    request: &MergeRequest,
    kinds: Vec<StageKind>,
    observer: &dyn Observer,
) -> Result<Merged> {
    request.run(pipeline, (files, Inputs::of_run(files)?), request.log_or(Output::OfPipeline), kinds, observer)
}

/// Merges maps that are in memory, each with the name of its robot.
///
/// # Errors
/// Two maps have the same name, a name is no part of a topic, there is no map, or the request is wrong; or the observer
/// stops the run.
pub fn merge_maps(
    maps: Vec<(String, Arc<GridMap>)>,
    request: &MergeRequest,
    observer: &dyn Observer,
) -> Result<Merged> {
    if let Some((name, _)) = maps.iter().find(|(name, _)| name.is_empty() || name.contains(['/', '{', '}'])) {
        return Err(BadUse(format!("`{name}` is no name of a robot: its topics are /ROBOT/map and others")).into());
    }
    let mut names = BTreeSet::new();
    if let Some((twice, _)) = maps.iter().find(|(name, _)| !names.insert(name)) {
        return Err(BadUse(format!("two maps are of `{twice}`: give each robot a name of its own")).into());
    }
    if maps.is_empty() {
        return Err(BadUse("there is nothing to merge: give at least one map".to_owned()).into());
    }
    // As of map files, so that one initial pose says how its robot lies to that one.
    let first = names.first().filter(|_| !request.initial.is_empty()).map(|first| (*first).clone());
    let request = MergeRequest { reference: request.reference.clone().or(first), ..request.clone() };
    let pipeline = Path::new("map_file_merge");
    let none = (&[][..], Inputs::MapFiles);
    request.run(pipeline, none, request.log_or(Output::MapOnly), vec![kind_of_maps(maps)], observer)
}

impl MergeRequest {
    fn options(&self) -> RunOptions {
        RunOptions {
            reference: self.reference.clone(),
            initial: self.initial.clone(),
            accept: self.accept.clone(),
            lidar: self.lidar.clone(),
            literal_thresholds: self.literal_thresholds,
            set: self.set.clone(),
            seed: self.seed,
            engine: self.engine,
            reading: ReadingOptions {
                names: NamingOptions { rename: self.rename.clone(), ..NamingOptions::default() },
                ..ReadingOptions::default()
            },
            ..RunOptions::default()
        }
    }

    /// The log to write, or the given output.
    fn log_or<'a>(&'a self, other: Output<'a>) -> Output<'a> {
        self.output.as_deref().map_or(other, Output::Log)
    }

    fn run(
        &self,
        pipeline: &Path,
        (inputs, kind): (&[PathBuf], Inputs),
        output: Output<'_>,
        kinds: Vec<StageKind>,
        observer: &dyn Observer,
    ) -> Result<Merged> {
        let merged = Arc::new(Mutex::new(None));
        let map_sink = merged_map_kind(&merged);
        let given: Vec<&str> = kinds.iter().map(|kind| kind.name).collect();
        let job = Job { pipeline, inputs, kind, output, options: &self.options(), registry: &shipped::registry(kinds) };
        let attach = |pipeline: &mut Pipeline| {
            let is_unused = |name: &&&str| !pipeline.stages.iter().any(|stage| stage.kind.name == **name);
            if let Some(unused) = given.iter().find(is_unused) {
                let text = format!("the pipeline `{}` has no stage of the kind `{unused}`", pipeline.name);
                return Err(BadUse(text).into());
            }
            if pipeline.mode == Mode::Live {
                // Its stages are processes, which cannot share what the program has.
                let name = pipeline.name.as_str();
                let text = format!("`{name}` is a live pipeline: start it by the command, `gridweave run {name}`");
                return Err(BadUse(text).into());
            }
            // A pipeline without maps has no merged map either.
            pipeline.attach(&map_sink, toml::Table::new(), "results", |_, _, output| output.topic == Some(MERGED));
            Ok(())
        };
        let summary = job.run_with(attach, Watcher::Observer(observer))?;
        let map = merged.lock().unwrap_or_else(PoisonError::into_inner).take();
        Ok(Merged { summary, map })
    }
}

/// A stage that keeps the last merged map.
fn merged_map_kind(kept: &Arc<Mutex<Option<GridMap>>>) -> StageKind {
    struct Keeper {
        last: Option<Message>,
        kept: Arc<Mutex<Option<GridMap>>>,
    }

    let kept = Arc::clone(kept);
    StageKind::stage("merged_map", "Keeps the last merged map for the program", move |(), _: &Context| {
        Ok(Keeper { last: None, kept: Arc::clone(&kept) })
    })
    .inputs("map", "the merged map", |keeper: &mut Keeper, map: Received<'_, OccupancyGrid<'_>>, _| {
        keeper.last = Some(map.message().clone());
        Ok(())
    })
    .finish(|keeper: &mut Keeper, _: &StageOutput<()>| {
        let Some(message) = &keeper.last else { return Ok(()) };
        let grid = message.decode().map_err(|error| StageError::new("read the merged map", error))?;
        *keeper.kept.lock().unwrap_or_else(PoisonError::into_inner) = Some(GridMap::from_message(&grid));
        Ok(())
    })
    .build()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gridweave_runtime::ros::MapMetaData;

    /// A room of 8 m by 6 m with a table, drawn from a corner, and the same shifted by 12 and 7 cells.
    fn room(shift: (usize, usize)) -> GridMap {
        let (width, height) = (220, 180);
        let mut cells = vec![-1; width * height];
        let wall = |x: usize, y: usize| {
            x == 0
                || y == 0
                || x == 159
                || y == 119
                || (60..75).contains(&x) && (30..50).contains(&y)
                || y == 80 && x > 90
        };
        for y in 0..120 {
            for x in 0..160 {
                cells[(y + shift.1) * width + x + shift.0] = if wall(x, y) { 100 } else { 0 };
            }
        }
        let info = MapMetaData { resolution: 0.05, width: width as u32, height: height as u32, ..Default::default() };
        GridMap { info, cells }
    }

    #[test]
    fn maps_in_memory_are_merged_as_files_are() {
        let maps = [("a", (0, 0)), ("b", (12, 7))].map(|(name, shift)| (name.to_owned(), Arc::new(room(shift))));
        let merged = merge_maps(maps.to_vec(), &MergeRequest::default(), &()).unwrap();
        let summary = merged.summary.merge.unwrap();
        let frame = summary.frames["b"];
        assert!((frame.x + 0.6).abs() < 0.03 && (frame.y + 0.35).abs() < 0.03 && frame.yaw.abs() < 0.01, "{frame:?}");
        let map = merged.map.unwrap();
        let walls = |cells: &[i8]| cells.iter().filter(|cell| **cell > 50).count();
        assert_eq!(walls(&map.cells), walls(&maps[0].1.cells), "the walls lie on each other");

        let folder = tempfile::tempdir().unwrap();
        let files = maps.map(|(name, map)| {
            let file = folder.path().join(name + ".yaml");
            gridweave_logs::map_file::save(&file, &map).unwrap();
            file
        });
        let of_files = merge_files(&files, &MergeRequest::default(), &()).unwrap();
        assert_eq!((of_files.summary.merge.unwrap(), of_files.map.unwrap()), (summary, map));
    }

    #[test]
    fn one_initial_pose_is_in_the_frame_of_the_first_map() {
        let maps = [("a", (0, 0)), ("b", (12, 7))].map(|(name, shift)| (name.to_owned(), Arc::new(room(shift))));
        let request = MergeRequest { initial: vec!["b=-0.6,-0.35,0".to_owned()], ..MergeRequest::default() };
        let summary = merge_maps(maps.to_vec(), &request, &()).unwrap().summary.merge.unwrap();
        assert_eq!((summary.reference.as_deref(), summary.frames.len()), (Some("a"), 2));
    }

    #[test]
    fn a_stage_that_the_pipeline_does_not_have_is_bad_use() {
        let kind = StageKind::stage("thin", "Thins lines", |(), _: &Context| Ok(()));
        let kind = kind.finish(|(): &mut (), _: &StageOutput<()>| Ok(())).build();
        let pipeline = Path::new("map_file_merge");
        let error = run_pipeline(pipeline, &["a.yaml".into()], &MergeRequest::default(), vec![kind], &()).unwrap_err();
        assert!(crate::is_bad_use(&error), "{error:#}");
        assert_eq!(error.to_string(), "the pipeline `map_file_merge` has no stage of the kind `thin`");
    }

    #[test]
    fn what_cannot_be_merged_is_bad_use() {
        let map = Arc::new(room((0, 0)));
        let twice = vec![("a".to_owned(), Arc::clone(&map)), ("a".to_owned(), Arc::clone(&map))];
        let named = |name: &str| vec![("a".to_owned(), Arc::clone(&map)), (name.to_owned(), Arc::clone(&map))];
        for maps in [Vec::new(), twice, named(""), named("b/c"), named("{robot}")] {
            assert!(crate::is_bad_use(&merge_maps(maps, &MergeRequest::default(), &()).unwrap_err()));
        }
        assert!(crate::is_bad_use(&merge_files(&[], &MergeRequest::default(), &()).unwrap_err()));
        let wrong = MergeRequest { set: vec!["icp.nonsense=1".to_owned()], ..Default::default() };
        let error = merge_maps(vec![("a".to_owned(), map)], &wrong, &()).unwrap_err();
        assert!(crate::is_bad_use(&error) && error.to_string().contains("nonsense"), "{error}");
    }
}
