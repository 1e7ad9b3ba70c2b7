//! Where the readings of tags are in messages of any type: `tags = { topic = ..., id_field = ... }` in `[robots]`.

use super::diagnostic::{Diagnostic, Location, Problems};
use super::document::{Entry, Item};
use super::values::{entries, text, unknown_key, wrong_type};
use crate::stage::{PathLoss, TagFields};

const KEYS: [&str; 16] = [
    "topic",
    "each",
    "id_field",
    "range_field",
    "range_unit",
    "rssi_field",
    "rssi_at_1m",
    "path_loss_exponent",
    "rssi_stddev",
    "stddev_field",
    "stddev",
    "pose_field",
    "bearing_field",
    "bearing_unit",
    "bearing_stddev_field",
    "bearing_stddev",
];
const EXAMPLE: &str = "tags = { topic = \"/{robot}/uwb\", id_field = \"anchor_id\", range_field = \"distance\" }";

/// Takes in the table. Gives the entry of the topic, and the fields.
pub(super) fn read_tag_fields<'a>(
    item: &'a Item,
    key_at: &Location,
    problems: &mut Problems,
) -> (Option<&'a Item>, TagFields) {
    let (mut topic, mut fields) = (None, TagFields::default());
    let (mut rssi_at_1m, mut exponent, mut stddev) = (None, None, None);
    for Entry { key, key_at, item } in entries(item, "tags", problems) {
        let number: &mut Option<f64> = match key.as_str() {
            "topic" => {
                topic = Some(item);
                continue;
            }
            "id_field" => {
                fields.id_field = text(key, item, problems).unwrap_or_default().to_owned();
                continue;
            }
            "each"
            | "range_field"
            | "rssi_field"
            | "stddev_field"
            | "pose_field"
            | "bearing_field"
            | "bearing_stddev_field" => {
                let field = match key.as_str() {
                    "each" => &mut fields.each,
                    "range_field" => &mut fields.range_field,
                    "rssi_field" => &mut fields.rssi_field,
                    "stddev_field" => &mut fields.stddev_field,
                    "bearing_field" => &mut fields.bearing_field,
                    "bearing_stddev_field" => &mut fields.bearing_stddev_field,
                    _ => &mut fields.pose_field,
                };
                *field = text(key, item, problems).map(str::to_owned);
                continue;
            }
            "range_unit" => &mut fields.range_unit,
            "stddev" => &mut fields.stddev,
            "bearing_unit" => &mut fields.bearing_unit,
            "bearing_stddev" => &mut fields.bearing_stddev,
            "rssi_at_1m" => &mut rssi_at_1m,
            "path_loss_exponent" => &mut exponent,
            "rssi_stddev" => &mut stddev,
            _ => {
                problems.push(unknown_key(key, key_at, "tags", &KEYS));
                continue;
            }
        };
        let value = item.as_float().or_else(|| item.as_integer().map(|value| value as f64));
        let is_good = |value: &f64| match key.as_str() {
            "rssi_at_1m" => value.is_finite(),
            // Below 0 it counts clockwise.
            "bearing_unit" => value.is_finite() && *value != 0.0,
            _ => value.is_finite() && *value > 0.0,
        };
        match value.filter(is_good) {
            Some(value) => *number = Some(value),
            None if key == "rssi_at_1m" => problems.push(wrong_type(key, item, "a number, dBm")),
            None if key == "bearing_unit" => problems.push(wrong_type(key, item, "a number other than 0")),
            None => problems.push(wrong_type(key, item, "a number above 0")),
        }
    }
    fields.path_loss = rssi_at_1m.map(|rssi_at_1m| PathLoss {
        rssi_at_1m,
        exponent: exponent.unwrap_or(2.0),
        stddev: stddev.unwrap_or(4.0),
    });
    let mut lacks = |what: &str, why: &str| {
        let problem = Diagnostic::new(format!("`tags` has no `{what}`")).at(key_at, why);
        problems.push(problem.help(format!("write as in `{EXAMPLE}`")));
    };
    if topic.is_none() {
        lacks("topic", "nothing says on which topic the readings are");
    }
    if fields.id_field.is_empty() {
        lacks("id_field", "nothing says which tag a reading is of");
    }
    let tells_where = [&fields.range_field, &fields.rssi_field, &fields.pose_field, &fields.bearing_field];
    if tells_where.iter().all(|field| field.is_none()) {
        lacks(
            "range_field",
            "a reading needs a range, a signal strength (`rssi_field`), a bearing (`bearing_field`) or a pose (`pose_field`)",
        );
    }
    if fields.rssi_field.is_some() && fields.range_field.is_none() && fields.path_loss.is_none() {
        lacks("rssi_at_1m", "a signal strength says how far a tag is only if that at one metre is known");
    }
    (topic, fields)
}
