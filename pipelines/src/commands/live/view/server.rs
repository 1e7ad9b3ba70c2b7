//! Server of the page and of its changes for browsers.
//!
//! Changes are server-sent events. Each browser has a thread, which sends it the last change, and the next one once it
//! has taken that. So a slow browser gets fewer changes, and does not delay the others.

use anyhow::{Result, anyhow};
use gridweave_logs::browsers::{BrowserServer, Connection};
use std::io::{self, Write};
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Without changes a browser is sent an empty line at this interval, which detects that it has gone.
const HEARTBEAT: Duration = Duration::from_secs(5);

/// The maximum number of connections. A browser opens up to six.
const MAX_CONNECTIONS: usize = 64;

/// Server of one page.
pub(super) struct PageServer {
    server: BrowserServer,
    shared: Arc<Shared>,
}

/// State that all threads share.
struct Shared {
    page: String,
    latest: Mutex<Latest>,
    changed: Condvar,
}

/// The last change.
#[derive(Default)]
struct Latest {
    /// Number of changes so far.
    number: u64,
    change: Arc<str>,
    has_ended: bool,
    /// Number of connected browsers.
    browsers: usize,
}

impl PageServer {
    /// Starts to serve a page on an address.
    ///
    /// # Errors
    /// The address cannot be bound.
    pub(super) fn start(address: SocketAddr, page: String) -> Result<Self> {
        let failed = |error: &dyn std::fmt::Display| {
            anyhow!("cannot serve the page on {address}: {error}; choose another address with --address HOST:PORT")
        };
        let shared = Arc::new(Shared { page, latest: Mutex::default(), changed: Condvar::new() });
        let serving = Arc::clone(&shared);
        // An error of one browser does not affect the others.
        let answer = move |browser| drop(serving.answer(browser));
        let server = BrowserServer::start(address, MAX_CONNECTIONS, answer).map_err(|error| failed(&error))?;
        Ok(Self { server, shared })
    }

    /// The address of the page.
    pub(super) fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// Whether a browser is connected.
    pub(super) fn is_watched(&self) -> bool {
        self.shared.lock().browsers > 0
    }

    /// Sends a change, in one line, to all browsers.
    pub(super) fn show(&mut self, change: &str) {
        let mut latest = self.shared.lock();
        latest.number += 1;
        latest.change = change.into();
        drop(latest);
        self.shared.changed.notify_all();
    }

    /// Sends the end to all browsers, and waits until they have taken it, at most for `timeout`.
    pub(super) fn end(&mut self, timeout: Duration) {
        let mut latest = self.shared.lock();
        latest.has_ended = true;
        self.shared.changed.notify_all();
        let end = Instant::now() + timeout;
        while latest.browsers > 0
            && let left = end.saturating_duration_since(Instant::now())
            && !left.is_zero()
        {
            latest = match self.shared.changed.wait_timeout(latest, left) {
                Ok((latest, _)) => latest,
                Err(poisoned) => poisoned.into_inner().0,
            };
        }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, Latest> {
        // A panic cannot leave it half changed.
        self.latest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn answer(&self, mut browser: Connection) -> io::Result<()> {
        const TEXT: &str = "text/plain; charset=utf-8";
        let Some(request) = browser.request()? else { return Ok(()) };
        let address = browser.local_address()?;
        // Guards against DNS rebinding: a foreign page must not read a server that is bound to this machine only.
        if !request.host.is_none_or(|host| is_own_name(&host, address)) {
            return browser.respond("403 Forbidden", TEXT, "wrong host\n");
        }
        match (request.method.as_str(), request.path.as_str()) {
            ("GET", "/") => browser.respond("200 OK", "text/html; charset=utf-8", &self.page),
            ("GET", "/live") => self.send_changes(&mut browser),
            ("GET", _) => browser.respond("404 Not Found", TEXT, "not found: only / is served\n"),
            _ => browser.respond("405 Method Not Allowed", TEXT, "only GET is served\n"),
        }
    }

    /// Sends changes to a browser until the end, or until it has gone.
    fn send_changes(&self, browser: &mut dyn Write) -> io::Result<()> {
        self.lock().browsers += 1;
        let sent = self.send_each_change(browser);
        self.lock().browsers -= 1;
        self.changed.notify_all();
        sent
    }

    fn send_each_change(&self, browser: &mut dyn Write) -> io::Result<()> {
        browser.write_all(
            b"HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n",
        )?;
        browser.flush()?;
        let mut sent = 0;
        loop {
            let (number, change, has_ended) = self.wait_for_change(sent);
            if number > sent {
                browser.write_all(format!("event: change\ndata: {change}\n\n").as_bytes())?;
                sent = number;
            } else if has_ended {
                browser.write_all(b"event: end\ndata:\n\n")?;
                return browser.flush();
            } else {
                browser.write_all(b":\n\n")?;
            }
            browser.flush()?;
        }
    }

    /// Waits for a change after the given one, the end, or the time of a heartbeat. Returns the last change.
    fn wait_for_change(&self, sent: u64) -> (u64, Arc<str>, bool) {
        let nothing_new = |latest: &mut Latest| latest.number <= sent && !latest.has_ended;
        let latest = match self.changed.wait_timeout_while(self.lock(), HEARTBEAT, nothing_new) {
            Ok((latest, _)) => latest,
            Err(poisoned) => poisoned.into_inner().0,
        };
        (latest.number, Arc::clone(&latest.change), latest.has_ended)
    }
}

/// Whether the host of a request is an address or a name of this machine.
fn is_own_name(host: &str, address: SocketAddr) -> bool {
    let suffix = format!(":{}", address.port());
    let name = host.strip_suffix(suffix.as_str()).unwrap_or(host);
    let name = name.strip_prefix('[').and_then(|name| name.strip_suffix(']')).unwrap_or(name);
    name.eq_ignore_ascii_case("localhost") || name.parse::<IpAddr>().is_ok() || !address.ip().is_loopback()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader, Read};
    use std::net::TcpStream;

    fn ask(server: &PageServer, path: &str, host: &str) -> BufReader<TcpStream> {
        let mut stream = TcpStream::connect(server.address()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let _ = write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n");
        BufReader::new(stream)
    }

    fn answer(server: &PageServer, path: &str, host: &str) -> String {
        let mut text = String::new();
        // A refused connection may be closed before the request was read.
        let _ = ask(server, path, host).read_to_string(&mut text);
        text
    }

    fn server() -> PageServer {
        PageServer::start("127.0.0.1:0".parse().unwrap(), "<p>page</p>".to_owned()).unwrap()
    }

    /// The next line that is neither empty nor a heartbeat.
    fn line(events: &mut BufReader<TcpStream>) -> String {
        loop {
            let mut line = String::new();
            assert_ne!(events.read_line(&mut line).unwrap(), 0, "it has ended");
            if !line.trim().is_empty() && !line.starts_with(':') {
                return line.trim_end().to_owned();
            }
        }
    }

    #[test]
    fn the_page_is_served_and_nothing_else() {
        let server = server();
        assert!(answer(&server, "/", "localhost").ends_with("<p>page</p>"));
        assert!(answer(&server, "/etc/passwd", "localhost").starts_with("HTTP/1.1 404"));
        assert!(answer(&server, "/", "elsewhere.example").starts_with("HTTP/1.1 403"));
    }

    #[test]
    fn a_browser_gets_the_last_change_then_each_next_one_and_the_end() {
        let mut server = server();
        server.show("one");
        server.show("two");
        let mut events = ask(&server, "/live", "127.0.0.1");
        while line(&mut events) != "event: change" {}
        assert_eq!(line(&mut events), "data: two");
        assert!(server.is_watched());
        server.show("three");
        assert_eq!([line(&mut events), line(&mut events)], ["event: change", "data: three"]);
        server.end(Duration::from_secs(60));
        assert_eq!(line(&mut events), "event: end");
        assert!(!server.is_watched());
    }

    #[test]
    fn a_browser_that_does_not_read_does_not_delay_others() {
        let mut server = server();
        let _halted = ask(&server, "/live", "localhost");
        let large = "x".repeat(1 << 22);
        let mut events = ask(&server, "/live", "localhost");
        while line(&mut events) != "Connection: close" {}
        for _ in 0..20 {
            server.show(&large);
            assert_eq!(line(&mut events), "event: change");
            assert_eq!(line(&mut events).len(), "data: ".len() + large.len());
        }
        server.end(Duration::ZERO);
        assert_eq!(line(&mut events), "event: end");
    }

    #[test]
    fn a_body_of_any_claimed_length_is_not_read() {
        let server = server();
        for host in ["localhost", "evil.example"] {
            let mut stream = TcpStream::connect(server.address()).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
            write!(stream, "GET / HTTP/1.1\r\nHost: {host}\r\nContent-Length: 99999999999999\r\n\r\n").unwrap();
            let mut text = String::new();
            stream.read_to_string(&mut text).unwrap();
            assert_eq!(text.starts_with("HTTP/1.1 200"), host == "localhost", "{text}");
        }
        let mut long = TcpStream::connect(server.address()).unwrap();
        long.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        let header = format!("X: {}\r\n", "x".repeat(1000));
        write!(long, "GET / HTTP/1.1\r\n{}", header.repeat(30)).unwrap();
        let mut text = String::new();
        // The rest of what was sent may be refused.
        let _ = long.read_to_string(&mut text);
        assert!(text.is_empty() || text.starts_with("HTTP/1.1 400"), "{text}");
        assert!(answer(&server, "/", "localhost").ends_with("<p>page</p>"));
    }

    #[test]
    fn connections_beyond_a_limit_are_refused_until_others_have_gone() {
        let server = server();
        let half_open: Vec<TcpStream> = (0..200).map(|_| TcpStream::connect(server.address()).unwrap()).collect();
        assert!(!answer(&server, "/", "localhost").contains("page"));
        drop(half_open);
        let deadline = Instant::now() + Duration::from_secs(60);
        while !answer(&server, "/", "localhost").ends_with("<p>page</p>") {
            assert!(Instant::now() < deadline, "the connections have gone");
        }
    }

    #[test]
    fn an_address_in_use_is_an_error() {
        let first = server();
        let error = PageServer::start(first.address(), String::new()).err().unwrap().to_string();
        assert!(error.contains(&first.address().to_string()) && error.contains("--address"), "{error}");
    }

    #[test]
    fn a_server_for_other_machines_may_have_any_name() {
        let [own, open] = ["127.0.0.1:80", "0.0.0.0:80"].map(|address| address.parse().unwrap());
        assert!(is_own_name("[::1]:80", own) && is_own_name("LocalHost:80", own) && !is_own_name("a.example", own));
        assert!(is_own_name("robot.local:80", open));
    }
}
