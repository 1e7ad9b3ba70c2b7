//! TOML text as a tree in which every key and value has its location.

use super::diagnostic::{Diagnostic, Location, Problems};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and its location.
#[derive(Clone, Debug)]
pub(super) struct Item {
    pub(super) at: Location,
    pub(super) value: Value,
}

/// A TOML value.
#[derive(Clone, Debug)]
pub(super) enum Value {
    /// A table, in the order of the text.
    Table(Vec<Entry>),
    /// A list.
    List(Vec<Item>),
    /// Anything else.
    Plain(toml::Value),
}

/// A key of a table, and its value.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) key: String,
    pub(super) key_at: Location,
    pub(super) item: Item,
}

impl Item {
    pub(super) fn as_str(&self) -> Option<&str> {
        match &self.value {
            Value::Plain(value) => value.as_str(),
            _ => None,
        }
    }

    pub(super) fn as_bool(&self) -> Option<bool> {
        match &self.value {
            Value::Plain(value) => value.as_bool(),
            _ => None,
        }
    }

    pub(super) fn as_float(&self) -> Option<f64> {
        match &self.value {
            Value::Plain(value) => value.as_float(),
            _ => None,
        }
    }

    pub(super) fn as_integer(&self) -> Option<i64> {
        match &self.value {
            Value::Plain(value) => value.as_integer(),
            _ => None,
        }
    }

    /// The same value without locations.
    pub(super) fn to_toml(&self) -> toml::Value {
        match &self.value {
            Value::Table(entries) => {
                toml::Value::Table(entries.iter().map(|entry| (entry.key.clone(), entry.item.to_toml())).collect())
            }
            Value::List(items) => toml::Value::Array(items.iter().map(Self::to_toml).collect()),
            Value::Plain(value) => value.clone(),
        }
    }

    /// The type in words, for "expected a number, found ...".
    pub(super) fn describe(&self) -> &'static str {
        match &self.value {
            Value::Table(_) => "a table",
            Value::List(_) => "a list",
            Value::Plain(toml::Value::String(_)) => "text",
            Value::Plain(toml::Value::Integer(_)) => "a whole number",
            Value::Plain(toml::Value::Float(_)) => "a number",
            Value::Plain(toml::Value::Boolean(_)) => "true or false",
            Value::Plain(_) => "a date or time",
        }
    }
}

/// The tables of a pipeline file; none if it is not TOML.
pub(super) fn parse(text: &str, problems: &mut Problems) -> Option<Vec<Entry>> {
    let (table, errors) = DeTable::parse_recoverable(text);
    let origin = Origin { source: 0, offset: 0 };
    if errors.is_empty() {
        return Some(origin.entries(table.into_inner()));
    }
    for error in errors {
        let span = error.span().unwrap_or(text.len()..text.len());
        problems.push(Diagnostic::new("this is not TOML").at(&Location::new(0, span), error.message()));
    }
    None
}

/// The value in text `source` at byte `offset`; none if it is not TOML.
pub(super) fn parse_value(text: &str, source: usize, offset: usize) -> Option<Item> {
    let value = DeValue::parse(text).ok()?;
    Some(Origin { source, offset }.item(value))
}

/// The location of the text that is being parsed.
struct Origin {
    source: usize,
    offset: usize,
}

impl Origin {
    fn location<T>(&self, spanned: &Spanned<T>) -> Location {
        let span = spanned.span();
        Location::new(self.source, self.offset + span.start..self.offset + span.end)
    }

    fn entries(&self, table: DeTable<'_>) -> Vec<Entry> {
        let mut entries: Vec<Entry> = table
            .into_iter()
            .map(|(key, value)| {
                let key_at = self.location(&key);
                Entry { key: key.into_inner().into_owned(), key_at, item: self.item(value) }
            })
            .collect();
        entries.sort_by(|a, b| a.key_at.cmp(&b.key_at));
        entries
    }

    fn item(&self, value: Spanned<DeValue<'_>>) -> Item {
        let at = self.location(&value);
        let value = match value.into_inner() {
            DeValue::Table(table) => Value::Table(self.entries(table)),
            DeValue::Array(items) => Value::List(items.into_iter().map(|item| self.item(item)).collect()),
            DeValue::String(text) => Value::Plain(toml::Value::String(text.into_owned())),
            DeValue::Boolean(value) => Value::Plain(toml::Value::Boolean(value)),
            DeValue::Datetime(value) => Value::Plain(toml::Value::Datetime(value)),
            DeValue::Integer(number) => Value::Plain(integer(number.as_str(), number.radix())),
            DeValue::Float(number) => {
                // The parser has checked the syntax, so only `nan` variants fail to parse.
                Value::Plain(toml::Value::Float(number.as_str().parse().unwrap_or(f64::NAN)))
            }
        };
        Item { at, value }
    }
}

/// An integer; a float if it is out of the range of TOML.
fn integer(text: &str, radix: u32) -> toml::Value {
    match i64::from_str_radix(text, radix) {
        Ok(number) => toml::Value::Integer(number),
        Err(_) => toml::Value::Float(i128::from_str_radix(text, radix).map_or(f64::INFINITY, |number| number as f64)),
    }
}
