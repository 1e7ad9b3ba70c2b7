//! One alignment of two maps, as a pipeline's stages do it, and how long it takes.

use crate::log::read_decoded;
use crate::processor_time::ProcessorTime;
use crate::statistics::median;
use anyhow::{Context, Result};
use gridweave::shipped;
use gridweave_runtime::pipeline::{Overrides, Pipeline};
use gridweave_runtime::ros::{CommonTag, CommonTags};
use gridweave_runtime::stage::Registry;
use gridweave_stages::registration::comparison::{MapView, compare};
use gridweave_stages::registration::icp::{self, IcpParameters, refine};
use gridweave_stages::registration::judgement::JudgementParameters;
use gridweave_stages::shared::geometry::{Grid, Pose2};
use gridweave_stages::shared::walls::WallMap;
use gridweave_stages::tags::line_extractor::{LineExtractorParameters, extract_segments};
use gridweave_stages::tags::quadrant_classifier::{QuadrantClassifierParameters, first_guess, map_direction};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Duration;

/// The two maps of a pair.
pub(super) struct PairMaps<'a> {
    /// The map that stays.
    pub(super) a: Grid<'a>,
    /// The map that is moved.
    pub(super) b: Grid<'a>,
}

/// Aligns two maps as a pipeline does: the same functions, the same parameters, the same seeds.
pub(super) struct Aligner {
    /// Parameters and seed of the line extractor, if the pipeline has one.
    lines: Option<(LineExtractorParameters, u64)>,
    classifier: QuadrantClassifierParameters,
    /// Those of the ICP refiner, if the pipeline has one.
    icp: Option<IcpParameters>,
    /// Those of the merge verifier, if the pipeline has one.
    verifier: Option<JudgementParameters>,
}

/// The alignment of two maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OneAlignment {
    /// Where it places map b in map a.
    pub(super) transform_a_b: Pose2,
    /// How long it takes.
    pub(super) time: AlignmentTime,
}

/// How long the parts of one alignment take, milliseconds of processor time; medians of several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct AlignmentTime {
    /// The walls of both maps.
    pub(super) lines: f64,
    /// The maps' directions, the quarter turn and the translation.
    pub(super) classifier: f64,
    /// ICP and the comparison of the maps where it ends.
    pub(super) icp: f64,
    /// All of it.
    pub(super) total: f64,
}

/// An alignment and its parts' times.
struct Timed {
    transform_a_b: Pose2,
    parts: [Duration; 3],
}

impl Aligner {
    /// What aligns two maps in a shipped pipeline.
    pub(super) fn new(pipeline: &str, registry: &Registry) -> Result<Self> {
        let pipeline = shipped::load(Path::new(pipeline), &Overrides::default(), registry)?;
        let classifier = parameters(&pipeline, "quadrant_classifier")?;
        let (classifier, _) =
            classifier.with_context(|| format!("the pipeline {} has no quadrant_classifier", pipeline.name))?;
        Ok(Self {
            lines: parameters(&pipeline, "line_extractor")?,
            classifier,
            icp: parameters(&pipeline, "icp_refiner")?.map(|(parameters, _)| parameters),
            verifier: parameters(&pipeline, "merge_verifier")?.map(|(parameters, _)| parameters),
        })
    }

    /// Aligns two maps by their common tags, several times; none if the tags give no alignment.
    pub(super) fn measure(&self, maps: &PairMaps<'_>, tags: &[CommonTag], repetitions: usize) -> Option<OneAlignment> {
        let runs: Vec<Timed> = (0..repetitions).map(|_| self.align(maps, tags)).collect::<Option<_>>()?;
        let transform_a_b = runs.first()?.transform_a_b;
        let milliseconds = |part: fn(&Timed) -> Duration| {
            median(&runs.iter().map(|run| part(run).as_secs_f64() * 1e3).collect::<Vec<_>>())
        };
        let time = AlignmentTime {
            lines: milliseconds(|run| run.parts[0]),
            classifier: milliseconds(|run| run.parts[1]),
            icp: milliseconds(|run| run.parts[2]),
            total: milliseconds(|run| run.parts.iter().sum()),
        };
        Some(OneAlignment { transform_a_b, time })
    }

    fn align(&self, maps: &PairMaps<'_>, tags: &[CommonTag]) -> Option<Timed> {
        let (segments, lines_time) = timed(self.lines.as_ref(), |(parameters, seed)| {
            [&maps.a, &maps.b].map(|map| extract_segments(map, parameters, *seed))
        });
        let (guess, classifier_time) = timed(Some(&self.classifier), |parameters| {
            let directions = segments.map(|segments| segments.map(|walls| map_direction(&walls, parameters)));
            let [a, b] = directions.as_ref().map_or([None, None], |[a, b]| [Some(a), Some(b)]);
            first_guess(tags, a, b, parameters)
        });
        let guess = guess?.ok()?;
        let (refined, icp_time) = timed(self.icp.as_ref(), |parameters| {
            let [a, b] = [&maps.a, &maps.b].map(|map| WallMap::new(map, parameters.normal_radius));
            let guess = icp::InitialGuess::new(guess.transform_a_b, guess.covariance, parameters);
            let transform_a_b = refine(&a, &b, &guess, parameters).registration.transform_a_b;
            if let Some(parameters) = &self.verifier {
                let (a, b) = (MapView::rigid(maps.a, &a), MapView::rigid(maps.b, &b));
                std::hint::black_box(compare(&a, &b, &transform_a_b, &parameters.comparison()));
            }
            transform_a_b
        });
        let transform_a_b = refined.unwrap_or(guess.transform_a_b);
        Some(Timed { transform_a_b, parts: [lines_time, classifier_time, icp_time] })
    }
}

/// What a stage makes, if the pipeline has it, and the processor time that it takes; none for a stage that is not
/// there.
fn timed<P, T>(parameters: Option<&P>, work: impl FnOnce(&P) -> T) -> (Option<T>, Duration) {
    let Some(parameters) = parameters else { return (None, Duration::ZERO) };
    let start = ProcessorTime::now();
    let made = work(parameters);
    (Some(made), ProcessorTime::now().since(start))
}

/// The parameters and the seed of the only stage of a kind; none if there is no such stage.
fn parameters<P: DeserializeOwned>(pipeline: &Pipeline, kind: &str) -> Result<Option<(P, u64)>> {
    let Some(index) = pipeline.stages.iter().position(|stage| stage.kind.name == kind) else { return Ok(None) };
    let stage = &pipeline.stages[index];
    let parameters =
        stage.parameters.clone().try_into().with_context(|| format!("the parameters of {}", stage.name))?;
    Ok(Some((parameters, pipeline.context(index).seed)))
}

/// The last decision of the tag filter on each pair of robots, in a log that a merge has written.
pub(super) fn last_common_tags(log: &Path) -> Result<BTreeMap<(String, String), CommonTags>> {
    let mut last = BTreeMap::new();
    read_decoded(log, |tags: CommonTags| {
        last.insert((tags.robot_a.clone(), tags.robot_b.clone()), tags);
    })?;
    Ok(last)
}
