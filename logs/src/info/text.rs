//! A log's description as text.

use super::LogInfo;
use std::fmt::Write;

impl LogInfo {
    /// The description as plain text for a terminal.
    pub fn to_text(&self) -> String {
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = self.write_text(&mut text);
        text
    }

    fn write_text(&self, text: &mut String) -> std::fmt::Result {
        for file in &self.files {
            let packed = match file.chunks {
                0 => "no chunks".to_owned(),
                chunks => format!("{chunks} chunks ({})", file.compression.join(", ")),
            };
            writeln!(text, "{}  {}, {packed}", file.path.display(), size(file.size))?;
        }
        let start = self.start.map(|start| format!(", from {start:.3} s")).unwrap_or_default();
        writeln!(text, "{} messages over {:.1} s{start}", self.messages, self.duration)?;

        let origin = self.start.unwrap_or(0.0);
        let cells = |topic: &super::TopicInfo| {
            [
                topic.topic.clone(),
                if topic.type_name.is_empty() { "(no schema)".into() } else { topic.type_name.clone() },
                topic.messages.to_string(),
                size(topic.bytes),
                format!("{:.1}", topic.first - origin),
                format!("{:.1}", topic.last - origin),
            ]
        };
        let header = ["Topic", "Type", "Messages", "Size", "First s", "Last s"];
        write_table(text, header, self.topics.iter().map(cells).collect())?;

        let cells = |(name, robot): (&String, &super::RobotInfo)| {
            [
                name.clone(),
                robot.maps.to_string(),
                robot.poses.to_string(),
                robot.readings.to_string(),
                robot.tags.len().to_string(),
            ]
        };
        let header = ["Robot", "Maps", "Poses", "Readings", "Tags"];
        write_table(text, header, self.robots.iter().map(cells).collect())?;

        if !self.problems.is_empty() {
            writeln!(text, "\nProblems")?;
        }
        self.problems.iter().try_for_each(|problem| writeln!(text, "  - {problem}"))
    }
}

/// A table with a line for its header; texts to the left and numbers to the right. Nothing if it has no rows.
fn write_table<const N: usize>(text: &mut String, header: [&str; N], rows: Vec<[String; N]>) -> std::fmt::Result {
    if rows.is_empty() {
        return Ok(());
    }
    let width = |cell: &str| cell.chars().count();
    let widths: [usize; N] = std::array::from_fn(|column| {
        rows.iter().map(|row| width(&row[column])).chain([width(header[column])]).max().unwrap_or(0)
    });
    let is_number: [bool; N] = std::array::from_fn(|column| {
        rows.iter().all(|row| row[column].starts_with(|c: char| c.is_ascii_digit() || c == '-'))
    });
    let header = header.map(str::to_owned);
    text.push('\n');
    for row in std::iter::once(&header).chain(&rows) {
        let mut line = String::new();
        for (column, cell) in row.iter().enumerate() {
            let gap = if column == 0 { "" } else { "  " };
            match is_number[column] {
                true => write!(line, "{gap}{cell:>width$}", width = widths[column])?,
                false => write!(line, "{gap}{cell:<width$}", width = widths[column])?,
            }
        }
        writeln!(text, "{}", line.trim_end())?;
    }
    Ok(())
}

/// A number of bytes with a fitting unit.
fn size(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        1_000_000..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}
