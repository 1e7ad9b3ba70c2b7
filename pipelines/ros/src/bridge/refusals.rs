//! Why two programs are not connected, in words that say what would mend it.
//!
//! Zenoh tries again for as long as it takes, and hands nobody the reason. The end that connects finds it out by [`obstacle`];
//! the one that listens by what Zenoh writes to the log, which a program hands to [`hear`].

use crate::connection::in_words;
use std::sync::{Mutex, PoisonError};
use zenoh::{Config, Wait};

/// What is known of the words of an error, of rustls or the system, and what would mend it. Each holds for either end.
const MENDS: [(&str, &str); 12] = [
    ("UnknownIssuer", "the certificate of the other end is not signed by the `authority` that is named here"),
    ("not valid for name", "connect by a name that the certificate has, or make a certificate with this name"),
    ("certificate expired", "make another certificate, or set the clock right"),
    ("not valid yet", "set the clock of this machine right"),
    (
        "sent no certificates",
        "the other end must have a `certificate` and its `key`, signed by the `authority` of this one",
    ),
    ("alert: CertificateRequired", "the other end asks for a `certificate`, with its `key`, signed by its `authority`"),
    (
        "alert: UnknownCA",
        "the other end does not know who has signed this one's `certificate`: it must be its `authority`",
    ),
    (
        "alert: BadCertificate",
        "the other end does not take this one's `certificate`: it must have the name by which the other end connects",
    ),
    ("InvalidContentType", "the other end does not speak TLS: both must name `tls/HOST:PORT`"),
    ("on TCP link", "the other end does not speak as this one does: it may be that it names `tls/HOST:PORT`"),
    ("Connection refused", "nothing listens there"),
    (
        "Connection reset",
        "the other end has closed the connection, as it does without a `certificate` that it asks for",
    ),
];

/// The words, and what would mend it.
pub(super) fn explained(words: &str) -> String {
    match MENDS.iter().find(|(part, _)| words.contains(part)) {
        Some((_, mend)) => format!("{words}: {mend}"),
        None => words.to_owned(),
    }
}

/// Tries once to connect as the configuration says, which must name one endpoint. Gives why that cannot be; none if it can. Takes
/// as long as Zenoh waits for an answer, ten seconds unless it is told otherwise.
pub(super) fn obstacle(mut config: Config) -> Option<String> {
    // As a peer, which gives the reason as an error, once.
    let once = [
        ("mode", "\"peer\""),
        ("listen/endpoints", "[]"),
        ("scouting/multicast/enabled", "false"),
        ("connect/timeout_ms", "0"),
        ("connect/exit_on_failure", "true"),
    ];
    for (key, value) in once {
        if let Err(error) = config.insert_json5(key, value) {
            return Some(format!("{key}: {error}"));
        }
    }
    match zenoh::open(config).wait() {
        Ok(session) => {
            // What goes wrong here changes nothing in the answer.
            drop(session.close().wait());
            None
        }
        Err(error) => Some(explained(&in_words(&error))),
    }
}

/// No more than so many wait to be told.
const MOST: usize = 1000;
/// The part of Zenoh that lets in who connects by TLS, and what it says behind the reason, which is seldom right.
const DOORKEEPER: &str = "zenoh_link_tls";
const HINT: &str = ". Hint: increase the system open file limit.";

static HEARD: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Hears what a module of a library warns of. Of what Zenoh says, `bridge_source` tells whom it has not let in, and why.
pub fn hear(module: &str, words: &str) {
    if let Some(reason) = refusal(module, words) {
        let mut heard = HEARD.lock().unwrap_or_else(PoisonError::into_inner);
        if heard.len() < MOST {
            heard.push(explained(reason));
        }
    }
}

/// Why somebody was not let in, if that is what the words say.
fn refusal<'a>(module: &str, words: &'a str) -> Option<&'a str> {
    words.strip_suffix(HINT).filter(|_| module.starts_with(DOORKEEPER))
}

/// Why somebody was not let in, for each time since this was asked last. All stages of a process have it in common.
pub(super) fn take_heard() -> Vec<String> {
    std::mem::take(&mut *HEARD.lock().unwrap_or_else(PoisonError::into_inner))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_told_with_what_would_mend_it() {
        let told = explained("invalid peer certificate: UnknownIssuer");
        assert!(
            told.starts_with("invalid peer certificate: UnknownIssuer: ") && told.contains("`authority`"),
            "{told}"
        );
        assert_eq!(explained("something else"), "something else");
    }

    #[test]
    fn of_all_that_is_warned_of_refusals_alone_are_heard() {
        let words = "peer sent no certificates. Hint: increase the system open file limit.";
        assert_eq!(refusal("zenoh_link_tls::unicast", words), Some("peer sent no certificates"));
        assert_eq!(refusal("zenoh_link_tls::unicast", "Skipping name verification of TLS server"), None);
        assert_eq!(refusal("zenoh_link_tcp::unicast", words), None);
    }
}
