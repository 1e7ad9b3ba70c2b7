//! Lines of prose that are no longer than a line may be.

use gridweave_runtime::pipeline::fill;

/// A line, without its end. Where it is longer than `width` it is broken at spaces, and what is below its first part is indented
/// by `indent`.
pub(crate) fn broken(line: &str, indent: usize, width: Option<usize>) -> String {
    parts(line, indent, width).join("\n")
}

/// The same, cut after `most` lines; what was cut is told by three dots.
pub(crate) fn cut(line: &str, indent: usize, width: Option<usize>, most: usize) -> String {
    let mut parts = parts(line, indent, width);
    if parts.len() > most {
        parts.truncate(most);
        if let Some(last) = parts.last_mut() {
            let room = width.unwrap_or(usize::MAX).saturating_sub(4);
            while last.chars().count() > room {
                let kept = last.rfind(' ').unwrap_or_default();
                last.truncate(kept);
            }
            last.push_str(" ...");
        }
    }
    parts.join("\n")
}

fn parts(line: &str, indent: usize, width: Option<usize>) -> Vec<String> {
    let Some(width) = width.filter(|width| line.chars().count() > *width) else { return vec![line.to_owned()] };
    let own = line.len() - line.trim_start().len();
    let filled = fill(line, width.saturating_sub(own.max(indent)));
    let start = |number: usize| if number == 0 { own } else { indent };
    filled.iter().enumerate().map(|(number, part)| format!("{:start$}{part}", "", start = start(number))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_too_long_is_broken_and_hangs() {
        assert_eq!(broken("  one two three", 4, Some(11)), "  one two\n    three");
        assert_eq!(broken("  one two three", 4, None), "  one two three");
    }

    #[test]
    fn what_is_cut_is_told() {
        let text = cut("one two three four five six seven", 2, Some(12), 2);
        assert_eq!(text, "one two\n  three ...");
        assert!(text.lines().all(|line| line.len() <= 12));
        assert_eq!(cut("one two", 2, Some(12), 2), "one two");
    }
}
