//! Connections of browsers: a limited number of them, each with time limits, and the requests that they send.
//!
//! A client may send nothing, or slowly, or without end, or not read what it is sent. None of that takes more than a
//! connection for a while.

mod web_socket;

pub use web_socket::{Frame, Pings, Relayed};

use std::io::{self, ErrorKind, Read, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, Shutdown, SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

/// The maximum size of a request, bytes, and of its headers.
const MAX_REQUEST: usize = 16 << 10;
const MAX_HEADERS: usize = 100;
/// The time in which a request must have arrived.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(10);
/// The time in which a browser must take some of what it is sent.
const SEND_TIMEOUT: Duration = Duration::from_secs(30);
/// The time in which a browser must close after an answer, so that it has read it.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);
/// Pause where no connection can be accepted, such as without free file descriptors.
const PAUSE: Duration = Duration::from_millis(100);

/// A server of browsers, which accepts connections until it is dropped.
pub struct BrowserServer {
    address: SocketAddr,
    stop: Arc<AtomicBool>,
}

impl BrowserServer {
    /// Accepts connections on an address, at most `most` at a time, and passes each to `answer` in a thread of its own.
    ///
    /// # Errors
    /// The address cannot be bound.
    pub fn start(
        address: impl ToSocketAddrs,
        most: usize,
        answer: impl Fn(Connection) + Send + Sync + 'static,
    ) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        let (address, stop) = (listener.local_addr()?, Arc::new(AtomicBool::new(false)));
        let is_stopped = Arc::clone(&stop);
        thread::Builder::new().name("browsers".into()).spawn(move || accept(&listener, &is_stopped, most, answer))?;
        Ok(Self { address, stop })
    }

    /// The address, with its port.
    pub fn address(&self) -> SocketAddr {
        self.address
    }
}

impl Drop for BrowserServer {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // Wakes the thread that accepts connections, so that it closes the port.
        let mut own = self.address;
        if own.ip().is_unspecified() {
            own.set_ip(if own.is_ipv4() { Ipv4Addr::LOCALHOST.into() } else { IpAddr::from(Ipv6Addr::LOCALHOST) });
        }
        drop(TcpStream::connect_timeout(&own, PAUSE));
    }
}

fn accept(listener: &TcpListener, stop: &AtomicBool, most: usize, answer: impl Fn(Connection) + Send + Sync + 'static) {
    let (answer, open) = (Arc::new(answer), Arc::new(AtomicUsize::new(0)));
    while !stop.load(Ordering::Relaxed) {
        let Ok((stream, _)) = listener.accept() else {
            thread::sleep(PAUSE);
            continue;
        };
        let connection = Connection { stream, _open: Open::new(&open) };
        if open.load(Ordering::Relaxed) > most {
            connection.refuse();
            continue;
        }
        let answer = Arc::clone(&answer);
        // Without a thread the connection is closed.
        drop(thread::Builder::new().name("browser".into()).spawn(move || answer(connection)));
    }
}

/// Counts an open connection.
struct Open(Arc<AtomicUsize>);

impl Open {
    fn new(open: &Arc<AtomicUsize>) -> Self {
        open.fetch_add(1, Ordering::Relaxed);
        Self(Arc::clone(open))
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// A connection of a browser.
pub struct Connection {
    stream: TcpStream,
    _open: Open,
}

/// The request of a browser.
#[derive(Debug, PartialEq, Eq)]
pub struct Request {
    /// The method, such as `GET`.
    pub method: String,
    /// The path, such as `/`.
    pub path: String,
    /// The host that it believes to be connected to.
    pub host: Option<String>,
    /// The site of the page that asks, if it is another one.
    pub origin: Option<String>,
    /// All bytes that were read.
    pub bytes: Vec<u8>,
    /// How many of them are the request. The others belong to what it asks for.
    pub length: usize,
}

impl Connection {
    /// Reads the request; `None` if it is none, or too long. A body is not read.
    ///
    /// # Errors
    /// The browser has gone, or takes too long.
    pub fn request(&mut self) -> io::Result<Option<Request>> {
        let end = Instant::now() + REQUEST_TIMEOUT;
        let (mut bytes, mut piece) = (Vec::new(), [0; 1024]);
        loop {
            match parse(&bytes) {
                Parsed::Whole(request) => return Ok(Some(request)),
                Parsed::Part if bytes.len() < MAX_REQUEST => {}
                Parsed::Part | Parsed::Invalid => {
                    self.respond("400 Bad Request", "text/plain; charset=utf-8", "this is no request for a page\n")?;
                    return Ok(None);
                }
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(ErrorKind::TimedOut.into());
            }
            self.stream.set_read_timeout(Some(left))?;
            match self.stream.read(&mut piece)? {
                0 => return Err(ErrorKind::UnexpectedEof.into()),
                count => bytes.extend_from_slice(&piece[..count]),
            }
        }
    }

    /// Sends a whole answer, and closes the connection.
    ///
    /// # Errors
    /// The browser has gone, or does not read.
    pub fn respond(&mut self, status: &str, content_type: &str, text: &str) -> io::Result<()> {
        let length = text.len();
        let head = format!(
            "HTTP/1.1 {status}\r\nContent-Type: {content_type}\r\nContent-Length: {length}\r\nCache-Control: no-store\r\n\
             Connection: close\r\n\r\n"
        );
        self.write_all(head.as_bytes())?;
        self.write_all(text.as_bytes())?;
        // The rest of the request is read for a while: closing on it would discard the answer.
        self.stream.shutdown(Shutdown::Write)?;
        let end = Instant::now() + CLOSE_TIMEOUT;
        let mut rest = [0; 4096];
        while let left = end.saturating_duration_since(Instant::now())
            && !left.is_zero()
        {
            self.stream.set_read_timeout(Some(left))?;
            if self.stream.read(&mut rest)? == 0 {
                break;
            }
        }
        Ok(())
    }

    /// The address of this machine that the browser has connected to.
    ///
    /// # Errors
    /// The browser has gone.
    pub fn local_address(&self) -> io::Result<SocketAddr> {
        self.stream.local_addr()
    }

    /// Relays a WebSocket between the browser and a server until either closes, or the browser does not read, or does not
    /// answer pings, for a while, or sends a message that is too long. `request` is what the browser has sent already. What
    /// the server has sent is reported once the browser has been sent it.
    ///
    /// # Errors
    /// The server cannot be reached, or a thread cannot be started.
    pub fn relay(
        self,
        server: SocketAddr,
        request: &Request,
        pings: Pings,
        report: impl FnMut(Relayed<'_>),
    ) -> io::Result<()> {
        let mut server = TcpStream::connect(server)?;
        server.write_all(&request.bytes)?;
        let browser = &self.stream;
        browser.set_read_timeout(Some(pings.timeout))?;
        browser.set_write_timeout(Some(SEND_TIMEOUT))?;
        browser.set_nodelay(true)?;
        server.set_nodelay(true)?;
        // An error ends the relay, as an end does. The other direction is ended, too.
        let end = || {
            let _ = browser.shutdown(Shutdown::Both);
            let _ = server.shutdown(Shutdown::Both);
        };
        thread::scope(|scope| {
            thread::Builder::new().spawn_scoped(scope, || {
                let _ = web_socket::copy_short_messages(browser, &server, &request.bytes[request.length..]);
                end();
            })?;
            let _ = web_socket::copy_with_pings(&server, browser, pings, report);
            end();
            Ok(())
        })
    }

    /// Refuses the connection without waiting for anything.
    fn refuse(mut self) {
        let busy = b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
        if self.stream.set_nonblocking(true).is_ok() {
            // There is nobody to report this to.
            let _ = self.stream.write(busy);
        }
    }
}

impl Write for Connection {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.set_write_timeout(Some(SEND_TIMEOUT))?;
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

enum Parsed {
    Whole(Request),
    Part,
    Invalid,
}

fn parse(bytes: &[u8]) -> Parsed {
    let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
    let mut request = httparse::Request::new(&mut headers);
    match request.parse(bytes) {
        Ok(httparse::Status::Partial) => Parsed::Part,
        Ok(httparse::Status::Complete(length)) => {
            let header = |name: &str| {
                let found = request.headers.iter().find(|header| header.name.eq_ignore_ascii_case(name));
                found.map(|header| String::from_utf8_lossy(header.value).into_owned())
            };
            Parsed::Whole(Request {
                method: request.method.unwrap_or_default().to_owned(),
                path: request.path.unwrap_or_default().to_owned(),
                host: header("Host"),
                origin: header("Origin"),
                bytes: bytes.to_vec(),
                length,
            })
        }
        Err(_) => Parsed::Invalid,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_parsed_once_it_is_whole() {
        let whole = b"GET /live HTTP/1.1\r\nhost: a.example\r\nContent-Length: 99999999999999\r\n\r\n";
        let Parsed::Whole(request) = parse(whole) else { panic!() };
        assert_eq!((request.method.as_str(), request.path.as_str()), ("GET", "/live"));
        assert_eq!((request.host.as_deref(), request.origin), (Some("a.example"), None));
        assert_eq!((request.length, request.bytes.as_slice()), (whole.len(), &whole[..]));
        let Parsed::Whole(request) = parse(&[whole, &b"more"[..]].concat()) else { panic!() };
        assert_eq!(&request.bytes[request.length..], b"more");
        assert!((0..whole.len()).all(|length| matches!(parse(&whole[..length]), Parsed::Part)));
        assert!(matches!(parse(b"\x16\x03\x01 hello"), Parsed::Invalid));
    }
}
