//! Where the columns of a table stand, so that its lines are no longer than they may be.

use super::{Table, is_numeric};
use gridweave_runtime::pipeline::fill;

/// Between two columns, and before the first.
const GAP: usize = 2;
/// Before the columns that stand below the others.
const INDENT: usize = 6;
/// A text that is broken within its column has at least so much room; and no longer texts are broken.
const LEAST_TEXT: usize = 24;

/// Where the columns of a table stand.
pub(super) struct Layout {
    /// The lines that every row has.
    lines: Vec<Vec<Column>>,
}

/// A column on its line.
struct Column {
    index: usize,
    /// How many characters stand before it.
    start: usize,
    width: usize,
    is_number: bool,
}

impl Layout {
    /// Lays out a table in lines of at most `most` characters: each column on the line of the one before it, if there is room.
    pub(super) fn new(table: &Table, most: usize) -> Self {
        let columns = table.rows.iter().map(Vec::len).max().unwrap_or(0);
        let cells = |column: usize| table.rows.iter().map(move |row| cell(row, column));
        let mut lines = vec![Vec::new()];
        let mut start = GAP;
        for index in 0..columns {
            let widest = cells(index).map(|cell| cell.chars().count()).max().unwrap_or(0);
            let is_number = cells(index).skip(1).all(is_numeric);
            let is_text = widest > LEAST_TEXT && cells(index).skip(1).any(|cell| cell.contains(' '));
            let room = most.saturating_sub(start);
            let width = match widest <= room || is_text && room >= LEAST_TEXT {
                true => widest.min(room),
                false => {
                    start = if lines.iter().all(Vec::is_empty) { GAP } else { INDENT };
                    lines.push(Vec::new());
                    widest.min(most.saturating_sub(start))
                }
            };
            lines.last_mut().into_iter().for_each(|line| line.push(Column { index, start, width, is_number }));
            start = start.saturating_add(width + GAP);
        }
        lines.retain(|line| !line.is_empty());
        Self { lines }
    }

    /// A row as lines, each with its end.
    pub(super) fn row(&self, row: &[String]) -> String {
        let mut text = String::new();
        for (number, line) in self.lines.iter().enumerate() {
            let parts: Vec<Vec<String>> = line.iter().map(|column| column.parts(cell(row, column.index))).collect();
            let height = parts.iter().map(Vec::len).max().unwrap_or(0);
            for place in 0..height {
                let mut drawn = String::new();
                let mut at = 0;
                for (column, parts) in line.iter().zip(&parts) {
                    let (part, width) = (parts.get(place).map_or("", String::as_str), column.width);
                    drawn.push_str(&" ".repeat(column.start - at));
                    drawn.push_str(&match column.is_number {
                        true => format!("{part:>width$}"),
                        false => format!("{part:<width$}"),
                    });
                    at = column.start + width;
                }
                // What has nothing to say below the others takes no line.
                if number == 0 || !drawn.trim().is_empty() {
                    text.push_str(drawn.trim_end());
                    text.push('\n');
                }
            }
        }
        text
    }
}

impl Column {
    /// A cell as the lines that it has in this column.
    fn parts(&self, cell: &str) -> Vec<String> {
        match cell.chars().count() <= self.width {
            true => vec![cell.to_owned()],
            false => fill(cell, self.width),
        }
    }
}

fn cell(row: &[String], column: usize) -> &str {
    row.get(column).map_or("", String::as_str)
}
