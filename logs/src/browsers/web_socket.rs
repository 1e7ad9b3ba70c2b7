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
/// The maximum size of a message of a browser, with the heads of its frames, bytes. A server keeps the parts of a message
/// until it is whole. The longest that a viewer sends names the some thousand channels that it subscribes to.
const LONGEST_MESSAGE: u64 = 256 << 10;
/// How much of the content of a frame is reported, bytes.
const REPORTED: usize = 16;

/// When a client must show that it is there.
#[derive(Clone, Copy, Debug)]
pub struct Pings {
    /// The time between two pings.
    pub interval: Duration,
    /// The time in which a client must send anything, if only answers to pings.
    pub timeout: Duration,
}

/// What a server has sent to a browser.
#[derive(Debug)]
pub enum Relayed<'a> {
    /// A whole frame, which has been passed on.
    Frame(&'a Frame),
    /// Nothing for the interval of the pings, although it was waited for.
    Nothing,
}

/// A frame that has content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// Its first byte: whether it is the last of its message, and its opcode.
    pub kind: u8,
    /// The length of its content, bytes.
    pub length: u64,
    /// The beginning of its content: 16 bytes, or all if it is shorter.
    pub start: Vec<u8>,
}

/// Copies what a browser sends to a server until either closes, or a message of the browser is too long.
pub(super) fn copy_short_messages(mut browser: &TcpStream, mut server: &TcpStream, first: &[u8]) -> io::Result<()> {
    let mut place = PlaceInMessages::default();
    if !place.are_short(first) {
        return Ok(());
    }
    let mut piece = vec![0; PIECE];
    loop {
        let count = match browser.read(&mut piece) {
            Ok(0) => return Ok(()),
            Ok(count) => count,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        if !place.are_short(&piece[..count]) {
            return Ok(());
        }
        server.write_all(&piece[..count])?;
    }
}

/// The place in what a browser sends: frames from the first byte on.
#[derive(Default)]
struct PlaceInMessages {
    /// What has come of the head of a frame.
    head: Vec<u8>,
    /// How much of the content of a frame is to come, bytes.
    left: u64,
    /// The size of the message so far, by the lengths that its frames claim.
    size: u64,
}

impl PlaceInMessages {
    /// Follows the next bytes. Returns whether no message in them is too long, or will be.
    fn are_short(&mut self, mut bytes: &[u8]) -> bool {
        loop {
            let content = self.left.min(bytes.len() as u64);
            self.left -= content;
            bytes = &bytes[content as usize..];
            let Some((&next, rest)) = bytes.split_first() else { return true };
            self.head.push(next);
            bytes = rest;
            let Some(length) = content_length(&self.head) else { continue };
            let (is_last, is_control) = (self.head[0] & 0x80 != 0, self.head[0] & 0x08 != 0);
            // A control frame may come between the frames of a message. Frames without content count as well.
            let size = if is_control { length } else { self.size.saturating_add(length).saturating_add(2) };
            if size > LONGEST_MESSAGE {
                return false;
            }
            if !is_control {
                self.size = if is_last { 0 } else { size };
            }
            self.left = length;
            self.head.clear();
        }
    }
}

/// Copies what a server sends to a browser until either closes, with pings between frames, and reports it.
pub(super) fn copy_with_pings(
    mut server: &TcpStream,
    mut browser: &TcpStream,
    pings: Pings,
    mut report: impl FnMut(Relayed<'_>),
) -> io::Result<()> {
    server.set_read_timeout(Some(pings.interval))?;
    let (mut piece, mut place, mut last) = (vec![0; PIECE], Place::default(), Instant::now());
    let mut ended = Vec::new();
    loop {
        let count = match server.read(&mut piece) {
            Ok(0) => return Ok(()),
            Ok(count) => count,
            Err(error) if [ErrorKind::WouldBlock, ErrorKind::TimedOut].contains(&error.kind()) => 0,
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        let bytes = &piece[..count];
        match place.advance(bytes, &mut ended).filter(|_| last.elapsed() >= pings.interval) {
            None => browser.write_all(bytes)?,
            Some(boundary) => {
                browser.write_all(&bytes[..boundary])?;
                browser.write_all(&PING)?;
                browser.write_all(&bytes[boundary..])?;
                last = Instant::now();
            }
        }
        if count == 0 && place.is_boundary() {
            report(Relayed::Nothing);
        }
        for frame in ended.drain(..) {
            report(Relayed::Frame(&frame));
        }
    }
}

/// The place in what a server sends.
enum Place {
    /// In the answer to the request, of which this has come.
    Head(Vec<u8>),
    /// In the head of a frame, of which this has come. Before the first byte it is between two frames.
    FrameHead(Vec<u8>),
    /// In the content of a frame, of which so many bytes are to come.
    Content(u64, Frame),
    /// In what is no WebSocket.
    Other,
}

impl Default for Place {
    fn default() -> Self {
        Self::Head(Vec::new())
    }
}

impl Place {
    /// Follows the next bytes, and adds the frames that end in them. Returns the last place in them, or at their end, that
    /// is between two frames.
    fn advance(&mut self, bytes: &[u8], ended: &mut Vec<Frame>) -> Option<usize> {
        let mut boundary = self.is_boundary().then_some(0);
        let mut at = 0;
        while at < bytes.len() {
            match self {
                Self::Content(left, frame) => {
                    let taken = (*left).min((bytes.len() - at) as u64) as usize;
                    let reported = taken.min(REPORTED - frame.start.len());
                    frame.start.extend_from_slice(&bytes[at..at + reported]);
                    *left -= taken as u64;
                    at += taken;
                    if *left == 0
                        && let Self::Content(_, frame) = std::mem::replace(self, Self::FrameHead(Vec::new()))
                    {
                        ended.push(frame);
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
                        let frame = Frame { kind: head[0], length, start: Vec::new() };
                        *self = if length == 0 { Self::FrameHead(Vec::new()) } else { Self::Content(length, frame) };
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
    Some(length.saturating_add(mask))
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
            let (mut place, mut found, mut frames) = (Place::default(), Vec::new(), Vec::new());
            for (number, piece) in sent.chunks(size).enumerate() {
                found.extend(place.advance(piece, &mut frames).map(|at| number * size + at));
            }
            let reported = frames.iter().map(|frame| (frame.kind, frame.length, frame.start.len()));
            assert!(reported.eq([1, 125, 126, 300, 70_000].map(|length| (0x82, length, length.min(16) as usize))));
            found.dedup();
            assert!(found.iter().all(|at| expected.contains(at)), "{size}: {found:?}");
            assert_eq!(found.last(), expected.last(), "{size}");
            assert!(size > 1 || found == expected, "{found:?}");
        }
    }

    #[test]
    fn what_is_no_web_socket_has_no_frames() {
        let (mut place, mut frames) = (Place::default(), Vec::new());
        assert_eq!(place.advance(b"HTTP/1.1 400 Bad Request\r\n\r\n\x82\x00", &mut frames), None);
        assert_eq!(Place::default().advance(&[b'x'; 2 * LONGEST_HEAD], &mut frames), None);
        assert!(frames.is_empty());
    }

    /// A frame of a browser, masked with zeros.
    fn masked(kind: u8, length: usize) -> Vec<u8> {
        [&[kind, 0xff][..], &(length as u64).to_be_bytes(), &[0; 4], &vec![b' '; length]].concat()
    }

    #[test]
    fn messages_of_a_browser_pass_while_they_are_short_whatever_the_pieces_are() {
        let all: Vec<u8> =
            (0..20).flat_map(|_| [masked(0x01, 60_000), masked(0x89, 9), masked(0x80, 60_000)]).flatten().collect();
        for size in [1, 7, 1000, all.len()] {
            let mut place = PlaceInMessages::default();
            assert!(all.chunks(size).all(|piece| place.are_short(piece)), "{size}");
        }
    }

    #[test]
    fn a_message_of_a_browser_is_ended_where_it_gets_too_long() {
        let mut place = PlaceInMessages::default();
        assert!(place.are_short(&masked(0x01, 100_000)));
        let passed = (0..1000).take_while(|_| place.are_short(&masked(0x00, 100_000))).count();
        assert_eq!(passed, 1, "fragments count together");
        let mut place = PlaceInMessages::default();
        assert!(place.are_short(&[0x01, 0x80, 0, 0, 0, 0]));
        assert!((0..1_000_000).any(|_| !place.are_short(&[0x00, 0x80, 0, 0, 0, 0])), "so do those without content");
        for kind in [0x82, 0x89] {
            let claimed = [&[kind, 0xff][..], &[0xff; 8]].concat();
            assert!(!PlaceInMessages::default().are_short(&claimed), "the length that a head claims is enough");
        }
    }
}
