//! Limits for the texts of warnings that hold what a sender has written.

use std::collections::BTreeSet;

/// The maximum number of different texts.
const MAX_TEXTS: usize = 1000;
/// The maximum length of a text, characters.
const MAX_LENGTH: usize = 500;
/// The text of all others.
const OTHERS: &str = "there are too many different warnings about senders: the others are only counted";

/// The texts of warnings so far. A run keeps each different text, so that forged names and topics could fill the memory.
#[derive(Debug, Default)]
pub(super) struct WarningTexts(BTreeSet<String>);

impl WarningTexts {
    /// The text to warn with instead of `text`: its beginning, or a common one if there are too many different ones.
    pub(super) fn limited(&mut self, text: &str) -> String {
        let short = match text.char_indices().nth(MAX_LENGTH) {
            Some((end, _)) => format!("{}…", &text[..end]),
            None => text.to_owned(),
        };
        if !self.0.contains(&short) {
            if self.0.len() >= MAX_TEXTS {
                return OTHERS.to_owned();
            }
            self.0.insert(short.clone());
        }
        short
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_limited_in_length_and_number_and_those_that_were_there_stay() {
        let mut texts = WarningTexts::default();
        assert_eq!(texts.limited("a short one"), "a short one");
        let long = texts.limited(&"ö".repeat(10_000));
        assert_eq!(long, format!("{}…", "ö".repeat(MAX_LENGTH)));
        let kept = (0..5000).filter(|number| texts.limited(&format!("robot{number}")) != OTHERS).count();
        assert_eq!(kept, MAX_TEXTS - 2);
        assert_eq!(texts.limited("a short one"), "a short one");
        assert_eq!(texts.limited("another"), OTHERS);
    }
}
