//! Lines of text wrapped to the width of the terminal, by `textwrap`.

pub(crate) use gridweave_runtime::pipeline::wrap_words;

use textwrap::core::display_width;

/// Wraps a line at spaces to at most `width` columns. The first line keeps its indentation, the others are indented by
/// `indent`.
pub(crate) fn wrap(line: &str, indent: usize, width: Option<usize>) -> String {
    wrapped(line, indent, width).join("\n")
}

/// Wraps a line as [`wrap`] does and cuts it after `most` lines; three dots mark the cut.
pub(crate) fn wrap_up_to(line: &str, indent: usize, width: Option<usize>, most: usize) -> String {
    let mut lines = wrapped(line, indent, width);
    if lines.len() > most {
        lines.truncate(most);
        if let Some(last) = lines.last_mut() {
            let room = width.unwrap_or(usize::MAX).saturating_sub(4);
            while display_width(last) > room {
                last.truncate(last.rfind(' ').unwrap_or_default());
            }
            last.push_str(" ...");
        }
    }
    lines.join("\n")
}

fn wrapped(line: &str, indent: usize, width: Option<usize>) -> Vec<String> {
    let Some(width) = width.filter(|width| display_width(line) > *width) else { return vec![line.to_owned()] };
    let first_indent = line.len() - line.trim_start().len();
    let lines = wrap_words(line, width.saturating_sub(first_indent.max(indent)));
    let indented = |(number, text): (usize, String)| {
        let indent = if number == 0 { first_indent } else { indent };
        // A width of the format panics beyond 65535.
        " ".repeat(indent) + &text
    };
    lines.into_iter().enumerate().map(indented).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_line_is_wrapped_with_a_hanging_indent() {
        assert_eq!(wrap("  one two three", 4, Some(11)), "  one two\n    three");
        assert_eq!(wrap("  one two three", 4, None), "  one two three");
    }

    #[test]
    fn an_indentation_of_any_width_is_kept() {
        let line = " ".repeat(70_000) + "one two";
        assert!(wrap(&line, 2, Some(40)).starts_with(&(" ".repeat(70_000) + "o")));
    }

    #[test]
    fn a_cut_is_marked_by_dots() {
        let text = wrap_up_to("one two three four five six seven", 2, Some(12), 2);
        assert_eq!(text, "one two\n  three ...");
        assert!(text.lines().all(|line| line.len() <= 12));
        assert_eq!(wrap_up_to("one two", 2, Some(12), 2), "one two");
    }
}
