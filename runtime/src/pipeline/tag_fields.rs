//! Where the readings of tags are in messages of any type: `tags = { topic = ..., id_field = ... }` in `[robots]`.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item};
use super::values::{entries, text, unknown_key, wrong_type};
use crate::stage::{PathLoss, TagFields};
use std::collections::BTreeMap;

/// The value that a key takes.
#[derive(Clone, Copy)]
enum Expected {
    /// The topic, which is checked elsewhere.
    Topic,
    Text,
    /// A number in words, and whether a finite one fits.
    Number(&'static str, fn(f64) -> bool),
}

const POSITIVE: Expected = Expected::Number("a number above 0", |value| value > 0.0);
const KEYS: [(&str, Expected); 16] = [
    ("topic", Expected::Topic),
    ("each", Expected::Text),
    ("id_field", Expected::Text),
    ("range_field", Expected::Text),
    ("range_unit", POSITIVE),
    ("rssi_field", Expected::Text),
    ("rssi_at_1m", Expected::Number("a number, dBm", |_| true)),
    ("path_loss_exponent", POSITIVE),
    ("rssi_stddev", POSITIVE),
    ("stddev_field", Expected::Text),
    ("stddev", POSITIVE),
    ("pose_field", Expected::Text),
    ("bearing_field", Expected::Text),
    // Below 0 it counts clockwise.
    ("bearing_unit", Expected::Number("a number other than 0", |value| value != 0.0)),
    ("bearing_stddev_field", Expected::Text),
    ("bearing_stddev", POSITIVE),
];
const EXAMPLE: &str = "tags = { topic = \"/{robot}/uwb\", id_field = \"anchor_id\", range_field = \"distance\" }";

/// Reads the table. Returns the entry of the topic, and the fields.
pub(super) fn read_tag_fields<'a>(
    item: &'a Item,
    key_at: &Location,
    problems: &mut Problems,
) -> (Option<&'a Item>, TagFields) {
    let (mut topic, mut texts, mut numbers) = (None, BTreeMap::new(), BTreeMap::new());
    for Entry { key, key_at, item } in entries(item, "tags", problems) {
        match KEYS.iter().find(|(known, _)| known == key) {
            None => problems.push(unknown_key(key, key_at, "tags", &KEYS.map(|(key, _)| key))),
            Some((_, Expected::Topic)) => topic = Some(item),
            Some((key, Expected::Text)) => texts.extend(text(key, item, problems).map(|text| (*key, text.to_owned()))),
            Some((key, Expected::Number(expected, fits))) => {
                let value = item.as_float().or_else(|| item.as_integer().map(|value| value as f64));
                match value.filter(|value| value.is_finite() && fits(*value)) {
                    Some(value) => drop(numbers.insert(*key, value)),
                    None => problems.push(wrong_type(key, item, expected)),
                }
            }
        }
    }
    let number = |key: &str| numbers.get(key).copied();
    let fields = TagFields {
        each: texts.remove("each"),
        id_field: texts.remove("id_field").unwrap_or_default(),
        range_field: texts.remove("range_field"),
        range_unit: number("range_unit"),
        rssi_field: texts.remove("rssi_field"),
        path_loss: number("rssi_at_1m").map(|rssi_at_1m| PathLoss {
            rssi_at_1m,
            exponent: number("path_loss_exponent").unwrap_or(2.0),
            stddev: number("rssi_stddev").unwrap_or(4.0),
        }),
        stddev_field: texts.remove("stddev_field"),
        stddev: number("stddev"),
        pose_field: texts.remove("pose_field"),
        bearing_field: texts.remove("bearing_field"),
        bearing_unit: number("bearing_unit"),
        bearing_stddev_field: texts.remove("bearing_stddev_field"),
        bearing_stddev: number("bearing_stddev"),
    };
    report_missing(topic.is_some(), &fields, key_at, problems);
    (topic, fields)
}

/// Reports what a reading lacks.
fn report_missing(has_topic: bool, fields: &TagFields, key_at: &Location, problems: &mut Problems) {
    let mut lacks = |what: &str, why: &str| {
        let problem = Diagnostic::new(format!("`tags` has no `{what}`")).at(key_at, why);
        problems.push(problem.help(format!("write as in `{EXAMPLE}`")));
    };
    if !has_topic {
        lacks("topic", "nothing says on which topic the readings are");
    }
    if fields.id_field.is_empty() {
        lacks("id_field", "nothing says which tag a reading is of");
    }
    let of_position = [&fields.range_field, &fields.rssi_field, &fields.pose_field, &fields.bearing_field];
    if of_position.iter().all(|field| field.is_none()) {
        lacks(
            "range_field",
            "a reading needs a range, a signal strength (`rssi_field`), a bearing (`bearing_field`) or a pose (`pose_field`)",
        );
    }
    if fields.rssi_field.is_some() && fields.range_field.is_none() && fields.path_loss.is_none() {
        lacks("rssi_at_1m", "a signal strength says how far a tag is only if that at one metre is known");
    }
}
