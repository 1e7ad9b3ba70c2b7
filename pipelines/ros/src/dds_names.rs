//! The names of nodes on DDS: `rmw_dds_common/msg/ParticipantEntitiesInfo`, in which a participant says which endpoints are of which
//! of its nodes.

use super::rtps::{Cursor, Guid, push_text};
use std::fmt;

/// The type of the message, and its hash since Iron.
pub(crate) const TYPE: &str = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";
pub(crate) const TYPE_HASH: &str = "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e";
/// The size of an identifier in it since Iron, and before, bytes.
pub(crate) const ID_SIZE: usize = 16;
pub(crate) const OLD_ID_SIZE: usize = 24;

/// The name of a node.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct NodeName {
    pub(crate) namespace: String,
    pub(crate) name: String,
}

impl fmt::Display for NodeName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.namespace.trim_end_matches('/'), self.name)
    }
}

/// The nodes of a participant, each with its endpoints; `None` if the message is broken.
pub(crate) fn nodes(message: &[u8], id_size: usize) -> Option<Vec<(NodeName, Vec<Guid>)>> {
    let (&[_, encoding, _, _], content) = message.split_first_chunk()?;
    let mut cursor = Cursor::new(content, encoding == 1);
    cursor.take(id_size)?;
    let count = cursor.u32()?;
    let mut nodes = Vec::new();
    for _ in 0..count {
        let (namespace, name) = (cursor.text()?, cursor.text()?);
        let mut endpoints = Vec::new();
        // Its readers, and its writers.
        for _ in 0..2 {
            for _ in 0..cursor.u32()? {
                endpoints.extend(Guid::from_bytes(cursor.take(id_size)?));
            }
        }
        nodes.push((NodeName { namespace, name }, endpoints));
    }
    Some(nodes)
}

/// The message of a participant with one node.
pub(crate) fn message(participant: Guid, name: &NodeName, endpoints: &[Guid]) -> Vec<u8> {
    let mut bytes = vec![0, 1, 0, 0];
    bytes.extend(participant.to_bytes());
    bytes.extend(1_u32.to_le_bytes());
    push_text(&mut bytes, &name.namespace);
    push_text(&mut bytes, &name.name);
    for is_writer in [false, true] {
        let of_kind: Vec<&Guid> = endpoints.iter().filter(|guid| guid.entity.is_writer() == is_writer).collect();
        bytes.extend((of_kind.len() as u32).to_le_bytes());
        bytes.extend(of_kind.into_iter().flat_map(|guid| guid.to_bytes()));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::super::rtps::{EntityId, Prefix};
    use super::*;

    #[test]
    fn nodes_are_read_back_and_a_broken_message_has_none() {
        let guid = |entity| Guid { prefix: Prefix([5; 12]), entity };
        let endpoints = [guid(EntityId::reader(1)), guid(EntityId::writer(2)), guid(EntityId::writer(3))];
        let name = NodeName { namespace: "/robot1".into(), name: "slam".into() };
        let bytes = message(Guid::default(), &name, &endpoints);
        assert_eq!(nodes(&bytes, ID_SIZE), Some(vec![(name, endpoints.to_vec())]));
        assert_eq!(nodes(&bytes[..bytes.len() - 1], ID_SIZE), None);
        let mut endless = bytes;
        endless[20..24].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(nodes(&endless, ID_SIZE), None);
    }
}
