//! The quality of service of an endpoint, as far as it decides whether a writer and a reader match.

use super::cursor::Cursor;
use super::parameters::{self as id, ParameterList};
use std::fmt;

/// A duration without end.
const INFINITE: [u32; 2] = [0x7fff_ffff, 0xffff_ffff];
const KEEP_ALL: u32 = 1;

/// The policies of a writer or a reader.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Policies {
    pub(crate) is_reliable: bool,
    /// From 0: volatile, transient local, transient, persistent.
    pub(crate) durability: u32,
    /// The number of messages that are kept; `None` for all, or if it is unknown.
    pub(crate) depth: Option<u32>,
    /// The longest time between two messages, nanoseconds; `None` for any.
    pub(crate) deadline: Option<u64>,
    /// How a writer shows that it lives: automatic, by its participant, by its topic.
    pub(crate) liveliness: u32,
    /// The maximum interval, nanoseconds; `None` for any.
    pub(crate) liveliness_lease: Option<u64>,
    pub(crate) is_exclusive: bool,
    pub(crate) partitions: Vec<String>,
}

impl Policies {
    pub(crate) const fn new(is_reliable: bool, is_latched: bool, depth: Option<u32>) -> Self {
        Self {
            is_reliable,
            durability: is_latched as u32,
            depth,
            deadline: None,
            liveliness: 0,
            liveliness_lease: None,
            is_exclusive: false,
            partitions: Vec::new(),
        }
    }

    pub(crate) const fn is_latched(&self) -> bool {
        self.durability > 0
    }

    /// Takes up a parameter, if it is one of a policy.
    pub(crate) fn note(&mut self, parameter: u16, value: &mut Cursor<'_>) -> Option<()> {
        match parameter {
            id::RELIABILITY => self.is_reliable = value.u32()? != 1,
            id::DURABILITY => self.durability = value.u32()?,
            id::HISTORY => {
                let (kind, depth) = (value.u32()?, value.u32()?);
                self.depth = (kind != KEEP_ALL).then_some(depth);
            }
            id::DEADLINE => self.deadline = duration(value)?,
            id::LIVELINESS => (self.liveliness, self.liveliness_lease) = (value.u32()?, duration(value)?),
            id::OWNERSHIP => self.is_exclusive = value.u32()? != 0,
            id::PARTITION => {
                let count = value.u32()?;
                // No more than there are bytes for: the text of each ends the loop.
                self.partitions = (0..count).map_while(|_| value.text()).collect();
            }
            _ => {}
        }
        Some(())
    }

    /// Appends its parameters. Where it has no limits, what others take it for says the same.
    pub(crate) fn append(&self, list: ParameterList) -> ParameterList {
        let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
        let (kind, depth) = self.depth.map_or((KEEP_ALL, 0), |depth| (0, depth));
        list.with(id::RELIABILITY, &words(&[if self.is_reliable { 2 } else { 1 }, 0, 0x1999_9999]))
            .with(id::DURABILITY, &words(&[self.durability]))
            .with(id::HISTORY, &words(&[kind, depth]))
            .with(id::LIVELINESS, &words(&[0, INFINITE[0], INFINITE[1]]))
    }

    /// The policies by which a reader that requests these does not match a writer that offers others.
    pub(crate) fn mismatches(&self, offered: &Self) -> Vec<&'static str> {
        let is_longer = |offered: Option<u64>, requested: Option<u64>| match (offered, requested) {
            (_, None) => false,
            (None, Some(_)) => true,
            (Some(offered), Some(requested)) => offered > requested,
        };
        let checks = [
            ("reliability", self.is_reliable && !offered.is_reliable),
            ("durability", self.durability > offered.durability),
            ("deadline", is_longer(offered.deadline, self.deadline)),
            (
                "liveliness",
                self.liveliness > offered.liveliness || is_longer(offered.liveliness_lease, self.liveliness_lease),
            ),
            ("ownership", self.is_exclusive != offered.is_exclusive),
            ("partition", !self.shares_partition(offered)),
        ];
        checks.into_iter().filter(|(_, is_wrong)| *is_wrong).map(|(name, _)| name).collect()
    }

    /// ROS uses none; a name that is a pattern is taken as a name.
    fn shares_partition(&self, other: &Self) -> bool {
        let none = [String::new()];
        let of = |policies: &'_ Self| {
            if policies.partitions.is_empty() { none.to_vec() } else { policies.partitions.clone() }
        };
        let theirs = of(other);
        of(self).iter().any(|partition| theirs.contains(partition))
    }
}

/// In the words of `ros2 topic info --verbose`.
impl fmt::Display for Policies {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reliability = if self.is_reliable { "reliable" } else { "best effort" };
        let durability = match self.durability {
            0 => "volatile",
            1 => "transient local",
            2 => "transient",
            _ => "persistent",
        };
        write!(f, "{reliability}, {durability}")?;
        let mut limit = |name: &str, limit: Option<u64>| match limit {
            Some(nanoseconds) => write!(f, ", {name} {} s", nanoseconds as f64 / 1e9),
            None => Ok(()),
        };
        limit("deadline", self.deadline)?;
        limit("liveliness lease", self.liveliness_lease)?;
        if self.liveliness > 0 {
            write!(f, ", manual liveliness")?;
        }
        if self.is_exclusive {
            write!(f, ", exclusive ownership")?;
        }
        match self.partitions.is_empty() {
            true => Ok(()),
            false => write!(f, ", partition {}", self.partitions.join(", ")),
        }
    }
}

/// A duration, nanoseconds; the inner `None` if it has no end.
fn duration(value: &mut Cursor<'_>) -> Option<Option<u64>> {
    let (seconds, fraction) = (value.u32()?, value.u32()?);
    let nanoseconds = u64::from(seconds) * 1_000_000_000 + ((u64::from(fraction) * 1_000_000_000) >> 32);
    Some((seconds < INFINITE[0]).then_some(nanoseconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENSOR: Policies = Policies::new(false, false, Some(5));
    const RELIABLE: Policies = Policies::new(true, false, Some(10));
    const LATCHED: Policies = Policies::new(true, true, Some(1));

    #[test]
    fn a_reader_matches_writers_that_offer_at_least_what_it_requests() {
        for offered in [SENSOR, RELIABLE, LATCHED] {
            assert!(SENSOR.mismatches(&offered).is_empty());
        }
        assert_eq!(RELIABLE.mismatches(&SENSOR), ["reliability"]);
        assert_eq!(LATCHED.mismatches(&RELIABLE), ["durability"]);
        assert_eq!(LATCHED.mismatches(&SENSOR), ["reliability", "durability"]);
        let slow = Policies { deadline: Some(2_000_000_000), ..RELIABLE };
        assert_eq!(Policies { deadline: Some(1_000_000_000), ..RELIABLE }.mismatches(&slow), ["deadline"]);
        assert!(RELIABLE.mismatches(&slow).is_empty());
        assert_eq!(RELIABLE.mismatches(&Policies { partitions: vec!["a".into()], ..RELIABLE }), ["partition"]);
        assert_eq!(slow.to_string(), "reliable, volatile, deadline 2 s");
    }

    #[test]
    fn policies_are_read_back() {
        for policies in [SENSOR, RELIABLE, LATCHED, Policies::new(true, true, None)] {
            let bytes = policies.append(ParameterList::inline()).into_bytes();
            let mut read = Policies::new(true, false, Some(3));
            for (id, mut value) in super::super::parameters::read(&bytes, true) {
                read.note(id, &mut value).unwrap();
            }
            assert_eq!(read, policies);
        }
    }
}
