//! Discovery: the liveliness tokens of the two ends of a bridge, and of programs that tap links of a sender's run.
//!
//! The key of a token is `gridweave/bridge/BRIDGE/ROLE/NAME/NUMBER`. Zenoh withdraws it when the program ends, and when
//! the connection was silent for ten seconds.

use super::zenoh_session::in_words;
use gridweave_runtime::stage::StageError;
use zenoh::liveliness::LivelinessToken;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// The role of a program on a bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Sender,
    Receiver,
    /// A program that taps a link of a sender's run.
    Tapper,
}

impl Role {
    fn word(self) -> &'static str {
        match self {
            Self::Sender => "sender",
            Self::Receiver => "receiver",
            Self::Tapper => "tapper",
        }
    }
}

/// An end of a bridge, as announced by its token.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Presence {
    /// Its name.
    pub(super) name: String,
    /// Its number, which distinguishes ends with the same name.
    pub(super) number: u64,
}

impl Presence {
    /// The number of an end, derived from the unique id of its session.
    pub(super) fn number_of(session: &Session) -> u64 {
        let bytes = session.zid().to_le_bytes();
        // 0 is none.
        bytes.first_chunk().map_or(1, |bytes| u64::from_le_bytes(*bytes)).max(1)
    }

    /// The key expression of its token.
    pub(super) fn key(&self, bridge: &str, role: Role) -> String {
        format!("gridweave/bridge/{bridge}/{}/{}/{:016x}", role.word(), self.name, self.number)
    }

    fn of_key(key: &str) -> Option<Self> {
        let mut parts = key.rsplit('/');
        let number = u64::from_str_radix(parts.next()?, 16).ok()?;
        Some(Self { name: parts.next()?.to_owned(), number })
    }

    /// Announces it until the token is dropped.
    ///
    /// # Errors
    /// The session has failed.
    pub(super) fn declare(&self, session: &Session, bridge: &str, role: Role) -> Result<LivelinessToken, StageError> {
        let token = session.liveliness().declare_token(self.key(bridge, role)).wait();
        token
            .map_err(|error| StageError::new(format!("announce the {} `{}`", role.word(), self.name), in_words(&error)))
    }
}

/// Calls `call` with every present and future end of a bridge with the role, and again when it disappears.
///
/// # Errors
/// The session has failed.
pub(super) fn watch(
    session: &Session,
    bridge: &str,
    role: Role,
    call: impl Fn(Presence, bool) + Send + Sync + 'static,
) -> Result<(), StageError> {
    let callback = move |sample: Sample| {
        if let Some(end) = Presence::of_key(sample.key_expr().as_str()) {
            call(end, sample.kind() == SampleKind::Put);
        }
    };
    let keys = format!("gridweave/bridge/{bridge}/{}/*/*", role.word());
    let watched = session.liveliness().declare_subscriber(keys).history(true).callback(callback).background().wait();
    watched.map_err(|error| StageError::new(format!("watch for a {} of the bridge", role.word()), in_words(&error)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_is_read_back_from_its_key() {
        let end = Presence { name: "robot-1.local".into(), number: 0xabc };
        let key = end.key("floor_2", Role::Sender);
        assert_eq!(key, "gridweave/bridge/floor_2/sender/robot-1.local/0000000000000abc");
        assert_eq!(Presence::of_key(&key), Some(end));
        assert_eq!(Presence::of_key("gridweave/bridge/x"), None);
    }
}
