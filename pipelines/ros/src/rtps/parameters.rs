//! Lists of parameters, of which discovery and what goes beside a sample are made (RTPS 2.3, 9.4.2.11 and 9.6.2.2).

use super::cursor::Cursor;

pub(crate) const LEASE_DURATION: u16 = 0x0002;
pub(crate) const TOPIC_NAME: u16 = 0x0005;
pub(crate) const TYPE_NAME: u16 = 0x0007;
pub(crate) const PROTOCOL_VERSION: u16 = 0x0015;
pub(crate) const VENDOR_ID: u16 = 0x0016;
pub(crate) const RELIABILITY: u16 = 0x001a;
pub(crate) const LIVELINESS: u16 = 0x001b;
pub(crate) const DURABILITY: u16 = 0x001d;
pub(crate) const OWNERSHIP: u16 = 0x001f;
pub(crate) const DEADLINE: u16 = 0x0023;
pub(crate) const PARTITION: u16 = 0x0029;
pub(crate) const USER_DATA: u16 = 0x002c;
pub(crate) const UNICAST_LOCATOR: u16 = 0x002f;
pub(crate) const DEFAULT_UNICAST_LOCATOR: u16 = 0x0031;
pub(crate) const METATRAFFIC_UNICAST_LOCATOR: u16 = 0x0032;
pub(crate) const METATRAFFIC_MULTICAST_LOCATOR: u16 = 0x0033;
pub(crate) const HISTORY: u16 = 0x0040;
pub(crate) const PARTICIPANT_GUID: u16 = 0x0050;
pub(crate) const BUILTIN_ENDPOINTS: u16 = 0x0058;
pub(crate) const ENDPOINT_GUID: u16 = 0x005a;
pub(crate) const ENTITY_NAME: u16 = 0x0062;
pub(crate) const KEY_HASH: u16 = 0x0070;
pub(crate) const STATUS_INFO: u16 = 0x0071;
pub(crate) const DOMAIN_ID: u16 = 0x000f;

/// The end of a list.
const SENTINEL: u16 = 0x0001;
const PAD: u16 = 0x0000;
/// Before a list that is a sample: that it is one, with little-endian numbers.
const LITTLE_ENDIAN_LIST: [u8; 4] = [0, 3, 0, 0];

/// The parameters of a list that is a sample, each with what reads its value.
pub(crate) fn of_sample(payload: &[u8]) -> Option<Vec<(u16, Cursor<'_>)>> {
    let (&[0, encoding, _, _], list) = payload.split_first_chunk()? else { return None };
    match encoding {
        2 | 3 => Some(read(list, encoding == 3)),
        _ => None,
    }
}

/// The parameters of a list, each with what reads its value. What follows a broken one is left out.
pub(crate) fn read(list: &[u8], is_little: bool) -> Vec<(u16, Cursor<'_>)> {
    let mut cursor = Cursor::new(list, is_little);
    let mut parameters = Vec::new();
    while let Some((id, value)) = next(&mut cursor) {
        match id {
            SENTINEL => break,
            PAD => {}
            _ => parameters.push((id, Cursor::new(value, is_little))),
        }
    }
    parameters
}

/// The size of a list with its end, bytes; `None` if it has none.
pub(crate) fn size(bytes: &[u8], is_little: bool) -> Option<usize> {
    let mut cursor = Cursor::new(bytes, is_little);
    while next(&mut cursor)?.0 != SENTINEL {}
    Some(bytes.len() - cursor.rest().len())
}

fn next<'a>(cursor: &mut Cursor<'a>) -> Option<(u16, &'a [u8])> {
    let (id, length) = (cursor.u16()?, cursor.u16()?);
    match id {
        SENTINEL => Some((id, &[])),
        _ => Some((id, cursor.take(usize::from(length))?)),
    }
}

/// A list that is being written, little-endian.
#[derive(Clone, Debug)]
pub(crate) struct ParameterList(Vec<u8>);

impl ParameterList {
    /// A list that is a sample.
    pub(crate) fn sample() -> Self {
        Self(LITTLE_ENDIAN_LIST.to_vec())
    }

    /// A list beside a sample.
    pub(crate) const fn inline() -> Self {
        Self(Vec::new())
    }

    #[must_use]
    pub(crate) fn with(mut self, id: u16, value: &[u8]) -> Self {
        let length = value.len().next_multiple_of(4);
        self.0.extend(id.to_le_bytes());
        self.0.extend(u16::try_from(length).unwrap_or_default().to_le_bytes());
        self.0.extend(value);
        self.0.resize(self.0.len() + length - value.len(), 0);
        self
    }

    #[must_use]
    pub(crate) fn with_text(self, id: u16, text: &str) -> Self {
        let mut value = Vec::new();
        super::cursor::push_text(&mut value, text);
        self.with(id, &value)
    }

    /// A value of any number of bytes, with their number before them.
    #[must_use]
    pub(crate) fn with_bytes(self, id: u16, bytes: &[u8]) -> Self {
        let value = [&(bytes.len() as u32).to_le_bytes(), bytes].concat();
        self.with(id, &value)
    }

    pub(crate) fn into_bytes(mut self) -> Vec<u8> {
        self.0.extend([SENTINEL as u8, 0, 0, 0]);
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_back() {
        let list =
            ParameterList::sample().with_text(TOPIC_NAME, "rt/map").with(DOMAIN_ID, &[5]).with_bytes(USER_DATA, b"abc");
        let bytes = list.into_bytes();
        let mut parameters = of_sample(&bytes).unwrap();
        assert_eq!(parameters.iter().map(|(id, _)| *id).collect::<Vec<_>>(), [TOPIC_NAME, DOMAIN_ID, USER_DATA]);
        assert_eq!(parameters[0].1.text().as_deref(), Some("rt/map"));
        assert_eq!(parameters[1].1.u32(), Some(5));
        assert_eq!(parameters[2].1.u32(), Some(3));
        assert_eq!(size(&[&bytes[4..], &[1, 2]].concat(), true), Some(bytes.len() - 4));
    }

    #[test]
    fn a_list_without_an_end_has_no_size_and_a_broken_parameter_ends_it() {
        let bytes = ParameterList::inline().with(KEY_HASH, &[0; 16]).into_bytes();
        assert_eq!(size(&bytes[..bytes.len() - 4], true), None);
        assert!(read(&bytes[..10], true).is_empty());
        assert!(of_sample(&[0, 1, 0, 0]).is_none());
    }
}
