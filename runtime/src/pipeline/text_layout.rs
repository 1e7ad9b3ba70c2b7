//! Text wrapping, by `textwrap`, and tables for a terminal.

use textwrap::WordSplitter;
use textwrap::core::{Word, break_words, display_width};
use textwrap::word_splitters::split_words;
use textwrap::wrap_algorithms::wrap_first_fit;

/// The default line width, characters.
pub const TEXT_WIDTH: usize = 100;

/// The minimum width of the last column of a table, characters; with less space it is placed below the others.
const LEAST_COLUMN: usize = 24;

/// A word that is longer than a line is broken behind one of these: those of topics, type names, paths and lists.
const JOINTS: [char; 6] = ['/', '_', '-', ',', '.', '='];

/// Wraps text to lines of at most `width` columns, at spaces; line ends in it count as spaces. A word that is longer
/// than a line is broken behind the last joint that fits, or at the end of the line.
pub fn wrap_words(text: &str, width: usize) -> Vec<String> {
    let width = width.max(1);
    let words = text.split_whitespace().map(|word| Word { whitespace: " ", ..Word::from(word) });
    let parts: Vec<Word<'_>> = words
        .flat_map(|word| if display_width(word.word) > width { pieces(word, width) } else { vec![word] })
        .collect();
    let join = |parts: &[Word<'_>]| {
        let line: String = parts.iter().flat_map(|part| [part.word, part.whitespace]).collect();
        line.trim_end().to_owned()
    };
    wrap_first_fit(&parts, &[width as f64]).into_iter().map(join).collect()
}

/// The longest pieces of a word that fit a line.
fn pieces(word: Word<'_>, width: usize) -> Vec<Word<'_>> {
    let (text, whitespace) = (word.word, word.whitespace);
    // Without the hyphens that the splitter would put at the ends of lines.
    let parts = split_words([word], &WordSplitter::Custom(joints)).map(|part| Word { penalty: "", ..part });
    let parts = break_words(parts, width);
    let mut at = 0;
    let piece = |parts: &[Word<'_>]| {
        let start = at;
        at += parts.iter().map(|part| part.word.len()).sum::<usize>();
        let whitespace = if at == text.len() { whitespace } else { "" };
        Word { whitespace, ..Word::from(&text[start..at]) }
    };
    wrap_first_fit(&parts, &[width as f64]).into_iter().map(piece).collect()
}

/// Byte offsets behind the joints of a word.
fn joints(word: &str) -> Vec<usize> {
    // All joints are one byte long.
    word.match_indices(JOINTS).map(|(at, _)| at + 1).filter(|at| *at < word.len()).collect()
}

/// Appends `text`, wrapped at `width` and indented. Paragraphs stay separate.
pub(super) fn push_filled(page: &mut String, indent: usize, width: usize, text: &str) {
    for (number, paragraph) in text.split("\n\n").enumerate() {
        if number > 0 {
            page.push('\n');
        }
        for line in wrap_words(paragraph, width.saturating_sub(indent)).iter().filter(|line| !line.is_empty()) {
            page.push_str(&format!("{:indent$}{line}\n", ""));
        }
    }
}

/// Appends a table whose columns are as wide as their widest cells. The last column is wrapped at `width`, next to the
/// others or, with too little space, below them.
pub(super) fn push_table<const N: usize>(page: &mut String, indent: usize, width: usize, rows: &[[String; N]]) {
    let widest = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default();
    let widths: [usize; N] = std::array::from_fn(widest);
    let before = indent + widths.iter().take(N - 1).map(|width| width + 2).sum::<usize>();
    let fits_beside = N == 1 || before + widths[N - 1] <= width || before + LEAST_COLUMN <= width;
    let mut push = |line: &str| match line.trim_end() {
        "" => {}
        line => {
            page.push_str(line);
            page.push('\n');
        }
    };
    for row in rows {
        let cells = row.iter().zip(widths).take(N - 1);
        // A width of the format panics beyond 65535.
        let padded = |(cell, width): (&String, usize)| cell.clone() + &" ".repeat(width - cell.chars().count() + 2);
        let mut line: String = cells.map(padded).collect();
        let mut at = before;
        if !fits_beside {
            for (number, part) in fill_cells(&line, width.saturating_sub(indent + 2)).iter().enumerate() {
                push(&(" ".repeat(indent + if number == 0 { 0 } else { 2 }) + part));
            }
            (line, at) = (String::new(), indent + 4);
        }
        for part in wrap_words(&row[N - 1], width.saturating_sub(at)) {
            push(&(" ".repeat(if line.is_empty() { at } else { indent }) + &line + &part));
            line.clear();
        }
    }
}

/// Wraps the cells before the last column, if they do not fit.
fn fill_cells(cells: &str, width: usize) -> Vec<String> {
    match cells.trim_end().chars().count() <= width {
        true => vec![cells.to_owned()],
        false => wrap_words(cells, width),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_wrapped_and_paragraphs_stay_separate() {
        let mut page = String::new();
        push_filled(&mut page, 2, 100, &format!("{}\n\nlast", "word ".repeat(25)));
        let lines: Vec<&str> = page.lines().collect();
        assert_eq!(lines.len(), 4);
        assert!(lines[0].len() <= 100 && lines[0].starts_with("  word word"));
        assert_eq!(lines[2..], ["", "  last"]);
    }

    #[test]
    fn a_word_longer_than_a_line_is_broken_after_a_separator_or_at_the_end_of_the_line() {
        assert_eq!(wrap_words("see gridweave_msgs/msg/Alignment", 16), ["see", "gridweave_msgs/", "msg/Alignment"]);
        assert_eq!(wrap_words("abcdefg hi", 3), ["abc", "def", "g", "hi"]);
        assert_eq!(wrap_words("ööööö", 2), ["öö", "öö", "ö"]);
        assert_eq!(wrap_words("  ", 0), [""]);
        assert_eq!(wrap_words("a abcdefgh", 5), ["a", "abcde", "fgh"]);
    }

    #[test]
    fn columns_are_aligned() {
        let mut page = String::new();
        push_table(&mut page, 1, 100, &[["a".into(), "b".into()], ["long".into(), String::new()]]);
        assert_eq!(page, " a     b\n long\n");
    }

    #[test]
    fn the_last_column_is_wrapped_next_to_the_others_or_below_them() {
        let row = [["map".to_owned(), "nav_msgs/msg/OccupancyGrid".to_owned(), "word ".repeat(12)]];
        let table = |width: usize| {
            let mut page = String::new();
            push_table(&mut page, 2, width, &row);
            assert!(page.lines().all(|line| line.chars().count() <= width), "{page}");
            page
        };
        assert!(table(70).starts_with("  map  nav_msgs/msg/OccupancyGrid  word word"));
        assert!(table(70).lines().nth(1).unwrap().starts_with(&format!("{:35}word", "")));
        assert!(table(40).starts_with("  map  nav_msgs/msg/OccupancyGrid\n      word word"));
        table(24);
    }

    #[test]
    fn wide_characters_take_two_columns() {
        assert_eq!(wrap_words("地図 地図", 4), ["地図", "地図"]);
        assert_eq!(wrap_words("地図 地図", 9), ["地図 地図"]);
    }
}
