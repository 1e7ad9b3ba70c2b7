//! Text wrapping and tables for a terminal.

/// The default line width, characters.
pub const TEXT_WIDTH: usize = 100;

/// The minimum width of the last column of a table, characters; with less space it is placed below the others.
const LEAST_COLUMN: usize = 24;

/// The separators after which a word that is longer than a line is broken: those of topics, type names and lists.
const SEPARATORS: [char; 6] = ['/', '_', '-', ',', '.', '='];

/// Wraps text into lines of at most `width` characters, at spaces. A word that is longer than a line is broken after the last
/// separator that fits, or at the end of the line. Paragraphs are joined.
pub fn fill(text: &str, width: usize) -> Vec<String> {
    let width = width.max(1);
    let mut lines = vec![String::new()];
    for mut word in text.split_whitespace() {
        loop {
            let last = lines.last().map_or(0, |line| line.chars().count());
            let gap = usize::from(last > 0);
            let length = word.chars().count();
            if last + gap + length <= width {
                if let Some(line) = lines.last_mut() {
                    line.push_str(if gap > 0 { " " } else { "" });
                    line.push_str(word);
                }
                break;
            }
            if length > width && last == 0 {
                let (part, rest) = word.split_at(break_of(word, width));
                lines.last_mut().into_iter().for_each(|line| line.push_str(part));
                word = rest;
            }
            lines.push(String::new());
        }
    }
    lines
}

/// The offset at which a word that is longer than a line is broken, bytes.
fn break_of(word: &str, width: usize) -> usize {
    let end = word.char_indices().nth(width).map_or(word.len(), |(offset, _)| offset);
    match word[..end].rfind(SEPARATORS) {
        // All separators are one byte long.
        Some(separator) => separator + 1,
        None => end,
    }
}

/// Appends `text`, wrapped at `width` and indented. Paragraphs stay separate.
pub(super) fn push_filled(page: &mut String, indent: usize, width: usize, text: &str) {
    for (number, paragraph) in text.split("\n\n").enumerate() {
        if number > 0 {
            page.push('\n');
        }
        for line in fill(paragraph, width.saturating_sub(indent)).iter().filter(|line| !line.is_empty()) {
            page.push_str(&format!("{:indent$}{line}\n", ""));
        }
    }
}

/// Appends a table whose columns are as wide as their widest cells. The last column is wrapped at `width`, next to the others
/// or, with too little space, below them.
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
        let mut line: String = cells.map(|(cell, width)| format!("{cell:<width$}  ")).collect();
        let mut at = before;
        if !fits_beside {
            for (number, part) in fill_cells(&line, width.saturating_sub(indent + 2)).iter().enumerate() {
                push(&format!("{:indent$}{part}", "", indent = indent + if number == 0 { 0 } else { 2 }));
            }
            (line, at) = (String::new(), indent + 4);
        }
        for part in fill(&row[N - 1], width.saturating_sub(at)) {
            push(&format!("{:start$}{line}{part}", "", start = if line.is_empty() { at } else { indent }));
            line.clear();
        }
    }
}

/// Wraps the cells before the last column, if they do not fit.
fn fill_cells(cells: &str, width: usize) -> Vec<String> {
    match cells.trim_end().chars().count() <= width {
        true => vec![cells.to_owned()],
        false => fill(cells, width),
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
        assert_eq!(fill("see gridweave_msgs/msg/Alignment", 16), ["see", "gridweave_msgs/", "msg/Alignment"]);
        assert_eq!(fill("abcdefg hi", 3), ["abc", "def", "g", "hi"]);
        assert_eq!(fill("ööööö", 2), ["öö", "öö", "ö"]);
        assert_eq!(fill("  ", 0), [""]);
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
}
