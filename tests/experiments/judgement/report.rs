//! What came of the fit: tables, the reliability diagram, the curve of right against wrong merges, and the weights.

use super::cross_validation::Judged;
use super::examples::Example;
use super::fit::Weights;
use crate::map_pairs::truth::Closeness;
use crate::plot::{Axis, Plot, Series, Shape};
use crate::results::Results;
use crate::statistics::{mean, wilson_interval};
use anyhow::Result;
use gridweave::table::Table;
use gridweave_stages::registration::judgement::Term;
use std::collections::BTreeSet;
use std::fmt::Write;

/// The probabilities at which merges are counted.
const ACCEPT: [f64; 4] = [0.9, 0.95, 0.98, 0.99];

/// Writes what came of each set, and what probabilities mean.
pub(super) fn report(examples: &[Example], judged: &[Judged], results: &mut Results) -> Result<()> {
    let sets: BTreeSet<&str> = examples.iter().map(|example| example.set.as_str()).collect();
    let heads = ["set", "pairs", "right place judged"].map(str::to_owned).into_iter();
    let heads = heads.chain(ACCEPT.iter().map(|accept| format!("right, inexact, wrong at {accept}")));
    let heads: Vec<String> = heads.collect();
    let mut table = Table::new(heads.iter().map(String::as_str));
    for set in sets {
        let of_set: Vec<(&Example, &Judged)> =
            examples.iter().zip(judged).filter(|(example, _)| example.set == set).collect();
        let has_right = |example: &Example| example.usable().any(|place| place.closeness == Closeness::Right);
        let proposed = of_set.iter().filter(|(example, _)| has_right(example)).count();
        let counts = ACCEPT.iter().map(|accept| {
            let count = |closeness: Closeness| {
                let is_meant = |judged: &Judged| judged.probability >= *accept && judged.closeness == closeness;
                of_set.iter().filter(|(_, judged)| is_meant(judged)).count()
            };
            [Closeness::Right, Closeness::Near, Closeness::Wrong].map(|one| count(one).to_string()).join(", ")
        });
        let row = [set.to_owned(), of_set.len().to_string(), proposed.to_string()];
        table.row(row.into_iter().chain(counts).collect::<Vec<_>>());
    }
    results.table("judgement", "What is merged from a probability on, cross-validated by place", &table)?;
    reliability(judged, results)?;
    right_against_wrong(judged, results)
}

/// How often the best place is right, by its probability, each bin ten times the odds of the one before.
fn reliability(judged: &[Judged], results: &mut Results) -> Result<()> {
    let odds = |probability: f64| (probability / (1.0 - probability).max(1e-12)).log10();
    let mut table = Table::new(["odds, power of ten", "pairs", "mean probability", "right", "95 % interval"]);
    let (mut points, mut band) = (Vec::new(), Vec::new());
    for bin in -6..6 {
        let (low, high) = (f64::from(bin), f64::from(bin + 1));
        let holds = |judged: &&Judged| {
            let odds = odds(judged.probability);
            (bin == -6 || odds >= low) && (bin == 5 || odds < high)
        };
        let of_bin: Vec<&Judged> = judged.iter().filter(holds).collect();
        if of_bin.is_empty() {
            continue;
        }
        let right = of_bin.iter().filter(|judged| judged.closeness != Closeness::Wrong).count();
        let (from, to) = wilson_interval(right, of_bin.len());
        let probabilities: Vec<f64> = of_bin.iter().map(|judged| judged.probability).collect();
        let cells = [format!("{low} to {high}"), of_bin.len().to_string(), format!("{:.5}", mean(&probabilities))];
        table.row(cells.into_iter().chain([right.to_string(), format!("{from:.4} to {to:.4}")]).collect::<Vec<_>>());
        let middle = 0.5 * (low + high);
        points.push((middle, right as f64 / of_bin.len() as f64));
        band.push((middle, from, to));
    }
    results.table("judgement_reliability", "What the probability means, cross-validated by place", &table)?;
    let exact = (-60..=60).map(|tenth| 0.1 * f64::from(tenth)).map(|odds| (odds, 1.0 / (1.0 + 10f64.powf(-odds))));
    let plot = Plot {
        title: "How often the best place is right".to_owned(),
        x: Axis::new("odds by the judgement, power of ten"),
        y: Axis::new("share that is right, with the 95 % interval").range(0.0, 1.0),
        shape: Shape::Lines(vec![
            Series::new("cross-validated by place", points).with_band(band),
            Series::new("if the odds were exact", exact.collect()),
        ]),
    };
    results.plot("judgement_reliability", &plot)
}

/// How many merges are right, and how many wrong, from every probability on.
fn right_against_wrong(judged: &[Judged], results: &mut Results) -> Result<()> {
    let mut sorted: Vec<&Judged> = judged.iter().collect();
    sorted.sort_by(|one, other| other.probability.total_cmp(&one.probability));
    let (mut right, mut wrong) = (0, 0);
    let mut points = vec![(0.0, 0.0)];
    for judged in sorted.iter().take_while(|judged| judged.probability >= ACCEPT[0]) {
        match judged.closeness {
            Closeness::Wrong => wrong += 1,
            Closeness::Right | Closeness::Near => right += 1,
        }
        points.push((f64::from(wrong), f64::from(right)));
    }
    let plot = Plot {
        title: "Right merges against wrong ones".to_owned(),
        x: Axis::new(format!("wrong merges, of {} pairs, down to a probability of {}", judged.len(), ACCEPT[0])),
        y: Axis::new("right merges"),
        shape: Shape::Lines(vec![Series::new("cross-validated by place", points)]),
    };
    results.plot("judgement_right_against_wrong", &plot)
}

/// The file that holds the weights, as Rust.
pub(super) fn weights_source(weights: &Weights, examples: &[Example]) -> String {
    let related = examples.iter().filter(|example| example.is_related).count();
    let places: BTreeSet<&str> =
        examples.iter().filter(|example| example.is_related).map(|example| example.place.as_str()).collect();
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write!(
        text,
        "//! The weights of the judgement. Written by `experiments fit-judgement`; do not edit.\n\
         //!\n\
         //! Fitted to {related} pairs of maps of {} places that belong together, {} of them simulated, and to {} pairs of different\n\
         //! buildings; `tests/experiments/README.md` has the command and what came of it.\n\n",
        places.len(),
        examples.iter().filter(|example| example.is_related && example.set.starts_with("simulated")).count(),
        examples.len() - related,
    );
    // Comments begin in one column, as rustfmt has them.
    let array = |values: &[f64]| {
        let numbers: Vec<String> = values.iter().map(|value| format!("{value:.4},")).collect();
        let widest = numbers.iter().map(String::len).max().unwrap_or(0);
        let lines = Term::ALL.iter().zip(&numbers);
        lines.map(|(term, number)| format!("    {number:widest$} // {}\n", term.name())).collect::<String>()
    };
    let _ = write!(
        text,
        "/// The log-odds of a hypothesis of which nothing is known.\npub const INTERCEPT: f64 = {:.4};\n\
         /// The weight of each term, in the order of [`Term::ALL`](super::Term::ALL).\n\
         pub const WEIGHTS: [f64; super::COUNT] = [\n{}];\n\
         /// The mean of each term over the right places of the fit.\n\
         pub const TYPICAL: [f64; super::COUNT] = [\n{}];\n\
         /// The log-odds of an alias against the place that it is an alias of: in any case, for how many times its\n\
         /// length self-similarity leaves unexplained of the inliers, for the log-likelihood ratio of the contradictions, and for the\n\
         /// details that agree there and not here.\n\
         pub const ALIAS: [f64; 4] = [{:.4}, {:.4}, {:.4}, {:.4}];\n",
        weights.places.intercept,
        array(&weights.places.weights),
        array(&weights.typical),
        weights.aliases.intercept,
        weights.aliases.weights[0],
        weights.aliases.weights[1],
        weights.aliases.weights[2],
    );
    text
}
