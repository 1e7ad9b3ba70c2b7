//! Dispose and unregister messages of participants and endpoints (RTPS 2.3, 9.6.3.9): a key, and a status in the inline
//! parameters.

use super::cursor::Cursor;
use super::guid::{EntityId, Guid, Prefix};
use super::parameters::{self as id, ParameterList, read};

/// Disposed of, and unregistered.
const GONE: u32 = 3;

/// The inline parameters and the key that dispose of an endpoint.
pub(crate) fn of_endpoint(guid: Guid) -> [Vec<u8>; 2] {
    sample(id::ENDPOINT_GUID, guid)
}

/// The same of a participant.
pub(crate) fn of_participant(prefix: Prefix) -> [Vec<u8>; 2] {
    sample(id::PARTICIPANT_GUID, Guid { prefix, entity: EntityId::PARTICIPANT })
}

fn sample(key: u16, guid: Guid) -> [Vec<u8>; 2] {
    let inline = ParameterList::inline()
        .with(id::KEY_HASH, &guid.to_bytes())
        // This one is big-endian in any case.
        .with(id::STATUS_INFO, &GONE.to_be_bytes());
    [inline.into_bytes(), ParameterList::sample().with(key, &guid.to_bytes()).into_bytes()]
}

/// The participant or endpoint that a sample disposes of, if it does, by its inline parameters and its key.
pub(crate) fn subject(inline: &[u8], is_little: bool, payload: &[u8]) -> Option<Guid> {
    let mut guid = None;
    let mut is_gone = false;
    for (parameter, value) in read(inline, is_little) {
        match parameter {
            id::KEY_HASH => guid = Guid::from_bytes(value.rest()),
            id::STATUS_INFO => is_gone = Cursor::new(value.rest(), false).u32()? & GONE != 0,
            _ => {}
        }
    }
    let of_key = || {
        let is_key = |parameter: &u16| [id::ENDPOINT_GUID, id::PARTICIPANT_GUID].contains(parameter);
        let parameters = id::of_sample(payload)?;
        parameters
            .into_iter()
            .find(|(parameter, _)| is_key(parameter))
            .and_then(|(_, value)| Guid::from_bytes(value.rest()))
    };
    if is_gone { guid.or_else(of_key) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disposed_endpoint_is_read_back() {
        let guid = Guid { prefix: Prefix([4; 12]), entity: EntityId::writer(7) };
        let [inline, key] = of_endpoint(guid);
        assert_eq!(subject(&inline, true, &key), Some(guid));
        assert_eq!(subject(&[], true, &key), None);
        let status = ParameterList::inline().with(id::STATUS_INFO, &[0, 0, 0, 1]).into_bytes();
        assert_eq!(subject(&status, true, &key), Some(guid));
    }
}
