//! Where a participant or an endpoint is reached: UDP over IPv4. Other kinds, such as shared memory, are left out.

use super::cursor::Cursor;
use std::net::{Ipv4Addr, SocketAddrV4};

const UDP_V4: i32 = 1;

/// Reads a locator; `None` if it is of another kind.
pub(crate) fn read(cursor: &mut Cursor<'_>) -> Option<SocketAddrV4> {
    let (kind, port) = (cursor.i32()?, cursor.u32()?);
    cursor.take(12)?;
    let address = Ipv4Addr::from(cursor.array::<4>()?);
    let is_usable = kind == UDP_V4 && !address.is_unspecified();
    Some(SocketAddrV4::new(address, u16::try_from(port).ok().filter(|port| is_usable && *port > 0)?))
}

/// A locator as bytes.
pub(crate) fn bytes(address: SocketAddrV4) -> [u8; 24] {
    let mut bytes = [0; 24];
    bytes[..4].copy_from_slice(&UDP_V4.to_le_bytes());
    bytes[4..8].copy_from_slice(&u32::from(address.port()).to_le_bytes());
    bytes[20..].copy_from_slice(&address.ip().octets());
    bytes
}

/// The addresses of a participant to send to: the one that it sent from, or else all that other machines can reach, or
/// else all.
pub(crate) fn reachable(addresses: &[SocketAddrV4], heard_from: Ipv4Addr) -> Vec<SocketAddrV4> {
    let those = |is_so: &dyn Fn(&Ipv4Addr) -> bool| -> Vec<SocketAddrV4> {
        addresses.iter().filter(|address| is_so(address.ip())).copied().collect()
    };
    let heard = those(&|address| *address == heard_from);
    if !heard.is_empty() {
        return heard;
    }
    let others = those(&|address| !address.is_loopback());
    if others.is_empty() { addresses.to_vec() } else { others }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_locator_is_read_back_and_other_kinds_are_left_out() {
        let address = SocketAddrV4::new(Ipv4Addr::new(10, 0, 0, 7), 7411);
        let mut of = bytes(address);
        assert_eq!(read(&mut Cursor::new(&of, true)), Some(address));
        of[0] = 16;
        assert_eq!(read(&mut Cursor::new(&of, true)), None);
        assert_eq!(read(&mut Cursor::new(&of[..20], true)), None);
    }

    #[test]
    fn of_several_addresses_the_one_that_was_heard_is_sent_to() {
        let [loopback, lan, docker] =
            [[127, 0, 0, 1], [10, 0, 0, 7], [172, 17, 0, 1]].map(|ip| SocketAddrV4::new(Ipv4Addr::from(ip), 7411));
        let all = [loopback, lan, docker];
        assert_eq!(reachable(&all, *lan.ip()), [lan]);
        assert_eq!(reachable(&all, Ipv4Addr::new(10, 0, 0, 8)), [lan, docker]);
        assert_eq!(reachable(&[loopback], *lan.ip()), [loopback]);
    }
}
