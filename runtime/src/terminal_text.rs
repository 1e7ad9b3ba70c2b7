//! Text for terminals: names in logs, maps and pipelines may contain characters that a terminal obeys.

use std::borrow::Cow;
use std::fmt::Write as _;

/// The text with each character that a terminal obeys, or that hides the order of others, as `\u` and four hexadecimal
/// digits: as in JSON, of which no string has another value by that. Line ends and tabs stay.
pub fn escape(text: &str) -> Cow<'_, str> {
    escape_if(text, |_| false)
}

/// The same for a text of this program, whose colours and styles stay (ECMA-48, "select graphic rendition").
pub fn escape_all_but_styles(text: &str) -> Cow<'_, str> {
    escape_if(text, |rest| {
        let parameters =
            rest.strip_prefix("\u{1b}[").map(|rest| rest.trim_start_matches(|c: char| c.is_ascii_digit() || c == ';'));
        parameters.is_some_and(|rest| rest.starts_with('m'))
    })
}

/// Escapes each character at which `stays` refuses the rest of the text.
fn escape_if(text: &str, stays: impl Fn(&str) -> bool) -> Cow<'_, str> {
    // Nearly all texts have none.
    if !text.chars().any(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for (at, character) in text.char_indices() {
        match is_obeyed(character) && !stays(&text[at..]) {
            // Writing to a string does not fail.
            true => drop(write!(escaped, "\\u{:04x}", u32::from(character))),
            false => escaped.push(character),
        }
    }
    Cow::Owned(escaped)
}

/// Whether a terminal obeys the character: a control character of ASCII or of ISO 8859, or one that changes the
/// direction of text.
fn is_obeyed(character: char) -> bool {
    let changes_direction =
        matches!(character, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    character.is_control() && !['\n', '\t'].contains(&character) || changes_direction
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_is_escaped_and_the_rest_is_not() {
        assert!(matches!(escape("a Ünïcode\tline\n"), Cow::Borrowed("a Ünïcode\tline\n")));
        assert_eq!(
            escape("\u{1b}]0;title\u{7}\r\u{9b}31m\u{7f}\u{202e}x"),
            "\\u001b]0;title\\u0007\\u000d\\u009b31m\\u007f\\u202ex"
        );
        // As in JSON.
        let json = format!("{{\"a\":\"{}\"}}", '\u{9b}');
        assert_eq!(serde_json::from_str::<serde_json::Value>(&escape(&json)).unwrap()["a"], "\u{9b}");
    }

    #[test]
    fn styles_of_this_program_stay() {
        let text = "\u{1b}[1;31merror\u{1b}[0m \u{1b}[2J\u{1b}]0;x\u{7}";
        assert_eq!(escape_all_but_styles(text), "\u{1b}[1;31merror\u{1b}[0m \\u001b[2J\\u001b]0;x\\u0007");
        assert_eq!(escape(text), "\\u001b[1;31merror\\u001b[0m \\u001b[2J\\u001b]0;x\\u0007");
    }
}
