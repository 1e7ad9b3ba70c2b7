//! Tables in plain text.

use std::fmt::Write;

/// Lines up columns: those of numbers, with their units or without, to the right, all others to the left.
pub struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with the given heads.
    pub fn new<'a>(heads: impl IntoIterator<Item = &'a str>) -> Self {
        Self { rows: vec![heads.into_iter().map(str::to_owned).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }
}

impl Table {
    /// The table in Markdown.
    pub fn to_markdown(&self) -> String {
        let line = |row: &Vec<String>| {
            let cells: Vec<String> = row.iter().map(|cell| cell.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let rule = |row: &Vec<String>| format!("|{}\n", " --- |".repeat(row.len()));
        let (heads, rows) = self.rows.split_at(1);
        heads.iter().map(|row| line(row) + &rule(row)).chain(rows.iter().map(line)).collect()
    }

    /// The table as comma-separated values (RFC 4180).
    pub fn to_csv(&self) -> String {
        let quoted = |cell: &String| match cell.contains([',', '"', '\n', '\r']) {
            true => format!("\"{}\"", cell.replace('"', "\"\"")),
            false => cell.clone(),
        };
        self.rows.iter().map(|row| row.iter().map(quoted).collect::<Vec<_>>().join(",") + "\n").collect()
    }
}

impl std::fmt::Display for Table {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let cell = |row: &Vec<String>, column: usize| row.get(column).map_or("", String::as_str).to_owned();
        let widths: Vec<usize> = (0..columns)
            .map(|column| self.rows.iter().map(|row| cell(row, column).chars().count()).max().unwrap_or(0))
            .collect();
        let is_number: Vec<bool> =
            (0..columns).map(|column| self.rows[1..].iter().all(|row| is_numeric(&cell(row, column)))).collect();
        for row in &self.rows {
            let mut line = String::new();
            for (column, &width) in widths.iter().enumerate() {
                let text = cell(row, column);
                match is_number[column] {
                    true => write!(line, "  {text:>width$}")?,
                    false => write!(line, "  {text:<width$}")?,
                }
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
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
    fn numbers_stand_to_the_right_and_text_to_the_left() {
        let mut table = Table::new(["robot", "x", "why"]);
        table.row(["robot1".into(), "0.1".into(), "a".into()]);
        table.row(["r".into(), "-10.1".into(), "bcd".into()]);
        assert_eq!(table.to_string(), "  robot       x  why\n  robot1    0.1  a\n  r       -10.1  bcd\n");
    }

    #[test]
    fn markdown_and_csv_hold_the_same_cells() {
        let mut table = Table::new(["robot", "why"]);
        table.row(["r1".into(), "a|b, \"c\"".into()]);
        assert_eq!(table.to_markdown(), "| robot | why |\n| --- | --- |\n| r1 | a\\|b, \"c\" |\n");
        assert_eq!(table.to_csv(), "robot,why\nr1,\"a|b, \"\"c\"\"\"\n");
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
