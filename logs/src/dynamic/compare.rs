//! Comparison of two values, field by field.

use super::value::{Array, Scalar, Value};

/// The maximum number of differing elements that are listed for an array of scalars.
const MOST_ELEMENTS: usize = 3;

/// A field that differs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Difference {
    /// The path, such as `tags[0].tag_id`.
    pub path: String,
    /// The expected value.
    pub expected: String,
    /// The actual value.
    pub got: String,
}

/// The differences of two values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Differences {
    /// The first differences, in field order.
    pub listed: Vec<Difference>,
    /// The total number of differences.
    pub count: usize,
}

impl Differences {
    /// Whether there are no differences.
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }
}

/// Compares two values, field by field. Integers, booleans and strings must be equal, floating-point numbers [nearly
/// equal](nearly_equal). At most `limit` differences are listed.
pub fn compare(expected: &Value<'_>, got: &Value<'_>, tolerance: f64, limit: usize) -> Differences {
    let mut comparison = Comparison { tolerance, limit, found: Differences::default() };
    comparison.values("", expected, got);
    comparison.found
}

/// Whether two numbers are equal, both NaN, or at most `tolerance` times the maximum of 1 and their absolute values
/// apart.
pub fn nearly_equal(a: f64, b: f64, tolerance: f64) -> bool {
    // Compared first, since the difference of two infinities is NaN.
    a == b
        || (a.is_nan() && b.is_nan())
        || (a - b).abs() <= tolerance * 1f64.max(a.abs()).max(b.abs()) && (a - b).is_finite()
}

struct Comparison {
    tolerance: f64,
    limit: usize,
    found: Differences,
}

impl Comparison {
    fn differ(&mut self, path: &str, expected: impl ToString, got: impl ToString) {
        self.found.count += 1;
        if self.found.listed.len() < self.limit {
            let (expected, got) = (expected.to_string(), got.to_string());
            self.found.listed.push(Difference { path: path.to_owned(), expected, got });
        }
    }

    fn values(&mut self, path: &str, expected: &Value<'_>, got: &Value<'_>) {
        match (expected, got) {
            (Value::Scalar(a), Value::Scalar(b)) if self.agree(a, b) => {}
            (Value::Array(a), Value::Array(b)) => self.arrays(path, a, b),
            (Value::Message(a), Value::Message(b)) => self.messages(path, a, b),
            _ => self.differ(path, expected, got),
        }
    }

    fn agree(&self, expected: &Scalar<'_>, got: &Scalar<'_>) -> bool {
        match (expected, got) {
            (Scalar::F32(a), Scalar::F32(b)) => nearly_equal((*a).into(), (*b).into(), self.tolerance),
            (Scalar::F64(a), Scalar::F64(b)) => nearly_equal(*a, *b, self.tolerance),
            _ => expected == got,
        }
    }

    fn messages(&mut self, path: &str, expected: &[(&str, Value<'_>)], got: &[(&str, Value<'_>)]) {
        let within = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
        let find = |fields: &[(&str, Value<'_>)], name: &str| fields.iter().position(|(field, _)| *field == name);
        for (name, value) in expected {
            match find(got, name) {
                Some(at) => self.values(&within(name), value, &got[at].1),
                None => self.differ(&within(name), value, "no such field"),
            }
        }
        for (name, value) in got.iter().filter(|(name, _)| find(expected, name).is_none()) {
            self.differ(&within(name), "no such field", value);
        }
    }

    fn arrays(&mut self, path: &str, expected: &Array<'_>, got: &Array<'_>) {
        let same_length = expected.len() == got.len();
        if !same_length {
            let elements =
                |array: &Array<'_>| format!("{} element{}", array.len(), if array.len() == 1 { "" } else { "s" });
            self.differ(path, elements(expected), elements(got));
        }
        if let (Array::Messages(a), Array::Messages(b)) = (expected, got) {
            for (at, (a, b)) in a.iter().zip(b).enumerate() {
                self.values(&format!("{path}[{at}]"), a, b);
            }
            return;
        }
        let same_bytes = match (expected, got) {
            (Array::I8(a), Array::I8(b)) => a == b,
            (Array::U8(a), Array::U8(b)) => a == b,
            _ => false,
        };
        if same_bytes {
            return;
        }
        // In arrays of different lengths, the elements after the first difference are unrelated.
        let most = if same_length { MOST_ELEMENTS } else { 1 };
        let mut differing = 0;
        for at in 0..expected.len().min(got.len()) {
            let (Some(a), Some(b)) = (expected.scalar(at), got.scalar(at)) else {
                return self.differ(path, expected, got);
            };
            if !self.agree(&a, &b) {
                differing += 1;
                if differing <= most {
                    self.differ(&format!("{path}[{at}]"), a, b);
                }
            }
        }
        if same_length && differing > most {
            let total = expected.len();
            self.differ(path, format!("{total} elements"), format!("{differing} that differ"));
        }
    }
}
