//! The sockets of a participant, and where others are looked for (RTPS 2.3, 9.6.1).

use pnet_datalink::interfaces;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use socket2::{Domain, Protocol, SockAddr, Socket, Type};
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, SocketAddrV4, UdpSocket};
use std::os::unix::net::UnixStream;
use std::time::Duration;

/// Where participants look for others in their network.
const MULTICAST_GROUP: Ipv4Addr = Ipv4Addr::new(239, 255, 0, 1);
/// The highest domain whose ports are all below those that systems give away, and the highest at all.
pub(crate) const LAST_DOMAIN: u32 = 232;
/// The maximum number of participants on one machine in one domain.
const PARTICIPANTS: u16 = 120;
/// The number of participants that are looked for on a machine without multicast.
const LOOKED_FOR: u16 = 32;
/// What waits to be read, at most, bytes: a map in its fragments. The system may allow less.
const BUFFER_SIZE: usize = 4 << 20;

/// The networks on which other participants are discovered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reach {
    /// On this machine alone. Nothing is listened to that other machines could reach.
    Machine,
    /// In the networks of this machine.
    Network,
}

/// The ports of a domain.
#[derive(Clone, Copy, Debug)]
struct Ports(u16);

impl Ports {
    fn of(domain: u32) -> Self {
        Self(7400 + 250 * domain.min(LAST_DOMAIN) as u16)
    }

    const fn multicast(self) -> u16 {
        self.0
    }

    const fn discovery(self, participant: u16) -> u16 {
        self.0 + 10 + 2 * participant
    }

    const fn user(self, participant: u16) -> u16 {
        self.0 + 11 + 2 * participant
    }
}

/// The sockets of a participant.
#[derive(Debug)]
pub(crate) struct Network {
    /// For discovery messages about participants and endpoints.
    discovery: UdpSocket,
    /// For samples, and from which everything is sent.
    user: UdpSocket,
    /// For multicast messages.
    multicast: Option<UdpSocket>,
    /// One for each interface.
    multicast_senders: Vec<UdpSocket>,
    /// Ends a wait.
    wake: [UnixStream; 2],
    ports: Ports,
    addresses: Vec<Ipv4Addr>,
    /// Machines on which participants are looked for one by one.
    peers: Vec<Ipv4Addr>,
}

impl Network {
    /// Opens the sockets, on the first ports of the domain that are free.
    ///
    /// # Errors
    /// The system refuses them.
    pub(crate) fn open(domain: u32, reach: Reach, peers: &[Ipv4Addr]) -> io::Result<Self> {
        let ports = Ports::of(domain);
        let own = own_addresses();
        let (bind, addresses) = match reach {
            Reach::Machine => (Ipv4Addr::LOCALHOST, vec![Ipv4Addr::LOCALHOST]),
            Reach::Network if own.is_empty() => (Ipv4Addr::UNSPECIFIED, vec![Ipv4Addr::LOCALHOST]),
            Reach::Network => (Ipv4Addr::UNSPECIFIED, own),
        };
        let (discovery, user) = free_pair(bind, ports)?;
        let (multicast, multicast_senders) = match reach {
            Reach::Machine => (None, Vec::new()),
            Reach::Network => (
                Some(multicast_receiver(ports.multicast(), &addresses)?),
                addresses.iter().filter_map(|address| multicast_sender(*address).ok()).collect(),
            ),
        };
        let (sender, receiver) = UnixStream::pair()?;
        sender.set_nonblocking(true)?;
        receiver.set_nonblocking(true)?;
        // Participants that keep to this machine are not reached by multicast.
        let peers = [&[Ipv4Addr::LOCALHOST], peers].concat();
        Ok(Self { discovery, user, multicast, multicast_senders, wake: [sender, receiver], ports, addresses, peers })
    }

    /// The addresses for discovery messages, and for samples.
    pub(crate) fn locators(&self) -> [Vec<SocketAddrV4>; 2] {
        [&self.discovery, &self.user].map(|socket| {
            let port = socket.local_addr().map_or(0, |address| address.port());
            self.addresses.iter().map(|address| SocketAddrV4::new(*address, port)).collect()
        })
    }

    /// Where it receives multicast messages.
    pub(crate) fn multicast_locator(&self) -> Option<SocketAddrV4> {
        self.multicast.as_ref().map(|_| SocketAddrV4::new(MULTICAST_GROUP, self.ports.multicast()))
    }

    /// Sends a datagram. What the network does not take is lost, as on the way.
    pub(crate) fn send(&self, bytes: &[u8], to: SocketAddrV4) {
        if let Err(error) = self.user.send_to(bytes, SocketAddr::V4(to)) {
            tracing::debug!("a datagram to {to} is lost: {error}");
        }
    }

    /// Sends a datagram to wherever participants may be that are not known yet.
    pub(crate) fn send_to_unknown(&self, bytes: &[u8]) {
        let group = SocketAddrV4::new(MULTICAST_GROUP, self.ports.multicast());
        for sender in &self.multicast_senders {
            if let Err(error) = sender.send_to(bytes, SocketAddr::V4(group)) {
                tracing::debug!("a datagram to the network is lost: {error}");
            }
        }
        for peer in &self.peers {
            for participant in 0..LOOKED_FOR {
                // If no program listens, the error comes with the next datagram.
                let _ = self.user.send_to(bytes, (*peer, self.ports.discovery(participant)));
            }
        }
    }

    /// Waits for something to read, at most so long or until [`wake`](Self::wake), and calls `take` with each datagram
    /// and from where it has come. `buffer` holds the largest.
    pub(crate) fn receive(&self, longest: Duration, buffer: &mut [u8], mut take: impl FnMut(&[u8], Ipv4Addr)) {
        let mut waited = vec![
            PollFd::new(&self.wake[1], PollFlags::IN),
            PollFd::new(&self.discovery, PollFlags::IN),
            PollFd::new(&self.user, PollFlags::IN),
        ];
        waited.extend(self.multicast.as_ref().map(|socket| PollFd::new(socket, PollFlags::IN)));
        let timeout = Timespec { tv_sec: longest.as_secs().cast_signed(), tv_nsec: longest.subsec_nanos().into() };
        // An interruption ends the wait.
        let _ = poll(&mut waited, Some(&timeout));
        let mut of_wake = [0; 64];
        while matches!(io::Read::read(&mut &self.wake[1], &mut of_wake), Ok(count) if count == of_wake.len()) {}
        for socket in [Some(&self.discovery), self.multicast.as_ref(), Some(&self.user)].into_iter().flatten() {
            // No more than that, so that what is due is not late.
            for _ in 0..256 {
                match socket.recv_from(buffer) {
                    Ok((size, SocketAddr::V4(from))) => take(buffer.get(..size).unwrap_or_default(), *from.ip()),
                    Ok(_) => {}
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                    // The error of an earlier datagram that no program received.
                    Err(_) => {}
                }
            }
        }
    }

    /// Ends a wait of [`receive`](Self::receive).
    pub(crate) fn wake(&self) {
        // A full pipe wakes, too.
        let _ = io::Write::write(&mut &self.wake[0], &[0]);
    }
}

/// The addresses by which other machines reach this one.
fn own_addresses() -> Vec<Ipv4Addr> {
    let usable = interfaces().into_iter().filter(|interface| interface.is_up() && !interface.is_loopback());
    let address = |address: IpAddr| match address {
        IpAddr::V4(address) if !address.is_loopback() => Some(address),
        _ => None,
    };
    usable.flat_map(|interface| interface.ips).filter_map(|network| address(network.ip())).collect()
}

/// Sockets on the ports of the first participant that are free.
fn free_pair(bind: Ipv4Addr, ports: Ports) -> io::Result<(UdpSocket, UdpSocket)> {
    let mut refused = io::Error::from(io::ErrorKind::AddrInUse);
    for participant in 0..PARTICIPANTS {
        let pair = receiver(bind, ports.discovery(participant))
            .and_then(|discovery| Ok((discovery, receiver(bind, ports.user(participant))?)));
        match pair {
            Ok(pair) => return Ok(pair),
            Err(error) => refused = error,
        }
    }
    Err(refused)
}

fn receiver(bind: Ipv4Addr, port: u16) -> io::Result<UdpSocket> {
    let socket = socket()?;
    socket.bind(&SockAddr::from(SocketAddrV4::new(bind, port)))?;
    Ok(socket.into())
}

fn multicast_receiver(port: u16, interfaces: &[Ipv4Addr]) -> io::Result<UdpSocket> {
    let socket = socket()?;
    socket.set_reuse_address(true)?;
    // To the group alone, and no other address.
    socket.bind(&SockAddr::from(SocketAddrV4::new(MULTICAST_GROUP, port)))?;
    for interface in interfaces {
        if let Err(error) = socket.join_multicast_v4(&MULTICAST_GROUP, interface) {
            tracing::debug!("{interface} has no multicast: {error}");
        }
    }
    Ok(socket.into())
}

fn multicast_sender(interface: Ipv4Addr) -> io::Result<UdpSocket> {
    let socket = socket()?;
    socket.set_multicast_if_v4(&interface)?;
    socket.set_multicast_loop_v4(true)?;
    Ok(socket.into())
}

fn socket() -> io::Result<Socket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
    socket.set_nonblocking(true)?;
    socket.set_recv_buffer_size(BUFFER_SIZE)?;
    socket.set_send_buffer_size(BUFFER_SIZE)?;
    Ok(socket)
}
