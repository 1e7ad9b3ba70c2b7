//! Rendering of the page from templates, a style, a script, and data.

use super::graph::{Drawing, drawing};
use super::model::PageData;
use anyhow::{Context, Result};
use minijinja::value::Serde;
use minijinja::{AutoEscape, Environment, Value as Html, context};
use serde::Serialize;
use serde_json::Value;

const TEMPLATES: [(&str, &str); 3] = [
    ("page", include_str!("page/page.html")),
    ("headline", include_str!("page/headline.html")),
    ("findings", include_str!("page/findings.html")),
];
const STYLE: &str = include_str!("page/page.css");
/// Name of the entry in a log's metadata with the text of its pipeline.
const PIPELINE: &str = "gridweave_run: pipeline";
/// Parts of the script, in one scope.
const SCRIPT: [&str; 4] = [
    include_str!("page/data.js"),
    include_str!("page/drawing.js"),
    include_str!("page/layers.js"),
    include_str!("page/page.js"),
];

/// The part of the script that receives the changes of a live run. It precedes the last part, which starts the page.
const LIVE_SCRIPT: &str = include_str!("page/live.js");

/// Statistics of a stage, as a row with bars.
#[derive(Debug, PartialEq, Serialize)]
struct Stage {
    name: String,
    messages_in: u64,
    messages_out: u64,
    busy_ms: String,
    /// Its time relative to the longest of all stages, percent.
    share: u64,
    counts: Vec<(String, u64)>,
    dropped: u64,
    restarts: u64,
}

/// Renders the page.
///
/// # Errors
/// The data cannot be encoded as JSON, or a template is wrong.
pub(super) fn render(report: &PageData, summary: Option<&Value>) -> Result<String> {
    render_part("page", report, summary, false)
}

/// Renders the page of a live run.
///
/// # Errors
/// As for [`render`].
pub(super) fn render_live(report: &PageData, summary: &Value) -> Result<String> {
    render_part("page", report, Some(summary), true)
}

/// Renders the parts of that page that change, as one line of JSON.
///
/// # Errors
/// As for [`render`].
pub(super) fn render_change(report: &PageData, summary: &Value) -> Result<String> {
    let part = |name: &str| Ok::<_, anyhow::Error>(Value::from(render_part(name, report, Some(summary), true)?));
    let (headline, findings) = (part("headline")?, part("findings")?);
    Ok(format!(r#"{{"headline":{headline},"findings":{findings},"data":{}}}"#, data(report)?))
}

/// Renders one of the templates.
fn render_part(name: &str, report: &PageData, summary: Option<&Value>, is_live: bool) -> Result<String> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    for (name, text) in TEMPLATES {
        environment.add_template(name, text).context("a template of the page is wrong")?;
    }
    let template = environment.get_template(name).context("a template of the page is wrong")?;
    let page_values = match name {
        "page" => context! {
            headline => Html::from_safe_string(render_part("headline", report, summary, is_live)?),
            findings => Html::from_safe_string(render_part("findings", report, summary, is_live)?),
            style => Html::from_safe_string(STYLE.to_owned()),
            script => Html::from_safe_string(script(is_live)),
            data => Html::from_safe_string(data(report)?),
        },
        _ => context! {},
    };
    let stages = summary.map(stages).unwrap_or_default();
    let drawing = pipeline(report).and_then(drawing);
    let page = template.render(context! {
        is_live => is_live,
        report => value(report),
        stages => value(&stages),
        warnings => value(summary.map(warnings).unwrap_or_default()),
        graph => value(match &drawing {
            Some(Drawing::Drawn(graph)) => Some(graph),
            _ => None,
        }),
        stages_not_drawn => value(match drawing {
            Some(Drawing::TooMany(count)) => Some(count),
            _ => None,
        }),
        has_summary => summary.is_some(),
        last => report.times.last().map(|seconds| format!("{seconds:.1}")),
        agreement => value(report.agreement.map(|areas| areas.map(|area| format!("{area:.1}")))),
        robots => value(report.robots.iter().map(finding_row).collect::<Vec<_>>()),
        version => env!("CARGO_PKG_VERSION"),
        ..page_values
    });
    page.context("cannot render the page")
}

fn script(is_live: bool) -> String {
    let [before @ .., last] = SCRIPT;
    [before.concat().as_str(), if is_live { LIVE_SCRIPT } else { "" }, last].concat()
}

/// The text of the pipeline that has written the log, from its metadata.
fn pipeline(report: &PageData) -> Option<&str> {
    let found = report.metadata.iter().find(|(name, _)| name == PIPELINE);
    found.map(|(_, text)| text.as_str())
}

/// Makes a value for a template.
fn value(value: impl Serialize) -> Html {
    Html::from(Serde(value))
}

/// Encodes the data as JSON for a script element: no text in it can end the element.
fn data(report: &PageData) -> Result<String> {
    let text = serde_json::to_string(report).context("cannot encode the data of the page as JSON")?;
    Ok(text.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026"))
}

/// Counts what was found in a robot's map: name, colour, and numbers of walls, tags, nodes of its deformation, and
/// places.
fn finding_row(robot: &super::model::Robot) -> (String, String, [usize; 4]) {
    let counts = robot
        .findings
        .last()
        .map_or([0; 4], |found| [found.segments.len(), found.tags.len(), found.bends.len(), found.places.len()]);
    (robot.name.clone(), robot.colour.clone(), counts)
}

fn stages(summary: &Value) -> Vec<Stage> {
    let stages = summary["stages"].as_object();
    let busy = |stage: &Value| stage["busy_ms"].as_f64().unwrap_or_default().max(0.0);
    let longest = stages.iter().flat_map(|stages| stages.values()).map(busy).fold(f64::MIN_POSITIVE, f64::max);
    let number = |stage: &Value, key: &str| stage[key].as_u64().unwrap_or_default();
    let row = |(name, stage): (&String, &Value)| Stage {
        name: name.clone(),
        messages_in: number(stage, "messages_in"),
        messages_out: number(stage, "messages_out"),
        busy_ms: format!("{:.1}", busy(stage)),
        share: (100.0 * busy(stage) / longest).round() as u64,
        counts: counted(&stage["counts"]),
        dropped: number(stage, "dropped"),
        restarts: number(stage, "restarts"),
    };
    stages.iter().flat_map(|stages| stages.iter()).map(row).collect()
}

/// Lists the warnings: stage, text and count.
fn warnings(summary: &Value) -> Vec<(String, String, u64)> {
    let stages = summary["stages"].as_object();
    let of_stage = |(name, stage): (&String, &Value)| {
        let of = name.clone();
        counted(&stage["warnings"]).into_iter().map(move |(text, count)| (of.clone(), text, count)).collect::<Vec<_>>()
    };
    stages.iter().flat_map(|stages| stages.iter()).flat_map(of_stage).collect()
}

fn counted(object: &Value) -> Vec<(String, u64)> {
    let entries = object.as_object().into_iter().flatten();
    entries.map(|(text, count)| (text.clone(), count.as_u64().unwrap_or_default())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const MARKUP: &str = "</script><script>alert(1)</script>&\"'<!--";

    #[test]
    fn texts_of_a_log_or_a_summary_are_never_markup() {
        let mut report = PageData { logs: vec![MARKUP.into()], times: vec![1.0], ..PageData::default() };
        report.unmerged = vec![(MARKUP.into(), MARKUP.into())];
        report.metadata = vec![(MARKUP.into(), MARKUP.into())];
        report.problems = vec![MARKUP.into()];
        report.robots = vec![super::super::model::Robot { name: MARKUP.into(), ..Default::default() }];
        let summary = json!({"stages": {MARKUP: {"busy_ms": 1.0, "warnings": {MARKUP: 2}, "counts": {MARKUP: 3}}}});
        let page = render(&report, Some(&summary)).unwrap();
        let scripts = page.matches("<script").count();
        let empty = render(&PageData::default(), None).unwrap();
        assert_eq!((scripts, page.matches("</script").count()), (empty.matches("<script").count(), 2));
        assert!(!page.contains("alert(1)</script>") && !page.contains("<!--"));
        assert!(page.contains("&lt;&#x2f;script&gt;") && page.contains("\\u003c/script\\u003e"), "{page}");
    }

    #[test]
    fn the_page_loads_nothing_from_elsewhere() {
        let page = render(&PageData::default(), None).unwrap();
        for text in ["http://", "https://", "src=", "@import", "url(", "fetch(", "XMLHttpRequest"] {
            assert!(!page.contains(text), "{text}");
        }
        assert!(page.contains("default-src 'none'"));
    }

    #[test]
    fn stages_have_their_share_of_the_longest_time() {
        let summary = json!({"stages": {
            "log": {"messages_in": 0, "messages_out": 9, "busy_ms": 50.0},
            "icp": {"messages_in": 9, "messages_out": 3, "busy_ms": 200.0, "counts": {"pairs": 2}, "dropped": 4},
        }});
        let rows = stages(&summary);
        let icp = rows.iter().find(|stage| stage.name == "icp").unwrap();
        let log = rows.iter().find(|stage| stage.name == "log").unwrap();
        assert_eq!((icp.share, log.share, icp.dropped), (100, 25, 4));
        assert_eq!(icp.counts, [("pairs".to_owned(), 2)]);
        assert_eq!(stages(&json!({"stages": {"a": null, "b": {"busy_ms": "x"}}})).len(), 2);
    }
}
