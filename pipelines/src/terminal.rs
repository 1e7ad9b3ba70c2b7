//! What the command prints: results to standard output, and all that is said beside them to standard error.
//!
//! Either may be closed, or may lead to a full disk. A program that has read enough of the results is no failure; results that
//! cannot be written are one, and what cannot be said is left unsaid.

use anyhow::{Context, Result};
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};

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
