//! Tables in plain text.
//!
//! `comfy-table` does not fit: it would break type and topic names within narrow columns, where here columns that do
//! not fit stand below the others, and it gives no lines by row, between which reasons are printed.

mod layout;

use crate::terminal;
use layout::Layout;
use textwrap::core::display_width;

/// A table whose columns of numbers, with or without units, are aligned to the right and all others to the left.
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// Creates a table with the given column heads.
    pub fn new<'a>(heads: impl IntoIterator<Item = &'a str>) -> Self {
        Self { rows: vec![heads.into_iter().map(str::to_owned).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// Formats the table in Markdown. Names cannot end a cell or a row, nor put HTML into the page.
    pub fn to_markdown(&self) -> String {
        let line = |row: &Vec<String>| {
            let cells: Vec<String> = row.iter().map(|cell| markdown_cell(cell)).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let rule = |row: &Vec<String>| format!("|{}\n", " --- |".repeat(row.len()));
        let (heads, rows) = self.rows.split_at(1);
        heads.iter().map(|row| line(row) + &rule(row)).chain(rows.iter().map(line)).collect()
    }

    /// Formats the table as comma-separated values (RFC 4180). Texts that a spreadsheet would run as a formula begin
    /// with an apostrophe.
    pub fn to_csv(&self) -> String {
        let quoted = |cell: &String| {
            let is_formula =
                cell.len() > 1 && cell.starts_with(['=', '+', '-', '@', '\t', '\r']) && cell.parse::<f64>().is_err();
            let cell = if is_formula { format!("'{cell}") } else { cell.clone() };
            match cell.contains([',', '"', '\n', '\r']) {
                true => format!("\"{}\"", cell.replace('"', "\"\"")),
                false => cell,
            }
        };
        self.rows.iter().map(|row| row.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n").collect()
    }

    /// Formats the table in lines of at most `width` columns of the terminal, or of any width if there is none. Texts
    /// are wrapped within their columns; columns that do not fit beside the others stand below them, indented.
    pub fn fit(&self, width: Option<usize>) -> String {
        self.fit_rows(width).concat()
    }

    /// Formats each row as [`fit`](Self::fit) does; the first are the heads.
    pub fn fit_rows(&self, width: Option<usize>) -> Vec<String> {
        let layout = Layout::new(self, width.unwrap_or(usize::MAX));
        self.rows.iter().map(|row| layout.row(row)).collect()
    }

    /// Formats the table for the terminal on standard output; `None` if that is no terminal.
    pub fn to_terminal(&self) -> Option<String> {
        terminal::width().map(|width| self.fit(Some(width)))
    }

    /// Removes columns with these heads, in their order, until the table is no wider than `width`.
    pub fn narrow_to(&mut self, width: usize, heads: &[&str]) {
        for head in heads {
            if self.fit(None).lines().all(|line| display_width(line) <= width) {
                return;
            }
            if let Some(column) = self.rows[0].iter().position(|own| own == head) {
                self.rows.iter_mut().filter(|row| column < row.len()).for_each(|row| drop(row.remove(column)));
            }
        }
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.fit(None))
    }
}

/// A text as the cell of a table in Markdown.
fn markdown_cell(text: &str) -> String {
    let mut cell = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '|' | '\\' => cell.extend(['\\', letter]),
            '<' => cell.push_str("&lt;"),
            '&' => cell.push_str("&amp;"),
            _ if letter.is_control() => cell.push(' '),
            _ => cell.push(letter),
        }
    }
    cell
}

/// Whether a cell is empty, a dash, or a number with at most a unit behind it.
fn is_numeric(text: &str) -> bool {
    let mut words = text.split_whitespace();
    let is_number = |word: &str| word.chars().all(|c| c.is_ascii_digit() || "+-.,%".contains(c));
    words.next().is_none_or(is_number) && words.count() <= 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_right_and_texts_left() {
        let mut table = Table::new(["robot", "x", "why"]);
        table.row(["robot1".into(), "0.1".into(), "a".into()]);
        table.row(["r".into(), "-10.1".into(), "bcd".into()]);
        assert_eq!(table.to_string(), "  robot       x  why\n  robot1    0.1  a\n  r       -10.1  bcd\n");
    }

    fn topics() -> Table {
        let mut table = Table::new(["topic", "type", "messages", "Hz", "frame"]);
        table.row(["/robot1/map", "nav_msgs/msg/OccupancyGrid", "12", "0.5", "robot1/map"].map(str::to_owned));
        table.row(["/tf", "tf2_msgs/msg/TFMessage", "1200", "50.0", "robot1/odom robot1/map"].map(str::to_owned));
        table
    }

    #[test]
    fn columns_that_do_not_fit_stand_below_the_others() {
        let expected = concat!(
            "  topic        type                        messages    Hz\n",
            "      frame\n",
            "  /robot1/map  nav_msgs/msg/OccupancyGrid        12   0.5\n",
            "      robot1/map\n",
            "  /tf          tf2_msgs/msg/TFMessage          1200  50.0\n",
            "      robot1/odom robot1/map\n",
        );
        assert_eq!(topics().fit(Some(60)), expected);
        assert_eq!(topics().fit(Some(200)), topics().to_string());
    }

    #[test]
    fn no_line_is_wider_than_the_width_and_no_word_is_lost() {
        let mut table = topics();
        table.row(["/a".into(), "t".repeat(70), "1".into(), String::new(), "a long sentence ".repeat(20)]);
        let letters = |text: &str| text.chars().filter(|c| !c.is_whitespace()).count();
        for width in 40..160 {
            let text = table.fit(Some(width));
            assert!(text.lines().all(|line| line.chars().count() <= width), "{width}\n{text}");
            assert_eq!(letters(&text), letters(&table.to_string()), "{width}\n{text}");
        }
    }

    #[test]
    fn a_sentence_is_wrapped_within_its_column() {
        let mut table = Table::new(["robot", "error m", "why"]);
        table.row([
            "robot2".into(),
            "0.1".into(),
            "the maps fit at several places and none is better than others".into(),
        ]);
        let expected = concat!(
            "  robot   error m  why\n",
            "  robot2      0.1  the maps fit at several places\n",
            "                   and none is better than others\n",
        );
        assert_eq!(table.fit(Some(50)), expected);
    }

    #[test]
    fn a_table_that_is_too_wide_loses_the_columns_that_are_named_first() {
        let mut table = topics();
        table.narrow_to(51, &["frame", "Hz", "type"]);
        assert_eq!(table.to_string().lines().next(), Some("  topic        type                        messages"));
    }

    #[test]
    fn wide_characters_are_aligned() {
        let mut table = Table::new(["robot", "x", "why"]);
        table.row(["地図".into(), "1".into(), "a".into()]);
        table.row(["robot1".into(), "10".into(), "b".into()]);
        assert_eq!(table.to_string(), "  robot    x  why\n  地図     1  a\n  robot1  10  b\n");
    }

    #[test]
    fn a_line_end_within_a_cell_does_not_look_like_another_row() {
        let mut table = Table::new(["robot", "x"]);
        table.row(["a\nb".into(), "1".into()]);
        assert_eq!(table.to_string().lines().count(), 2);
        assert!(table.to_string().contains("a\\u000ab"));
    }

    #[test]
    fn markdown_and_csv_hold_the_same_cells() {
        let mut table = Table::new(["robot", "why"]);
        table.row(["r1".into(), "a|b, \"c\"".into()]);
        assert_eq!(table.to_markdown(), "| robot | why |\n| --- | --- |\n| r1 | a\\|b, \"c\" |\n");
        assert_eq!(table.to_csv(), "robot,why\nr1,\"a|b, \"\"c\"\"\"\n");
    }

    #[test]
    fn a_name_is_neither_html_nor_a_row_nor_a_formula() {
        let mut table = Table::new(["robot", "x"]);
        table.row(["<img src=x>\n\\|".into(), "-1.5".into()]);
        table.row(["=1+1".into(), "-".into()]);
        let rows = "| &lt;img src=x> \\\\\\| | -1.5 |\n| =1+1 | - |\n";
        assert_eq!(table.to_markdown(), format!("| robot | x |\n| --- | --- |\n{rows}"));
        assert_eq!(table.to_csv(), "robot,x\n\"<img src=x>\n\\|\",-1.5\n'=1+1,-\n");
    }

    #[test]
    fn a_number_may_have_a_unit_and_a_sentence_may_begin_with_a_number() {
        for number in ["", "-", "3", "-0.5", "12 %", "1.2 kB"] {
            assert!(is_numeric(number), "{number}");
        }
        for text in ["robot1", "3 tags agree", "x"] {
            assert!(!is_numeric(text), "{text}");
        }
    }
}
