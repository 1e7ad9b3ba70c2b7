//! Explanations of failed connections, with what would fix them.
//!
//! Zenoh retries connections without reporting the reason. The connecting end finds it with [`connection_error`]; the
//! listening end from Zenoh's log, whose warnings a program passes to [`on_log_warning`].

use super::zenoh_session::in_words;
use std::sync::{Mutex, PoisonError};
use zenoh::{Config, Wait};

/// Parts of error texts of rustls or the system, and what would fix the error. Each applies to either end.
const FIXES: [(&str, &str); 12] = [
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
    ("InvalidContentType", "the other end does not use TLS: both must use `tls/HOST:PORT`"),
    ("on TCP link", "the other end uses another protocol: it may use `tls/HOST:PORT`"),
    ("Connection refused", "nothing listens there"),
    (
        "Connection reset",
        "the other end has closed the connection, as it does without a `certificate` that it asks for",
    ),
];

/// An error text, with what would fix it if known.
pub(super) fn explained(words: &str) -> String {
    match FIXES.iter().find(|(part, _)| words.contains(part)) {
        Some((_, fix)) => format!("{words}: {fix}"),
        None => words.to_owned(),
    }
}

/// Tries once to connect to the only endpoint of a configuration. Returns the error; none if it succeeds. Takes up to
/// Zenoh's timeout, ten seconds by default.
pub(super) fn connection_error(mut config: Config) -> Option<String> {
    // A peer, unlike a client, returns the reason as an error.
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
            // An error of closing does not matter.
            drop(session.close().wait());
            None
        }
        Err(error) => Some(explained(&in_words(&error))),
    }
}

/// The maximum number of stored refusals.
const MAX_REFUSALS: usize = 1000;
/// The module of Zenoh that accepts TLS connections, and a suffix of its warnings that is usually wrong.
const TLS_MODULE: &str = "zenoh_link_tls";
const HINT: &str = ". Hint: increase the system open file limit.";

static REFUSALS: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// Records a warning that a library has logged, if it is a refused TLS connection; `bridge_source` reports these.
pub fn on_log_warning(module: &str, words: &str) {
    if let Some(reason) = refusal(module, words) {
        let mut refusals = REFUSALS.lock().unwrap_or_else(PoisonError::into_inner);
        if refusals.len() < MAX_REFUSALS {
            refusals.push(explained(reason));
        }
    }
}

/// The reason of a refused connection, if a warning is about one.
fn refusal<'a>(module: &str, words: &'a str) -> Option<&'a str> {
    words.strip_suffix(HINT).filter(|_| module.starts_with(TLS_MODULE))
}

/// The reasons of all refused connections since the last call. All stages of a process share them.
pub(super) fn take_refusals() -> Vec<String> {
    std::mem::take(&mut *REFUSALS.lock().unwrap_or_else(PoisonError::into_inner))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_error_is_explained() {
        let text = explained("invalid peer certificate: UnknownIssuer");
        assert!(
            text.starts_with("invalid peer certificate: UnknownIssuer: ") && text.contains("`authority`"),
            "{text}"
        );
        assert_eq!(explained("something else"), "something else");
    }

    #[test]
    fn only_warnings_about_refused_connections_are_recorded() {
        let words = "peer sent no certificates. Hint: increase the system open file limit.";
        assert_eq!(refusal("zenoh_link_tls::unicast", words), Some("peer sent no certificates"));
        assert_eq!(refusal("zenoh_link_tls::unicast", "Skipping name verification of TLS server"), None);
        assert_eq!(refusal("zenoh_link_tcp::unicast", words), None);
    }
}
