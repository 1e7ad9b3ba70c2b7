//! The ranges of the parameters of all stage kinds, those of published methods too.

use gridweave_runtime::stage::{Registry, StageKind};
use serde_json::Value;

/// Parameters of one kind that contradict each other, and the one that the error names.
const CONTRADICTIONS: [(&str, &str, &str); 17] = [
    ("hough_spectrum_aligner", "cell = 0.01\nmax_extent = 400.0", "max_extent"),
    ("icp_refiner", "max_distance = 0.01", "max_distance"),
    ("map_aligner", "cell = 0.01\nmax_extent = 400.0", "max_extent"),
    ("merge_verifier", "bend = 1e-200", "bend"),
    ("merge_verifier", "bend = 11.0", "bend"),
    ("mcap_source", "start = 2.0\nend = 1.0", "end"),
    ("mcap_source", "rename = [\"/map\"]", "rename"),
    ("random_walk_aligner", "cell = 0.01\nmax_extent = 400.0", "max_extent"),
    ("simulator", "resolution = []", "resolution"),
    ("simulator", "resolution = [0.05, 0.0]", "resolution"),
    ("simulator", "width = 300.0\nheight = 300.0\nresolution = [0.01]", "resolution"),
    ("tag_filter", "best_certainty = 0.5", "best_certainty"),
    ("tag_filter", "max_chance = 0.5\nmax_provisional_chance = 0.4", "max_provisional_chance"),
    ("tag_localizer", "reach = 10.0\ngrid_size = 19.0", "grid_size"),
    ("tag_localizer", "resolution = 1e-4", "resolution"),
    ("tag_localizer", "window = 0.001", "window"),
    ("tag_localizer", "window = 1e3", "window"),
];

/// Numbers that are checked together with others only.
const WITHOUT_A_RANGE: [&str; 5] = [
    "icp_refiner.max_distance",
    "mcap_source.end",
    "merge_verifier.bend",
    "tag_localizer.grid_size",
    "tag_localizer.window",
];

fn registry() -> Registry {
    gridweave::shipped::registry(gridweave_published::kinds())
}

/// The names of the parameters that are errors, or none if the text cannot be read at all.
fn wrong(kind: &StageKind, parameters: &toml::Table) -> Option<Vec<String>> {
    let errors = kind.check_parameters(parameters).ok()?;
    Some(errors.into_iter().map(|error| error.field).collect())
}

/// The schema of each parameter that is a number or a list of numbers, and whether it is a list.
fn numbers(kind: &StageKind) -> Vec<(&str, &Value, bool)> {
    let properties = kind.parameter_schema().get("properties").and_then(Value::as_object).into_iter().flatten();
    properties
        .filter_map(|(name, schema)| {
            let (schema, is_list) = schema.get("items").map_or((schema, false), |items| (items, true));
            let types = &schema["type"];
            let is =
                |name: &str| types == name || types.as_array().is_some_and(|all| all.iter().any(|one| one == name));
            (is("number") || is("integer")).then_some((name.as_str(), schema, is_list))
        })
        .collect()
}

fn limit(schema: &Value, key: &str) -> Option<f64> {
    schema.get(key).and_then(Value::as_f64)
}

#[test]
fn the_defaults_of_every_kind_are_valid() {
    for kind in registry().kinds() {
        assert_eq!(wrong(kind, &toml::Table::new()), Some(vec![]), "{}", kind.name);
    }
}

#[test]
fn a_number_beyond_its_range_is_an_error_that_names_it() {
    for kind in registry().kinds().filter(|kind| !kind.is_dynamic()) {
        for (name, schema, is_list) in numbers(kind) {
            let is_whole = schema.get("format").and_then(Value::as_str).is_some_and(|format| format.contains("int"));
            let beyond = [
                limit(schema, "minimum").map(|least| least - 1.0),
                limit(schema, "exclusiveMinimum"),
                limit(schema, "maximum").map(|most| most + 1.0),
                limit(schema, "exclusiveMaximum"),
                (!is_whole).then_some(f64::NAN),
            ];
            for value in beyond.into_iter().flatten() {
                let value = if is_whole { toml::Value::Integer(value as i64) } else { toml::Value::Float(value) };
                let value = if is_list { vec![value].into() } else { value };
                // What the type itself cannot hold is refused when it is read.
                let wrong = wrong(kind, &toml::Table::from_iter([(name.to_owned(), value.clone())]));
                let is_named = wrong.is_none_or(|wrong| wrong.iter().any(|field| field == name));
                assert!(is_named, "{}.{name} = {value}", kind.name);
            }
        }
    }
}

#[test]
fn every_number_that_is_not_checked_together_with_others_has_a_range() {
    let registry = registry();
    let keys = ["minimum", "exclusiveMinimum", "maximum", "exclusiveMaximum"];
    let is_unlimited = |schema: &Value| keys.iter().all(|key| schema.get(key).is_none());
    let unlimited: Vec<String> = registry
        .kinds()
        .flat_map(|kind| numbers(kind).into_iter().map(move |number| (kind, number)))
        .filter(|(_, (_, schema, _))| is_unlimited(schema))
        .map(|(kind, (name, ..))| format!("{}.{name}", kind.name))
        .collect();
    assert_eq!(unlimited, WITHOUT_A_RANGE);
}

#[test]
fn parameters_that_contradict_each_other_are_an_error_that_names_one() {
    let registry = registry();
    for (kind, text, field) in CONTRADICTIONS {
        let wrong = wrong(registry.get(kind).unwrap(), &text.parse().unwrap());
        assert!(wrong.unwrap().iter().any(|wrong| wrong == field), "{kind}: {text}");
    }
}
