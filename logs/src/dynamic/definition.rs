//! The parser of a `.msg` definition.

/// The maximum number of fields of a type and all types that it uses. Those of ROS have some hundreds.
pub(super) const MOST_FIELDS: usize = 10_000;

/// The primitive types.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Primitive {
    Bool,
    I8,
    U8,
    /// The same as `U8`, with another name.
    Byte,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Text,
    WideText,
}

impl Primitive {
    /// The type with this name. `byte` and `char` are unsigned 8-bit integers in ROS 2.
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "bool" => Self::Bool,
            "int8" => Self::I8,
            "uint8" | "char" => Self::U8,
            "byte" => Self::Byte,
            "int16" => Self::I16,
            "uint16" => Self::U16,
            "int32" => Self::I32,
            "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float32" => Self::F32,
            "float64" => Self::F64,
            "string" => Self::Text,
            "wstring" => Self::WideText,
            _ => return None,
        })
    }

    /// The minimum encoded size of a value, bytes.
    pub(super) fn least_size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 | Self::Byte => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 | Self::Text | Self::WideText => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// The number of values in a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Count {
    /// One.
    One,
    /// A fixed number.
    Fixed(usize),
    /// Any number, stored in the message.
    Any,
    /// Any number up to this one, stored in the message.
    UpTo(usize),
}

/// The type of a field or of its elements, as named in the definition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum TypeName {
    Primitive(Primitive),
    /// `package/Type`, or `Type` in the same package.
    Message(String),
}

/// A field in a definition.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct FieldLine {
    pub(super) name: String,
    pub(super) of: TypeName,
    /// The maximum length of a string, if bounded. It does not affect the encoding.
    pub(super) text_bound: Option<usize>,
    pub(super) count: Count,
}

/// The fields of a definition, at most one more than [`MOST_FIELDS`]; constants and default values are skipped. The error is the invalid line.
pub(super) fn fields(text: &str) -> Result<Vec<FieldLine>, String> {
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    lines.filter(|line| !line.is_empty()).filter_map(|line| field(line).transpose()).take(MOST_FIELDS + 1).collect()
}

/// The field in a line; `None` for a constant.
fn field(line: &str) -> Result<Option<FieldLine>, String> {
    let wrong = || line.to_owned();
    let (type_text, rest) = line.split_once(char::is_whitespace).ok_or_else(wrong)?;
    let rest = rest.trim_start();
    let end = rest.find(|c: char| c.is_whitespace() || c == '=').unwrap_or(rest.len());
    let (name, rest) = rest.split_at(end);
    if rest.trim_start().starts_with('=') {
        return Ok(None);
    }
    if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
        return Err(wrong());
    }
    let (element, count) = match type_text.split_once('[') {
        None => (type_text, Count::One),
        Some((element, bounds)) => match bounds.strip_suffix(']').ok_or_else(wrong)? {
            "" => (element, Count::Any),
            bounds => match bounds.strip_prefix("<=") {
                Some(bound) => (element, Count::UpTo(bound.trim().parse().map_err(|_| wrong())?)),
                None => (element, Count::Fixed(bounds.parse().map_err(|_| wrong())?)),
            },
        },
    };
    let (element, text_bound) = match element.split_once("<=") {
        None => (element, None),
        Some((element, bound)) => (element, Some(bound.parse().map_err(|_| wrong())?)),
    };
    let of = match Primitive::named(element) {
        Some(primitive) => TypeName::Primitive(primitive),
        None if element.is_empty() => return Err(wrong()),
        None => TypeName::Message(element.to_owned()),
    };
    Ok(Some(FieldLine { name: name.to_owned(), of, text_bound, count }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(text: &str) -> FieldLine {
        fields(text).unwrap().remove(0)
    }

    #[test]
    fn types_and_counts_are_parsed() {
        let field = |name: &str, of, count| FieldLine { name: name.into(), of, text_bound: None, count };
        let primitive = TypeName::Primitive;
        assert_eq!(line("int8[] data  # cells"), field("data", primitive(Primitive::I8), Count::Any));
        assert_eq!(line("float64[36] c"), field("c", primitive(Primitive::F64), Count::Fixed(36)));
        let bounded = field("names", primitive(Primitive::Text), Count::UpTo(5));
        assert_eq!(line("string<=10[<=5] names"), FieldLine { text_bound: Some(10), ..bounded });
        assert_eq!(line("a/B[2] b"), field("b", TypeName::Message("a/B".into()), Count::Fixed(2)));
        assert_eq!(line("int32 x 5"), field("x", primitive(Primitive::I32), Count::One));
        assert_eq!(line("string s \"a=b\""), field("s", primitive(Primitive::Text), Count::One));
    }

    #[test]
    fn constants_are_not_fields() {
        assert_eq!(fields("int32 A=1\nint32 B = 2\nstring C=\"x y\"\n\n# nothing").unwrap(), []);
    }

    #[test]
    fn an_invalid_line_is_named() {
        for wrong in ["int32", "int32[ x", "int32[x] y", "int32[<=x] y", "string<=x y", "[] x", "int32 a.b"] {
            assert_eq!(fields(wrong), Err(wrong.to_owned()));
        }
    }
}
