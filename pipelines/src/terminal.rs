//! What the command prints: results to standard output, and all that is said beside them to standard error.
//!
//! Either may be closed, or may lead to a full disk. A program that has read enough of the results is no failure; results that
//! cannot be written are one, and what cannot be said is left unsaid.

use anyhow::{Context, Result};
use gridweave_runtime::pipeline::TEXT_WIDTH;
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

/// On a narrower terminal lines are broken as on one of this width.
const LEAST_WIDTH: usize = 40;

/// Prints a result, without a line end behind it. Gives whether anybody reads on.
///
/// # Errors
/// It cannot be written, for another reason than that nobody reads it.
pub(crate) fn print(text: impl Display) -> Result<bool> {
    write_to(&mut io::stdout().lock(), text)
}

/// The same, and a line end.
pub(crate) fn print_line(text: impl Display) -> Result<bool> {
    print(format_args!("{text}\n"))
}

/// Says a line on standard error.
pub(crate) fn say(text: impl Display) {
    // There is nobody else to be told.
    let _ = writeln!(io::stderr(), "{text}");
}

/// How many characters a line of the results may have: what `COLUMNS` says or, on a terminal, its width. None where nobody says:
/// programs that read on get their lines whole.
pub(crate) fn width() -> Option<usize> {
    let said = std::env::var("COLUMNS").ok().and_then(|columns| columns.trim().parse().ok());
    let measured = || terminal_size::terminal_size_of(io::stdout()).map(|(width, _)| usize::from(width.0));
    said.or_else(measured).filter(|width| *width > 0).map(|width: usize| width.max(LEAST_WIDTH))
}

/// The width that prose is filled to.
pub(crate) fn text_width() -> usize {
    width().unwrap_or(TEXT_WIDTH).min(TEXT_WIDTH)
}

fn write_to(output: &mut impl Write, text: impl Display) -> Result<bool> {
    match write!(output, "{text}").and_then(|()| output.flush()) {
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
    fn a_reader_that_has_gone_is_no_failure_and_a_full_disk_is_one() {
        assert!(write_to(&mut Vec::new(), "a").unwrap());
        assert!(!write_to(&mut Failing(ErrorKind::BrokenPipe), "a").unwrap());
        assert!(write_to(&mut Failing(ErrorKind::StorageFull), "a").is_err());
    }
}
