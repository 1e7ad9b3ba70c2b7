//! Comparison of the messages that a stage has sent with the expected ones: message by message and field by field.

use super::recording::{Recorded, Recording};
use gridweave_logs::dynamic::{self, Schema};
use gridweave_logs::schemas::full_type_name;
use gridweave_runtime::message::LogTime;
use gridweave_runtime::ros::{OccupancyGrid, RosMessage, decode};
use std::collections::{BTreeMap, BTreeSet};

/// Maximum number of grids of a case that are drawn.
const MAX_GRIDS: usize = 12;

/// Differences between a recording and the expected one.
#[derive(Debug, Default)]
pub(super) struct Comparison {
    /// The first differences, by topic and log time.
    pub(super) differences: Vec<MessageDifference>,
    /// Number of all differences.
    pub(super) count: usize,
    /// Number of messages that differ from the expected ones.
    pub(super) differing: usize,
    /// Number of messages that are expected and were not sent.
    pub(super) missing: usize,
    /// Number of messages that were sent and are not expected.
    pub(super) surplus: usize,
    /// Number of warnings that differ in their text or count.
    pub(super) warnings: usize,
    /// Grids of equal size whose cells differ.
    pub(super) grids: Vec<GridDifference>,
}

/// A difference in a message or a warning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct MessageDifference {
    /// The topic; none for a warning.
    pub(super) topic: Option<String>,
    /// The log time of the message.
    pub(super) log_time: Option<LogTime>,
    /// The path of the field; none for the message as a whole.
    pub(super) field: Option<String>,
    pub(super) expected: String,
    pub(super) got: String,
}

/// Two grids of equal size whose cells differ.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct GridDifference {
    pub(super) topic: String,
    pub(super) log_time: LogTime,
    /// Number of cells that differ.
    pub(super) cells: usize,
    /// Number of columns.
    pub(super) width: usize,
    /// Expected cells, row by row.
    pub(super) expected: Vec<i8>,
    /// Cells that were sent, row by row.
    pub(super) got: Vec<i8>,
}

impl Comparison {
    /// Compares recordings. Numbers with a fraction may differ by `tolerance`, see
    /// [`nearly_equal`](dynamic::nearly_equal). At most `limit` differences are kept.
    pub(super) fn new<'a>(expected: &'a Recording, got: &'a Recording, tolerance: f64, limit: usize) -> Self {
        let mut comparison = Self::default();
        let (expected_topics, got_topics) = (expected.by_topic(), got.by_topic());
        let topics: BTreeSet<&str> = expected_topics.keys().chain(got_topics.keys()).copied().collect();
        for topic in topics {
            let of = |topics: &BTreeMap<&str, Vec<&'a Recorded>>| topics.get(topic).cloned().unwrap_or_default();
            let (expected, got) = (of(&expected_topics), of(&got_topics));
            comparison.topic(&expected, &got, tolerance, limit);
        }
        comparison.compare_warnings(expected, got, limit);
        comparison
    }

    /// Whether nothing differs.
    pub(super) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Counts of the differences as text.
    pub(super) fn summary(&self) -> String {
        let parts = [
            (self.differing, "message differs", "messages differ"),
            (self.missing, "message is missing", "messages are missing"),
            (self.surplus, "message is surplus", "messages are surplus"),
            (self.warnings, "warning differs", "warnings differ"),
        ];
        let parts = parts.into_iter().filter(|(count, ..)| *count > 0);
        let texts = parts.map(|(count, one, many)| format!("{count} {}", if count == 1 { one } else { many }));
        texts.collect::<Vec<_>>().join(", ")
    }

    fn add(&mut self, difference: impl FnOnce() -> MessageDifference, limit: usize) {
        self.count += 1;
        if self.differences.len() < limit {
            self.differences.push(difference());
        }
    }

    /// Compares the messages of one topic: those of equal log time with each other, in the order in which they were
    /// sent.
    fn topic(&mut self, expected: &[&Recorded], got: &[&Recorded], tolerance: f64, limit: usize) {
        let whole = |message: &Recorded, expected: &str, got: &str| MessageDifference {
            topic: Some(message.channel.topic.clone()),
            log_time: Some(message.log_time),
            field: None,
            expected: expected.to_owned(),
            got: got.to_owned(),
        };
        let (mut expected, mut got) = (expected.iter().peekable(), got.iter().peekable());
        loop {
            let order = match (expected.peek(), got.peek()) {
                (None, None) => break,
                (Some(_), None) => std::cmp::Ordering::Less,
                (None, Some(_)) => std::cmp::Ordering::Greater,
                (Some(a), Some(b)) => a.log_time.cmp(&b.log_time),
            };
            let a = if order.is_le() { expected.next() } else { None };
            let b = if order.is_ge() { got.next() } else { None };
            match (a, b) {
                (Some(a), Some(b)) => self.message(a, b, tolerance, limit),
                (Some(a), None) => {
                    self.missing += 1;
                    self.add(|| whole(a, "a message", "none"), limit);
                }
                (None, Some(b)) => {
                    self.surplus += 1;
                    self.add(|| whole(b, "no message", "one"), limit);
                }
                (None, None) => {}
            }
        }
    }

    fn message(&mut self, expected: &Recorded, got: &Recorded, tolerance: f64, limit: usize) {
        let before = self.count;
        let difference = |field: Option<&str>, expected_text: String, got_text: String| MessageDifference {
            topic: Some(expected.channel.topic.clone()),
            log_time: Some(expected.log_time),
            field: field.map(str::to_owned),
            expected: expected_text,
            got: got_text,
        };
        let types = [expected, got].map(|message| full_type_name(&message.channel.schema_name).into_owned());
        if types[0] != types[1] {
            let [a, b] = types;
            self.add(|| difference(None, a, b), limit);
        } else if expected.bytes != got.bytes {
            let grid = grid_difference(expected, got);
            match field_differences(expected, got, tolerance, limit.saturating_sub(self.differences.len())) {
                Ok(found) => {
                    self.count += found.count;
                    let fields = found.listed.into_iter();
                    let fields = fields.map(|field| difference(Some(&field.path), field.expected, field.got));
                    self.differences.extend(fields);
                }
                Err(reason) => self.add(|| difference(None, bytes_text(&expected.bytes), reason), limit),
            }
            self.grids.extend(grid.filter(|_| self.grids.len() < MAX_GRIDS));
        }
        if expected.publish_time != got.publish_time {
            let times = [expected.publish_time, got.publish_time].map(|time| LogTime(time).to_string());
            let [a, b] = times;
            self.add(|| difference(Some("(publish time)"), a, b), limit);
        }
        self.differing += usize::from(self.count > before);
    }

    fn compare_warnings(&mut self, expected: &Recording, got: &Recording, limit: usize) {
        let texts: BTreeSet<&String> = expected.warnings.keys().chain(got.warnings.keys()).collect();
        for text in texts {
            let count = |recording: &Recording| recording.warnings.get(text).copied().unwrap_or_default();
            if count(expected) == count(got) {
                continue;
            }
            let times = |recording| match count(recording) {
                1 => "once".to_owned(),
                count => format!("{count} times"),
            };
            self.warnings += 1;
            let field = Some(format!("warning {text:?}"));
            self.add(
                || MessageDifference { topic: None, log_time: None, field, expected: times(expected), got: times(got) },
                limit,
            );
        }
    }
}

fn bytes_text(bytes: &[u8]) -> String {
    format!("{} bytes", bytes.len())
}

/// Finds the fields that differ. Where one of the messages cannot be decoded, the error describes how the bytes differ.
fn field_differences(
    expected: &Recorded,
    got: &Recorded,
    tolerance: f64,
    limit: usize,
) -> Result<dynamic::Differences, String> {
    let bytes = |reason: String| {
        let first = expected.bytes.iter().zip(&got.bytes).position(|(a, b)| a != b);
        let first = first.unwrap_or(expected.bytes.len().min(got.bytes.len()));
        format!(
            "{}, which differ from byte {first} on; they are not compared by fields: {reason}",
            bytes_text(&got.bytes)
        )
    };
    let schema = |message: &Recorded| Schema::of_channel(&message.channel).map_err(|error| bytes(error.to_string()));
    let (expected_schema, got_schema) = (schema(expected)?, schema(got)?);
    let a = expected_schema.decode(&expected.bytes).map_err(|error| bytes(error.to_string()))?;
    let b = got_schema.decode(&got.bytes).map_err(|error| bytes(error.to_string()))?;
    Ok(dynamic::compare(&a, &b, tolerance, limit))
}

/// Compares the cells, if both messages are grids of one size.
fn grid_difference(expected: &Recorded, got: &Recorded) -> Option<GridDifference> {
    let is_grid = |message: &Recorded| full_type_name(&message.channel.schema_name) == OccupancyGrid::NAME;
    if !(is_grid(expected) && is_grid(got)) {
        return None;
    }
    let a: OccupancyGrid<'_> = decode(&expected.bytes).ok()?;
    let b: OccupancyGrid<'_> = decode(&got.bytes).ok()?;
    let (width, height) = (a.info.width as usize, a.info.height as usize);
    let same_size = (a.info.width, a.info.height) == (b.info.width, b.info.height);
    let cells = a.cells().iter().zip(b.cells()).filter(|(a, b)| a != b).count();
    let whole = width.checked_mul(height) == Some(a.cells().len()) && a.cells().len() == b.cells().len();
    (same_size && whole && cells > 0).then(|| GridDifference {
        topic: expected.channel.topic.clone(),
        log_time: expected.log_time,
        cells,
        width,
        expected: a.cells().to_vec(),
        got: b.cells().to_vec(),
    })
}
