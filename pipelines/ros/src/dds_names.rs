//! The names of nodes on DDS: `rmw_dds_common/msg/ParticipantEntitiesInfo`, in which a participant says which endpoints
//! are of which of its nodes. There are two forms of it under one name of the type, and nodes of Humble that get the one
//! of later releases crash, or take all memory: each participant gets the one that it publishes itself.

use super::rtps::{Cursor, Guid, push_text};
use std::fmt;

/// The type of the message, and its hash since Iron.
pub(crate) const TYPE: &str = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";
const TYPE_HASH: &str = "RIHS01_91a0593bacdcc50ea9bdcf849a938b128412cc1ea821245c663bcd26f83c295e";

/// The form of the message, which is that of a release of ROS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    /// Since Iron.
    Iron,
    /// Up to Humble, where the type has no hash.
    Humble,
}

impl Form {
    /// The size of an identifier, bytes.
    const fn id_size(self) -> usize {
        match self {
            Self::Iron => 16,
            Self::Humble => 24,
        }
    }

    /// The hash of the type.
    pub(crate) const fn type_hash(self) -> Option<&'static str> {
        match self {
            Self::Iron => Some(TYPE_HASH),
            Self::Humble => None,
        }
    }
}

/// The maximum number of padding bytes after a message.
const PADDING: usize = 3;

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

/// The nodes of a participant, each with its endpoints.
pub(crate) type Nodes = Vec<(NodeName, Vec<Guid>)>;

/// The nodes of a participant, and the form of the message; `None` if the message is broken.
pub(crate) fn nodes(message: &[u8]) -> Option<(Nodes, Form)> {
    [Form::Iron, Form::Humble].into_iter().find_map(|form| Some((nodes_of_form(message, form)?, form)))
}

/// The nodes, if the message has this form.
fn nodes_of_form(message: &[u8], form: Form) -> Option<Nodes> {
    let id_size = form.id_size();
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
    (cursor.rest().len() <= PADDING).then_some(nodes)
}

/// The message of a participant with one node.
pub(crate) fn message(form: Form, participant: Guid, name: &NodeName, endpoints: &[Guid]) -> Vec<u8> {
    let push_id = |bytes: &mut Vec<u8>, guid: &Guid| {
        let end = bytes.len() + form.id_size();
        bytes.extend(guid.to_bytes());
        bytes.resize(end, 0);
    };
    let mut bytes = vec![0, 1, 0, 0];
    push_id(&mut bytes, &participant);
    bytes.extend(1_u32.to_le_bytes());
    push_text(&mut bytes, &name.namespace);
    push_text(&mut bytes, &name.name);
    for is_writer in [false, true] {
        let of_kind: Vec<&Guid> = endpoints.iter().filter(|guid| guid.entity.is_writer() == is_writer).collect();
        bytes.extend((of_kind.len() as u32).to_le_bytes());
        of_kind.into_iter().for_each(|guid| push_id(&mut bytes, guid));
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
        let bytes = message(Form::Iron, Guid::default(), &name, &endpoints);
        assert_eq!(nodes(&bytes), Some((vec![(name.clone(), endpoints.to_vec())], Form::Iron)));
        // As Humble writes it, where zeros follow an identifier.
        let old = bytes[4..].to_vec();
        let (head, ids) = (&old[16..old.len() - 3 * 16 - 8], &old[old.len() - 3 * 16 - 8..]);
        let zeros = [0; 8];
        let longer = |from: usize| [&ids[from..from + 16], &zeros].concat();
        let parts = [
            &[0, 1, 0, 0][..],
            &old[..16],
            &zeros,
            head,
            &ids[..4],
            &longer(4),
            &ids[20..24],
            &longer(24),
            &longer(40),
        ];
        assert_eq!(nodes(&parts.concat()), Some((vec![(name.clone(), endpoints.to_vec())], Form::Humble)));
        assert_eq!(message(Form::Humble, Guid::default(), &name, &endpoints), parts.concat());
        assert_eq!(nodes(&bytes[..bytes.len() - 1]), None);
        let mut endless = bytes;
        endless[20..24].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(nodes(&endless), None);
    }
}
