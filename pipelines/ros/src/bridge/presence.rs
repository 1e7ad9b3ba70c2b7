//! Who is there: the liveliness tokens of the two ends of a bridge, and of those who tap links of a sender's run.
//!
//! A token stands under `gridweave/bridge/BRIDGE/ROLE/NAME/NUMBER`. Zenoh withdraws it when the program ends, and when nothing
//! was heard of it for ten seconds.

use crate::connection::in_words;
use gridweave_runtime::stage::StageError;
use zenoh::liveliness::LivelinessToken;
use zenoh::sample::{Sample, SampleKind};
use zenoh::{Session, Wait};

/// Which end of a bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Sender,
    Receiver,
    /// Looks on at a link of a sender's run.
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

/// One end of a bridge.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Presence {
    /// What to call it.
    pub(super) name: String,
    /// Tells it apart from those of its name.
    pub(super) number: u64,
}

impl Presence {
    /// The number of an end in a session of its own. No two sessions have the same.
    pub(super) fn number_of(session: &Session) -> u64 {
        let bytes = session.zid().to_le_bytes();
        // 0 is none.
        bytes.first_chunk().map_or(1, |bytes| u64::from_le_bytes(*bytes)).max(1)
    }

    /// Where it is found.
    pub(super) fn key(&self, bridge: &str, role: Role) -> String {
        format!("gridweave/bridge/{bridge}/{}/{}/{:016x}", role.word(), self.name, self.number)
    }

    fn of_key(key: &str) -> Option<Self> {
        let mut parts = key.rsplit('/');
        let number = u64::from_str_radix(parts.next()?, 16).ok()?;
        Some(Self { name: parts.next()?.to_owned(), number })
    }

    /// Tells that it is there, for as long as the token is held.
    ///
    /// # Errors
    /// The session has failed.
    pub(super) fn declare(&self, session: &Session, bridge: &str, role: Role) -> Result<LivelinessToken, StageError> {
        let token = session.liveliness().declare_token(self.key(bridge, role)).wait();
        token.map_err(|error| StageError::new(format!("tell of the {} `{}`", role.word(), self.name), in_words(&error)))
    }
}

/// Calls for every end of a bridge that has the role, and again when it goes.
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
    fn an_end_is_known_by_its_key() {
        let end = Presence { name: "robot-1.local".into(), number: 0xabc };
        let key = end.key("floor_2", Role::Sender);
        assert_eq!(key, "gridweave/bridge/floor_2/sender/robot-1.local/0000000000000abc");
        assert_eq!(Presence::of_key(&key), Some(end));
        assert_eq!(Presence::of_key("gridweave/bridge/x"), None);
    }
}
