//! Printing of results to standard output and of messages to standard error, and the width of the terminal.
//!
//! All that is printed goes through here, where characters that a terminal obeys are escaped: names in logs may have
//! them.
//!
//! Either may be closed, or may lead to a full disk. A reader of the results that has closed its end is no failure;
//! results that cannot be written are one; messages that cannot be written are dropped.

use anyhow::{Context, Result};
use gridweave_runtime::pipeline::TEXT_WIDTH;
use gridweave_runtime::terminal_text::{escape, escape_all_but_styles};
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

/// Lines are not wrapped narrower than this, columns.
const MIN_WIDTH: usize = 40;
/// Moves the cursor of a terminal to its first line, and clears it.
const CLEAR: &str = "\x1b[H\x1b[J";

/// Prints a result without a line end. Returns whether the reader is still there.
///
/// # Errors
/// The result cannot be written, for another reason than a closed pipe.
pub(crate) fn print(text: impl Display) -> Result<bool> {
    write_to(&mut io::stdout().lock(), "", text)
}

/// Prints a result in the place of all that the terminal shows, as [`print`] does.
pub(crate) fn print_on_cleared_terminal(text: impl Display) -> Result<bool> {
    write_to(&mut io::stdout().lock(), CLEAR, text)
}

/// Prints a result and a line end, as [`print`] does.
pub(crate) fn print_line(text: impl Display) -> Result<bool> {
    print(format_args!("{text}\n"))
}

/// Prints a line to standard error.
pub(crate) fn eprint_line(text: impl Display) {
    // There is no other place to report this error to.
    let _ = writeln!(io::stderr(), "{}", escape(&text.to_string()));
}

/// Prints a line with colours and styles to standard error.
pub(crate) fn eprint_styled_line(text: impl Display) {
    let _ = writeln!(io::stderr(), "{}", escape_all_but_styles(&text.to_string()));
}

/// The greatest width of a line of the results, columns: `COLUMNS` or else the width of the terminal. `None` for a pipe
/// or a file, so that programs read whole lines.
pub(crate) fn width() -> Option<usize> {
    let given = std::env::var("COLUMNS").ok().and_then(|columns| columns.trim().parse().ok());
    let measured = || terminal_size::terminal_size_of(io::stdout()).map(|(width, _)| usize::from(width.0));
    given.or_else(measured).filter(|width| *width > 0).map(|width: usize| width.max(MIN_WIDTH))
}

/// The width that paragraphs are wrapped to, columns.
pub(crate) fn text_width() -> usize {
    width().unwrap_or(TEXT_WIDTH).min(TEXT_WIDTH)
}

fn write_to(output: &mut impl Write, before: &str, text: impl Display) -> Result<bool> {
    match write!(output, "{before}{}", escape(&text.to_string())).and_then(|()| output.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(false),
        written => written.map(|()| true).context("cannot write to standard output"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Failing(ErrorKind);

    impl Write for Failing {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn what_a_terminal_obeys_is_escaped() {
        let mut output = Vec::new();
        write_to(&mut output, CLEAR, "robot\u{1b}[2J\u{7}\n").unwrap();
        assert_eq!(output, b"\x1b[H\x1b[Jrobot\\u001b[2J\\u0007\n");
    }

    #[test]
    fn a_closed_pipe_is_no_failure_and_a_full_disk_is_one() {
        assert!(write_to(&mut Vec::new(), "", "a").unwrap());
        assert!(!write_to(&mut Failing(ErrorKind::BrokenPipe), "", "a").unwrap());
        assert!(write_to(&mut Failing(ErrorKind::StorageFull), "", "a").is_err());
    }
}
