//! Layout of a pipeline as a drawing: stages in columns, each to the right of its inputs.

use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use toml::{Table, Value};

const BOX: [usize; 2] = [150, 40];
const GAP: [usize; 2] = [50, 14];
const MARGIN: usize = 8;

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

/// Lays out the text of a pipeline file; `None` if it is not a pipeline.
pub(super) fn graph(pipeline: &str) -> Option<Graph> {
    let pipeline: Table = pipeline.parse().ok()?;
    let stages = pipeline.get("stages")?.as_table()?;
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
    Some(Graph {
        width: side(0),
        height: side(1),
        box_width: BOX[0],
        box_height: BOX[1],
        boxes: boxes.collect(),
        wires: wires.filter_map(|(from, to)| wire(from, to)).collect(),
    })
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

/// Column of each stage: one more than those of its inputs. In a cycle, which only a delay can close, it is at most the
/// number of stages.
fn columns<'a>(inputs: &BTreeMap<&'a str, BTreeSet<&'a str>>) -> BTreeMap<&'a str, usize> {
    let mut columns: BTreeMap<&str, usize> = inputs.keys().map(|name| (*name, 0)).collect();
    for _ in 0..inputs.len() {
        for (name, from) in inputs {
            let column = from.iter().map(|from| columns[from] + 1).max().unwrap_or_default();
            columns.insert(name, column.min(inputs.len()));
        }
    }
    columns
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let drawn = graph(text).unwrap();
        let x = |name: &str| drawn.boxes.iter().find(|stage| stage.name == name).unwrap().x;
        assert!(x("log") < x("lines") && x("lines") < x("output"));
        assert_eq!((drawn.boxes.len(), drawn.wires.len()), (3, 3));
        assert!(drawn.width > x("output") + BOX[0] && drawn.height > BOX[1]);
    }

    #[test]
    fn cycles_and_texts_that_are_not_pipelines_are_handled() {
        let cycle = "[stages.a]\ninputs = [\"b\"]\n[stages.b]\ninputs = { map = \"a.x\" }";
        assert_eq!(graph(cycle).unwrap().wires.len(), 2);
        assert_eq!((graph("no toml"), graph("a = 1")), (None, None));
        assert!(graph("[stages]").unwrap().boxes.is_empty());
    }

    #[test]
    fn a_shipped_pipeline_can_be_drawn() {
        let drawn = graph(include_str!("../../../auto_merge.toml")).unwrap();
        assert!(drawn.boxes.len() > 10 && drawn.wires.len() > drawn.boxes.len());
    }
}
