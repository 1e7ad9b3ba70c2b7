//! YAML that others have written.

use serde::de::DeserializeOwned;

/// The maximum nesting of brackets, and of lists that begin on one line. The descriptions of maps and bags have two.
const DEEPEST: usize = 64;

/// Parses a text.
///
/// # Errors
/// It is no YAML of this type, or its brackets are nested too deeply: libyaml looks at all open ones at each token, so
/// a text of nothing but brackets would take a time that grows with its square; and a line of nothing but dashes is one
/// list in the other, each of which takes hundreds of bytes.
pub(crate) fn parse<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    let mut depth = 0_usize;
    for (number, line) in text.lines().enumerate() {
        let marks = line.split_ascii_whitespace().take_while(|word| matches!(*word, "-" | "?" | ":"));
        if marks.take(DEEPEST + 1).count() > DEEPEST {
            return Err(format!("more than {DEEPEST} lists, one in the other, at line {}", number + 1));
        }
        for character in line.chars() {
            match character {
                // Brackets within quotes count, too: no file has so many.
                '[' | '{' => depth += 1,
                ']' | '}' => depth = depth.saturating_sub(1),
                _ => {}
            }
            if depth > DEEPEST {
                return Err(format!("more than {DEEPEST} open brackets at line {}", number + 1));
            }
        }
    }
    serde_norway::from_str(text).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    #[test]
    fn nested_brackets_are_refused_at_once() {
        for open in ["[", "{", "{a: ", "[[]"] {
            let error = parse::<Value>(&format!("a: 1\nb: {}", open.repeat(1 << 20))).unwrap_err();
            assert!(error.contains("open brackets at line 2"), "{error}");
        }
        assert_eq!(parse::<Value>("a: [[1], {b: 2}]").unwrap()["a"][1]["b"], 2);
        assert!(parse::<Value>("a: [1").is_err());
        assert!(parse::<Value>(&"[]\n".repeat(1000)).is_err());
        for open in ["- ", "? ", "- ? "] {
            let error = parse::<Value>(&format!("a: 1\nb: 2\n {}", open.repeat(1 << 20))).unwrap_err();
            assert!(error.contains("one in the other, at line 3"), "{error}");
        }
        assert_eq!(parse::<Value>("- - 1\n  - 2").unwrap()[0][1], 2);
    }

    #[test]
    fn other_nesting_and_references_are_parsed_or_refused() {
        for part in ["- ", "? ", "a: &a ", "*a ", "!!b ", "\"", "| ", "a:\n ", ": "] {
            let _ = parse::<Value>(&part.repeat(20_000));
        }
    }
}
