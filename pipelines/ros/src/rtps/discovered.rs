//! Discovery data of participants and of their endpoints (RTPS 2.3, 8.5).

use super::cursor::Cursor;
use super::guid::{EntityId, Guid, Prefix};
use super::locator;
use super::message::{VENDOR, VERSION};
use super::parameters::{self as id, ParameterList, of_sample};
use super::policies::Policies;
use std::net::SocketAddrV4;
use std::time::Duration;

/// The endpoints for discovery that are there: participants, publications and subscriptions, a writer and a reader for
/// each.
const ENDPOINTS: u32 = 0b11_1111;

/// A participant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ParticipantData {
    pub(crate) prefix: Prefix,
    /// The addresses for discovery messages about endpoints.
    pub(crate) discovery: Vec<SocketAddrV4>,
    /// The addresses of its readers, and for answers to its writers.
    pub(crate) user: Vec<SocketAddrV4>,
    /// It is gone this long after its last message.
    pub(crate) lease: Duration,
    /// Its enclave of SROS, `/` without one, or nothing if it is no program of ROS.
    pub(crate) enclave: String,
}

impl ParticipantData {
    pub(crate) fn read(payload: &[u8]) -> Option<Self> {
        let mut data = Self {
            prefix: Prefix::UNKNOWN,
            discovery: Vec::new(),
            user: Vec::new(),
            lease: DEFAULT_LEASE,
            enclave: String::new(),
        };
        for (parameter, mut value) in of_sample(payload)? {
            match parameter {
                id::PARTICIPANT_GUID => data.prefix = Guid::from_bytes(value.rest())?.prefix,
                id::METATRAFFIC_UNICAST_LOCATOR => data.discovery.extend(locator::read(&mut value)),
                id::DEFAULT_UNICAST_LOCATOR => data.user.extend(locator::read(&mut value)),
                id::USER_DATA => data.enclave = value_in(&mut value, "enclave").unwrap_or_default(),
                id::LEASE_DURATION => data.lease = Duration::from_secs(u64::from(value.u32()?)).max(MIN_LEASE),
                _ => {}
            }
        }
        (data.prefix != Prefix::UNKNOWN).then_some(data)
    }

    /// As a sample.
    pub(crate) fn to_bytes(&self, name: &str, domain: u32, multicast: Option<SocketAddrV4>) -> Vec<u8> {
        let guid = Guid { prefix: self.prefix, entity: EntityId::PARTICIPANT };
        let mut list = ParameterList::sample()
            .with(id::PROTOCOL_VERSION, &VERSION)
            .with(id::VENDOR_ID, &VENDOR)
            .with(id::DOMAIN_ID, &domain.to_le_bytes())
            .with(id::PARTICIPANT_GUID, &guid.to_bytes())
            .with(id::BUILTIN_ENDPOINTS, &ENDPOINTS.to_le_bytes())
            .with(id::LEASE_DURATION, &[(self.lease.as_secs() as u32).to_le_bytes(), [0; 4]].concat())
            .with_text(id::ENTITY_NAME, name)
            .with_bytes(id::USER_DATA, format!("enclave={};", self.enclave).as_bytes());
        for (parameter, addresses) in
            [(id::METATRAFFIC_UNICAST_LOCATOR, &self.discovery), (id::DEFAULT_UNICAST_LOCATOR, &self.user)]
        {
            list = addresses.iter().fold(list, |list, address| list.with(parameter, &locator::bytes(*address)));
        }
        multicast
            .into_iter()
            .fold(list, |list, address| list.with(id::METATRAFFIC_MULTICAST_LOCATOR, &locator::bytes(address)))
            .into_bytes()
    }
}

/// The lease where none is stated (RTPS 2.3, 9.6.2.2).
const DEFAULT_LEASE: Duration = Duration::from_secs(100);
/// No participant is taken to be gone sooner.
const MIN_LEASE: Duration = Duration::from_secs(2);

/// A writer or a reader of a topic.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct EndpointData {
    pub(crate) guid: Guid,
    /// The name of its topic, such as `rt/robot1/map`.
    pub(crate) topic: String,
    /// The name of its type, such as `nav_msgs::msg::dds_::OccupancyGrid_`.
    pub(crate) type_name: String,
    /// The hash of the type's definition, if it is stated, as since Iron.
    pub(crate) type_hash: Option<String>,
    pub(crate) policies: Policies,
    /// Where it is reached, if not where its participant is.
    pub(crate) addresses: Vec<SocketAddrV4>,
    /// The enclave of its participant, which says it.
    pub(crate) enclave: String,
}

impl EndpointData {
    pub(crate) fn read(payload: &[u8], is_writer: bool) -> Option<Self> {
        let mut data = Self {
            guid: Guid::default(),
            topic: String::new(),
            type_name: String::new(),
            type_hash: None,
            // The defaults.
            policies: Policies::new(is_writer, false, Some(1)),
            addresses: Vec::new(),
            enclave: String::new(),
        };
        for (parameter, mut value) in of_sample(payload)? {
            match parameter {
                id::ENDPOINT_GUID => data.guid = Guid::from_bytes(value.rest())?,
                id::TOPIC_NAME => data.topic = value.text()?,
                id::TYPE_NAME => data.type_name = value.text()?,
                id::USER_DATA => data.type_hash = value_in(&mut value, "typehash"),
                id::UNICAST_LOCATOR => data.addresses.extend(locator::read(&mut value)),
                other => data.policies.note(other, &mut value)?,
            }
        }
        let is_whole = !data.topic.is_empty() && data.guid.prefix != Prefix::UNKNOWN;
        (is_whole && data.guid.entity.is_writer() == is_writer).then_some(data)
    }

    /// As a sample.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let participant = Guid { prefix: self.guid.prefix, entity: EntityId::PARTICIPANT };
        let mut list = ParameterList::sample()
            .with(id::PROTOCOL_VERSION, &VERSION)
            .with(id::VENDOR_ID, &VENDOR)
            .with(id::ENDPOINT_GUID, &self.guid.to_bytes())
            .with(id::PARTICIPANT_GUID, &participant.to_bytes())
            .with(id::KEY_HASH, &self.guid.to_bytes())
            .with_text(id::TOPIC_NAME, &self.topic)
            .with_text(id::TYPE_NAME, &self.type_name);
        if let Some(hash) = &self.type_hash {
            list = list.with_bytes(id::USER_DATA, format!("typehash={hash};").as_bytes());
        }
        list =
            self.addresses.iter().fold(list, |list, address| list.with(id::UNICAST_LOCATOR, &locator::bytes(*address)));
        self.policies.append(list).into_bytes()
    }
}

/// A value in user data, as ROS writes them: `typehash=RIHS01_...;`.
fn value_in(user_data: &mut Cursor<'_>, key: &str) -> Option<String> {
    let length = user_data.u32()? as usize;
    let text = String::from_utf8_lossy(user_data.take(length)?);
    text.split(';').find_map(|pair| pair.strip_prefix(key)?.strip_prefix('=')).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::Ipv4Addr;

    fn address(port: u16) -> SocketAddrV4 {
        SocketAddrV4::new(Ipv4Addr::LOCALHOST, port)
    }

    #[test]
    fn a_participant_is_read_back() {
        let (discovery, user) = (vec![address(7410)], vec![address(7411), address(7413)]);
        let data = ParticipantData {
            prefix: Prefix([3; 12]),
            discovery,
            user,
            lease: Duration::from_secs(20),
            enclave: "/a".into(),
        };
        assert_eq!(ParticipantData::read(&data.to_bytes("gridweave", 0, Some(address(7400)))), Some(data));
    }

    #[test]
    fn an_endpoint_is_read_back_and_one_of_the_other_kind_is_none() {
        let data = EndpointData {
            guid: Guid { prefix: Prefix([3; 12]), entity: EntityId::writer(5) },
            topic: "rt/robot1/map".into(),
            type_name: "nav_msgs::msg::dds_::OccupancyGrid_".into(),
            type_hash: Some("RIHS01_00".into()),
            policies: Policies::new(true, true, Some(1)),
            addresses: vec![address(7411)],
            enclave: String::new(),
        };
        let bytes = data.to_bytes();
        assert_eq!(EndpointData::read(&bytes, true).as_ref(), Some(&data));
        assert_eq!(EndpointData::read(&bytes, false), None);
        for at in 0..bytes.len() {
            EndpointData::read(&bytes[..at], true);
            let mut changed = bytes.clone();
            changed[at] = 0xff;
            EndpointData::read(&changed, true);
        }
        let humble = EndpointData { type_hash: None, ..data };
        assert_eq!(EndpointData::read(&humble.to_bytes(), true), Some(humble));
    }
}
