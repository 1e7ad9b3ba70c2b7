//! Plain text for a terminal.

/// The width that text is filled to.
const WIDTH: usize = 100;

/// Appends `text`, its lines filled with words and indented. Paragraphs stay apart.
pub(super) fn push_filled(page: &mut String, indent: usize, text: &str) {
    for (number, paragraph) in text.split("\n\n").enumerate() {
        if number > 0 {
            page.push('\n');
        }
        let mut line = " ".repeat(indent);
        let mut empty = true;
        for word in paragraph.split_whitespace() {
            if !empty && line.chars().count() + 1 + word.chars().count() > WIDTH {
                page.push_str(&line);
                page.push('\n');
                line = " ".repeat(indent);
                empty = true;
            }
            if !empty {
                line.push(' ');
            }
            line.push_str(word);
            empty = false;
        }
        if !empty {
            page.push_str(&line);
            page.push('\n');
        }
    }
}

/// Appends rows, each column as wide as its widest cell.
pub(super) fn push_table<const N: usize>(page: &mut String, indent: usize, rows: &[[String; N]]) {
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default();
    let widths: [usize; N] = std::array::from_fn(width);
    for row in rows {
        let mut line = " ".repeat(indent);
        for (cell, width) in row.iter().zip(widths) {
            line.push_str(&format!("{cell:<width$}  "));
        }
        page.push_str(line.trim_end());
        page.push('\n');
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_filled_and_paragraphs_stay_apart() {
        let mut page = String::new();
        push_filled(&mut page, 2, &format!("{}\n\nlast", "word ".repeat(25)));
        let lines: Vec<&str> = page.lines().collect();
        assert_eq!(lines.len(), 4);
        assert!(lines[0].len() <= WIDTH && lines[0].starts_with("  word word"));
        assert_eq!(lines[2..], ["", "  last"]);
    }

    #[test]
    fn columns_line_up() {
        let mut page = String::new();
        push_table(&mut page, 1, &[["a".into(), "b".into()], ["long".into(), String::new()]]);
        assert_eq!(page, " a     b\n long\n");
    }
}
