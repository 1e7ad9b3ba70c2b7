//! Layout of a pipeline as a drawing: stages in columns, each to the right of its inputs.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use toml::{Table, Value};

const BOX: [usize; 2] = [150, 40];
const GAP: [usize; 2] = [50, 14];
const MARGIN: usize = 8;
/// The most stages that are drawn. A drawing of more is of no use, and long before that larger than a screen.
const MOST_STAGES: usize = 300;

/// Boxes and the wires between them, in pixels.
#[derive(Debug, PartialEq, Serialize)]
pub(super) struct Graph {
    width: usize,
    height: usize,
    box_width: usize,
    box_height: usize,
    boxes: Vec<Stage>,
    /// SVG paths.
    wires: Vec<String>,
}

#[derive(Debug, PartialEq, Serialize)]
struct Stage {
    name: String,
    kind: String,
    x: usize,
    y: usize,
}

/// The drawing of a pipeline.
#[derive(Debug, PartialEq)]
pub(super) enum Drawing {
    Drawn(Graph),
    /// There are too many stages: their number.
    TooMany(usize),
}

/// Lays out the text of a pipeline file; `None` if it is not a pipeline.
pub(super) fn drawing(pipeline: &str) -> Option<Drawing> {
    let pipeline: Table = pipeline.parse().ok()?;
    let stages = pipeline.get("stages")?.as_table()?;
    Some(match stages.len() {
        0..=MOST_STAGES => Drawing::Drawn(graph(stages)),
        count => Drawing::TooMany(count),
    })
}

fn graph(stages: &Table) -> Graph {
    let inputs: BTreeMap<&str, BTreeSet<&str>> =
        stages.iter().map(|(name, stage)| (name.as_str(), stages_of(stage.get("inputs"), stages))).collect();
    let columns = columns(&inputs);
    let mut rows: BTreeMap<usize, usize> = BTreeMap::new();
    let mut places: BTreeMap<&str, [usize; 2]> = BTreeMap::new();
    for (name, column) in &columns {
        let row = rows.entry(*column).or_default();
        places.insert(name, [MARGIN + column * (BOX[0] + GAP[0]), MARGIN + *row * (BOX[1] + GAP[1])]);
        *row += 1;
    }
    let kind = |name: &str| stages.get(name)?.get("kind")?.as_str();
    let boxes = places.iter().map(|(name, [x, y])| Stage {
        name: (*name).to_owned(),
        kind: kind(name).unwrap_or_default().to_owned(),
        x: *x,
        y: *y,
    });
    let wire = |from: &str, to: &str| {
        let ([x, y], [end_x, end_y]) = (*places.get(from)?, *places.get(to)?);
        let (x, y, end_y) = (x + BOX[0], y + BOX[1] / 2, end_y + BOX[1] / 2);
        let control = GAP[0] / 2;
        Some(format!("M{x} {y}C{} {y} {} {end_y} {end_x} {end_y}", x + control, end_x.saturating_sub(control)))
    };
    let wires = inputs.iter().flat_map(|(to, from)| from.iter().map(move |from| (*from, *to)));
    let side = |part: usize| places.values().map(|place| place[part] + BOX[part] + MARGIN).max().unwrap_or_default();
    Graph {
        width: side(0),
        height: side(1),
        box_width: BOX[0],
        box_height: BOX[1],
        boxes: boxes.collect(),
        wires: wires.filter_map(|(from, to)| wire(from, to)).collect(),
    }
}

/// Finds the stages that inputs name: a text, a list, or a table of these.
fn stages_of<'a>(inputs: Option<&'a Value>, stages: &Table) -> BTreeSet<&'a str> {
    match inputs {
        Some(Value::String(text)) => {
            let stage = text.split_once('.').map_or(text.as_str(), |(stage, _)| stage);
            stages.contains_key(stage).then_some(stage).into_iter().collect()
        }
        Some(Value::Array(values)) => values.iter().flat_map(|value| stages_of(Some(value), stages)).collect(),
        Some(Value::Table(table)) => table.values().flat_map(|value| stages_of(Some(value), stages)).collect(),
        _ => BTreeSet::new(),
    }
}

/// Column of each stage: one more than those of its inputs. A cycle, which only a delay can close, is cut at the first of
/// its stages.
fn columns<'a>(inputs: &BTreeMap<&'a str, BTreeSet<&'a str>>) -> BTreeMap<&'a str, usize> {
    let mut columns = BTreeMap::new();
    for name in inputs.keys() {
        column(name, inputs, &mut columns);
    }
    columns.into_iter().map(|(name, column)| (name, column.unwrap_or_default())).collect()
}

/// Finds the column of a stage and those of its inputs, at most [`MOST_STAGES`] deep. A stage whose column is being found
/// has `None`.
fn column<'a>(
    name: &'a str,
    inputs: &BTreeMap<&'a str, BTreeSet<&'a str>>,
    columns: &mut BTreeMap<&'a str, Option<usize>>,
) -> Option<usize> {
    if let Some(known) = columns.get(name) {
        return *known;
    }
    columns.insert(name, None);
    let from = inputs.get(name).into_iter().flatten();
    let found = from.filter_map(|from| Some(column(from, inputs, columns)? + 1)).max().unwrap_or_default();
    columns.insert(name, Some(found));
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph_of(pipeline: &str) -> Graph {
        let Some(Drawing::Drawn(graph)) = drawing(pipeline) else { panic!("it is not drawn") };
        graph
    }

    /// A pipeline of stages that each have the next two as inputs.
    fn chain(stages: usize) -> String {
        (0..stages).map(|at| format!("[stages.a{at}]\ninputs = ['a{}.m', 'a{}.m']\n", at + 1, at + 2)).collect()
    }

    #[test]
    fn a_long_chain_is_drawn_at_once_and_more_stages_than_can_be_seen_are_not() {
        let drawn = graph_of(&chain(MOST_STAGES));
        assert_eq!((drawn.boxes.len(), drawn.width), (MOST_STAGES, 2 * MARGIN + 200 * MOST_STAGES - GAP[0]));
        assert_eq!(drawing(&chain(MOST_STAGES + 1)), Some(Drawing::TooMany(MOST_STAGES + 1)));
    }

    #[test]
    fn a_stage_is_to_the_right_of_its_inputs() {
        let text = r#"
            [stages.log]
            kind = "mcap_source"
            [stages.lines]
            kind = "line_extractor"
            inputs = ["log.map"]
            [stages.output]
            kind = "mcap_sink"
            inputs = ["log.other", "lines", "nothing.map"]"#;
        let drawn = graph_of(text);
        let x = |name: &str| drawn.boxes.iter().find(|stage| stage.name == name).unwrap().x;
        assert!(x("log") < x("lines") && x("lines") < x("output"));
        assert_eq!((drawn.boxes.len(), drawn.wires.len()), (3, 3));
        assert!(drawn.width > x("output") + BOX[0] && drawn.height > BOX[1]);
    }

    #[test]
    fn cycles_and_texts_that_are_not_pipelines_are_handled() {
        let cycle = "[stages.a]\ninputs = [\"b\"]\n[stages.b]\ninputs = { map = \"a.x\" }";
        assert_eq!(graph_of(cycle).wires.len(), 2);
        assert_eq!((drawing("no toml"), drawing("a = 1")), (None, None));
        assert!(graph_of("[stages]").boxes.is_empty());
    }

    #[test]
    fn a_shipped_pipeline_can_be_drawn() {
        let drawn = graph_of(include_str!("../../../auto_merge.toml"));
        assert!(drawn.boxes.len() > 10 && drawn.wires.len() > drawn.boxes.len());
    }
}
