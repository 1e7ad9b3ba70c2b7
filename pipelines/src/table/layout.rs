//! Positions of the columns of a table within lines of a limited width.

use super::{Table, is_numeric};
use crate::text_wrapping::wrap_words;
use textwrap::core::display_width;

/// Before the first column and between two.
const GAP: usize = 2;
/// Before the columns that stand below the others.
const INDENT: usize = 6;
/// Only texts longer than this are wrapped within their column, which is at least so wide.
const MIN_TEXT_WIDTH: usize = 24;

/// Positions of the columns of a table.
pub(super) struct Layout {
    /// The lines of each row.
    lines: Vec<Vec<Column>>,
}

/// A column on its line. Widths are in columns of the terminal.
struct Column {
    index: usize,
    start: usize,
    width: usize,
    is_number: bool,
}

impl Layout {
    /// Lays out a table in lines of at most `max_width`: each column on the line of the one before it, if there is
    /// room.
    pub(super) fn new(table: &Table, max_width: usize) -> Self {
        let columns = table.rows.iter().map(Vec::len).max().unwrap_or(0);
        let cells = |column: usize| table.rows.iter().map(move |row| cell(row, column));
        let mut lines = vec![Vec::new()];
        let mut start = GAP;
        for index in 0..columns {
            let widest = cells(index).map(display_width).max().unwrap_or(0);
            let is_number = cells(index).skip(1).all(is_numeric);
            let is_text = widest > MIN_TEXT_WIDTH && cells(index).skip(1).any(|cell| cell.contains(' '));
            let room = max_width.saturating_sub(start);
            let width = match widest <= room || is_text && room >= MIN_TEXT_WIDTH {
                true => widest.min(room),
                false => {
                    start = if lines.iter().all(Vec::is_empty) { GAP } else { INDENT };
                    lines.push(Vec::new());
                    widest.min(max_width.saturating_sub(start))
                }
            };
            lines.last_mut().into_iter().for_each(|line| line.push(Column { index, start, width, is_number }));
            start = start.saturating_add(width + GAP);
        }
        lines.retain(|line| !line.is_empty());
        Self { lines }
    }

    /// Formats a row; each of its lines ends with a line end.
    pub(super) fn row(&self, row: &[String]) -> String {
        let mut text = String::new();
        for (number, line) in self.lines.iter().enumerate() {
            let parts: Vec<Vec<String>> = line.iter().map(|column| column.parts(cell(row, column.index))).collect();
            let height = parts.iter().map(Vec::len).max().unwrap_or(0);
            for part in 0..height {
                let mut formatted = String::new();
                let mut end = 0;
                for (column, parts) in line.iter().zip(&parts) {
                    let part = parts.get(part).map_or("", String::as_str);
                    let padding = " ".repeat(column.width.saturating_sub(display_width(part)));
                    let (before, after) =
                        if column.is_number { (padding.as_str(), "") } else { ("", padding.as_str()) };
                    formatted.push_str(&" ".repeat(column.start - end));
                    formatted.extend([before, part, after]);
                    end = column.start + column.width;
                }
                // A line below the others with only empty cells is left out.
                if number == 0 || !formatted.trim().is_empty() {
                    text.push_str(formatted.trim_end());
                    text.push('\n');
                }
            }
        }
        text
    }
}

impl Column {
    /// Lines of a cell within this column.
    fn parts(&self, cell: &str) -> Vec<String> {
        match display_width(cell) <= self.width {
            // A line end within a name would look like another row.
            true => vec![cell.replace('\n', "\\u000a")],
            false => wrap_words(cell, self.width),
        }
    }
}

fn cell(row: &[String], column: usize) -> &str {
    row.get(column).map_or("", String::as_str)
}
