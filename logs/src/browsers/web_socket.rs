//! The relay of a WebSocket (RFC 6455) from a server to a browser, with pings between the frames of the server.
//!
//! A server that sends no pings does not notice a client that is connected and takes part in nothing: it may wait for
//! the next message, or have gone without an end. A browser answers a ping by itself.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

/// A ping without content.
const PING: [u8; 2] = [0x89, 0];
/// The maximum size of the answer to the request, bytes.
const LONGEST_HEAD: usize = 16 << 10;
/// The size of what is relayed at a time, bytes.
const PIECE: usize = 64 << 10;

/// When a client must show that it is there.
#[derive(Clone, Copy, Debug)]
pub struct Pings {
    /// The time between two pings.
    pub interval: Duration,
    /// The time in which a client must send anything, if only answers to pings.
    pub timeout: Duration,
}

/// Copies what a server sends to a browser until either closes, with pings between frames.
pub(super) fn copy_with_pings(mut server: &TcpStream, mut browser: &TcpStream, pings: Pings) -> io::Result<()> {
    server.set_read_timeout(Some(pings.interval))?;
    let (mut piece, mut place, mut last) = (vec![0; PIECE], Place::default(), Instant::now());
    loop {
        let count = match server.read(&mut piece) {
            Ok(0) => return Ok(()),
            Ok(count) => count,
            Err(error) if [ErrorKind::WouldBlock, ErrorKind::TimedOut].contains(&error.kind()) => 0,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        let bytes = &piece[..count];
        let boundary = place.advance(bytes).filter(|_| last.elapsed() >= pings.interval);
        let Some(boundary) = boundary else {
            browser.write_all(bytes)?;
            continue;
        };
        browser.write_all(&bytes[..boundary])?;
        browser.write_all(&PING)?;
        browser.write_all(&bytes[boundary..])?;
        last = Instant::now();
    }
}

/// The place in what a server sends.
enum Place {
    /// In the answer to the request, of which this has come.
    Head(Vec<u8>),
    /// In the head of a frame, of which this has come. Before the first byte it is between two frames.
    FrameHead(Vec<u8>),
    /// In the content of a frame, of which so many bytes are to come.
    Content(u64),
    /// In what is no WebSocket.
    Other,
}

impl Default for Place {
    fn default() -> Self {
        Self::Head(Vec::new())
    }
}

impl Place {
    /// Follows the next bytes. Returns the last place in them, or at their end, that is between two frames.
    fn advance(&mut self, bytes: &[u8]) -> Option<usize> {
        let mut boundary = self.is_boundary().then_some(0);
        let mut at = 0;
        while at < bytes.len() {
            match self {
                Self::Content(left) => {
                    let taken = (*left).min((bytes.len() - at) as u64);
                    *left -= taken;
                    at += taken as usize;
                    if *left == 0 {
                        *self = Self::FrameHead(Vec::new());
                    }
                }
                Self::Head(head) => {
                    head.push(bytes[at]);
                    at += 1;
                    if head.ends_with(b"\r\n\r\n") {
                        *self = if is_upgrade(head) { Self::FrameHead(Vec::new()) } else { Self::Other };
                    } else if head.len() == LONGEST_HEAD {
                        *self = Self::Other;
                    }
                }
                Self::FrameHead(head) => {
                    head.push(bytes[at]);
                    at += 1;
                    if let Some(length) = content_length(head) {
                        *self = if length == 0 { Self::FrameHead(Vec::new()) } else { Self::Content(length) };
                    }
                }
                Self::Other => return None,
            }
            if self.is_boundary() {
                boundary = Some(at);
            }
        }
        boundary
    }

    fn is_boundary(&self) -> bool {
        matches!(self, Self::FrameHead(head) if head.is_empty())
    }
}

/// Whether an answer starts a WebSocket.
fn is_upgrade(head: &[u8]) -> bool {
    head.starts_with(b"HTTP/1.1 101")
}

/// The length of the content of a frame, with the mask before it; `None` while its head is not whole.
fn content_length(head: &[u8]) -> Option<u64> {
    let second = *head.get(1)?;
    let mask = if second & 0x80 == 0 { 0 } else { 4 };
    let length = match second & 0x7f {
        126 => u64::from(u16::from_be_bytes(head.get(2..4)?.try_into().ok()?)),
        127 => u64::from_be_bytes(head.get(2..10)?.try_into().ok()?),
        length => u64::from(length),
    };
    length.checked_add(mask)
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &[u8] = b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\n\r\n";

    /// A frame with a content of this length.
    fn frame(length: usize) -> Vec<u8> {
        let head = match length {
            0..=125 => vec![0x82, length as u8],
            126..=0xffff => [&[0x82, 126], &(length as u16).to_be_bytes()[..]].concat(),
            _ => [&[0x82, 127], &(length as u64).to_be_bytes()[..]].concat(),
        };
        [head, vec![0x89; length]].concat()
    }

    #[test]
    fn the_places_between_frames_are_found_whatever_the_pieces_are() {
        let mut sent = HEAD.to_vec();
        let mut expected = vec![sent.len()];
        for length in [0, 1, 125, 126, 300, 70_000, 0] {
            sent.extend(frame(length));
            expected.push(sent.len());
        }
        for size in [1, 2, 7, 1000, sent.len()] {
            let (mut place, mut found) = (Place::default(), Vec::new());
            for (number, piece) in sent.chunks(size).enumerate() {
                found.extend(place.advance(piece).map(|at| number * size + at));
            }
            found.dedup();
            assert!(found.iter().all(|at| expected.contains(at)), "{size}: {found:?}");
            assert_eq!(found.last(), expected.last(), "{size}");
            assert!(size > 1 || found == expected, "{found:?}");
        }
    }

    #[test]
    fn what_is_no_web_socket_has_no_frames() {
        let mut place = Place::default();
        assert_eq!(place.advance(b"HTTP/1.1 400 Bad Request\r\n\r\n\x82\x00"), None);
        assert_eq!(Place::default().advance(&[b'x'; 2 * LONGEST_HEAD]), None);
    }
}
