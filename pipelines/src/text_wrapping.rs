//! Lines of text wrapped to the width of the terminal, by `textwrap`.

use textwrap::WordSplitter;
use textwrap::core::{Word, break_words, display_width};
use textwrap::word_splitters::split_words;
use textwrap::wrap_algorithms::wrap_first_fit;

/// A topic, a type name, a path or a list that is longer than a line is broken behind one of these.
const JOINTS: [char; 6] = ['/', '_', '-', ',', '.', '='];

/// Wraps a line at spaces to at most `width` columns. The first line keeps its indentation, the others are indented by `indent`.
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

/// Wraps words to lines of at most `width` columns. Line ends in the text count as spaces.
pub(crate) fn wrap_words(text: &str, width: usize) -> Vec<String> {
    let width = width.max(1);
    let words = text.split_whitespace().map(|word| Word { whitespace: " ", ..Word::from(word) });
    let parts = words.flat_map(|word| match word.width > width {
        // Without the hyphens that the splitter would put at the ends of lines.
        true => split_words([word], &WordSplitter::Custom(joints)).map(|part| Word { penalty: "", ..part }).collect(),
        false => vec![word],
    });
    let parts = break_words(parts, width);
    let join = |parts: &[Word<'_>]| {
        let line: String = parts.iter().flat_map(|part| [part.word, part.whitespace]).collect();
        line.trim_end().to_owned()
    };
    wrap_first_fit(&parts, &[width as f64]).into_iter().map(join).collect()
}

/// Byte offsets behind the joints of a word.
fn joints(word: &str) -> Vec<usize> {
    // All joints are one byte long.
    word.match_indices(JOINTS).map(|(at, _)| at + 1).filter(|at| *at < word.len()).collect()
}

fn wrapped(line: &str, indent: usize, width: Option<usize>) -> Vec<String> {
    let Some(width) = width.filter(|width| display_width(line) > *width) else { return vec![line.to_owned()] };
    let first_indent = line.len() - line.trim_start().len();
    let lines = wrap_words(line, width.saturating_sub(first_indent.max(indent)));
    let indented = |(number, text): (usize, String)| {
        let indent = if number == 0 { first_indent } else { indent };
        format!("{:indent$}{text}", "")
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
    fn a_cut_is_marked_by_dots() {
        let text = wrap_up_to("one two three four five six seven", 2, Some(12), 2);
        assert_eq!(text, "one two\n  three ...");
        assert!(text.lines().all(|line| line.len() <= 12));
        assert_eq!(wrap_up_to("one two", 2, Some(12), 2), "one two");
    }

    #[test]
    fn a_word_longer_than_a_line_is_broken_behind_a_joint_or_where_the_line_ends() {
        assert_eq!(wrap_words("nav_msgs/msg/OccupancyGrid", 14), ["nav_msgs/msg/", "OccupancyGrid"]);
        assert_eq!(wrap_words("a abcdefgh", 5), ["a", "abcde", "fgh"]);
    }

    #[test]
    fn wide_characters_take_two_columns() {
        assert_eq!(wrap_words("地図 地図", 4), ["地図", "地図"]);
        assert_eq!(wrap_words("地図 地図", 9), ["地図 地図"]);
    }
}
