//! The front of the Foxglove server: it lets in a limited number of clients, and no pages of foreign sites.
//!
//! A browser lets any page open a WebSocket to this machine, so a server that does not check the site of the page shows
//! the run to each page that the user visits. The servers of the Foxglove SDK check nothing; so they listen on
//! addresses of this machine that a page cannot guess, and clients are relayed to them once they have been checked.

use crate::browsers::{BrowserServer, Connection, Pings, Request};
use gridweave_runtime::message::shortened;
use std::collections::BTreeSet;
use std::io;
use std::net::{IpAddr, Ipv4Addr};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// The maximum number of clients.
const MAX_CLIENTS: usize = 32;
/// A client that is not there is noticed after three pings without an answer.
pub(super) const PINGS: Pings = Pings { interval: Duration::from_secs(15), timeout: Duration::from_secs(50) };
/// The site of the app.
const APP: &str = "foxglove.dev";
/// The maximum number of sites that are named in warnings: a page can ask without end, and a program can name any.
const MOST_NAMED: usize = 10;

/// Starts the front on `host` and `port`, which has each client served that is let in. Pages of `sites` are, too.
///
/// # Errors
/// The address cannot be bound.
pub(super) fn start(
    host: &str,
    port: u16,
    sites: Vec<String>,
    serve: impl Fn(Connection, &Request) -> io::Result<()> + Send + Sync + 'static,
) -> io::Result<BrowserServer> {
    // A name of IPv6 is in brackets in a URL.
    let host = host.trim_start_matches('[').trim_end_matches(']');
    let refused = RefusedSites::default();
    BrowserServer::start((host, port), MAX_CLIENTS, move |client| {
        // A client that has gone is no failure.
        let _ = let_in(client, &sites, &refused, &serve);
    })
}

/// A random address of this machine, of the 16 million that there are.
pub(super) fn random_address() -> io::Result<Ipv4Addr> {
    let mut bytes = [0; 3];
    rustix::rand::getrandom(&mut bytes, rustix::rand::GetRandomFlags::empty())?;
    let [second, third, fourth] = bytes;
    // Neither the address of the network nor that for all.
    Ok(Ipv4Addr::new(127, second, third, fourth.clamp(1, 254)))
}

fn let_in(
    mut client: Connection,
    sites: &[String],
    refused: &RefusedSites,
    serve: impl Fn(Connection, &Request) -> io::Result<()>,
) -> io::Result<()> {
    let Some(request) = client.request()? else { return Ok(()) };
    let own = client.local_address()?.ip();
    match &request.origin {
        Some(origin) if !is_trusted(origin, own, sites) => {
            if let Some(warning) = refused.warning(origin) {
                tracing::warn!("{warning}");
            }
            client.respond("403 Forbidden", "text/plain; charset=utf-8", "wrong origin\n")
        }
        _ => serve(client, &request),
    }
}

/// The sites that have been named in warnings.
#[derive(Default)]
struct RefusedSites(Mutex<BTreeSet<String>>);

impl RefusedSites {
    /// The warning that a page of a site was refused, if there is to be another one.
    fn warning(&self, origin: &str) -> Option<String> {
        // The name is what a client claims: of any length, and with any characters.
        let site = shortened(origin).escape_debug().to_string();
        let mut named = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let is_new = named.len() < MOST_NAMED && named.insert(site.clone());
        is_new.then(|| {
            format!("a page of {site} was refused: `origins` of `foxglove_sink` lists the sites that may connect")
        })
    }
}

/// Whether a page of a site may connect to this machine at `own`: one of this machine, of the app, or of the listed
/// `sites`; or an app that is no page of a site.
fn is_trusted(origin: &str, own: IpAddr, sites: &[String]) -> bool {
    if sites.iter().any(|site| site.trim_end_matches('/').eq_ignore_ascii_case(origin)) {
        return true;
    }
    // A page that hides its site has the origin `null`.
    let Some((scheme, rest)) = origin.split_once("://") else { return false };
    if !["http", "https"].iter().any(|web| scheme.eq_ignore_ascii_case(web)) {
        return true;
    }
    let host = match rest.strip_prefix('[').map(|rest| rest.split_once(']')) {
        Some(Some((host, port))) if port.is_empty() || port.starts_with(':') => host,
        Some(_) => "",
        None => rest.split(':').next().unwrap_or_default(),
    };
    let host = host.to_ascii_lowercase();
    let is_app = host == APP || host.strip_suffix(APP).is_some_and(|host| host.ends_with('.'));
    let is_own = host.parse::<IpAddr>().is_ok_and(|address| address.is_loopback() || address == own);
    host == "localhost" || is_own || is_app && scheme.eq_ignore_ascii_case("https")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read, Write};
    use std::net::{SocketAddr, TcpListener, TcpStream};

    #[test]
    fn pages_of_this_machine_and_of_the_app_are_trusted_and_others_are_not() {
        let own = IpAddr::from([192, 168, 1, 5]);
        let sites = ["https://viewer.example/".to_owned()];
        let trusted = [
            "http://localhost:8080",
            "http://127.0.0.1",
            "http://[::1]:80",
            "http://192.168.1.5:9000",
            "https://app.foxglove.dev",
            "https://viewer.example",
            "file://",
        ];
        assert!(trusted.iter().all(|origin| is_trusted(origin, own, &sites)));
        let foreign = [
            "https://evil.example",
            "null",
            "",
            "http://192.168.1.6",
            "https://foxglove.dev.evil.example",
            "https://evilfoxglove.dev",
            "http://localhost.evil.example",
            "http://[::1].evil.example",
            "http://app.foxglove.dev",
        ];
        assert!(foreign.iter().all(|origin| !is_trusted(origin, own, &sites)));
    }

    #[test]
    fn a_refused_site_is_named_once_and_its_name_is_short_and_visible() {
        let refused = RefusedSites::default();
        let warning = refused.warning("https://evil.example").unwrap();
        assert!(warning.starts_with("a page of https://evil.example was refused"), "{warning}");
        assert_eq!(refused.warning("https://evil.example"), None);
        let warning = refused.warning(&format!("https://\u{202e}\u{1b}[2J{}", "x".repeat(9000))).unwrap();
        assert!(warning.len() < 400 && !warning.contains(['\u{202e}', '\u{1b}']), "{warning}");
        assert!((0..1000).filter_map(|number| refused.warning(&format!("https://{number}.example"))).count() < 10);
    }

    fn relay_to(inner: &TcpListener, pings: Pings) -> BrowserServer {
        let inner = inner.local_addr().unwrap();
        let serve = move |client: Connection, request: &Request| client.relay(inner, request, pings, |_| {});
        start("127.0.0.1", 0, Vec::new(), serve).unwrap()
    }

    /// The answer to a request with an origin.
    fn answer(address: SocketAddr, origin: &str) -> String {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        write!(stream, "GET / HTTP/1.1\r\nHost: a\r\nOrigin: {origin}\r\nUpgrade: websocket\r\n\r\n").unwrap();
        let mut text = String::new();
        stream.read_to_string(&mut text).unwrap();
        text
    }

    #[test]
    fn a_trusted_client_is_relayed_and_a_foreign_page_is_not() {
        let inner = TcpListener::bind("127.0.0.1:0").unwrap();
        let front = relay_to(&inner, PINGS);
        let server = std::thread::spawn(move || {
            let (mut client, _) = inner.accept().unwrap();
            let mut request = [0; 1024];
            let length = client.read(&mut request).unwrap();
            client.write_all(b"relayed").unwrap();
            String::from_utf8_lossy(&request[..length]).into_owned()
        });
        assert!(answer(front.address(), "https://evil.example").starts_with("HTTP/1.1 403"));
        assert_eq!(answer(front.address(), "http://localhost"), "relayed");
        assert!(server.join().unwrap().contains("Origin: http://localhost"));
        let address = front.address();
        drop(front);
        let is_closed = || TcpStream::connect(address).is_err();
        assert!((0..1_000_000).any(|_| is_closed()), "the port is closed");
        assert_ne!(random_address().unwrap(), random_address().unwrap());
    }

    /// A front for a server that starts a WebSocket and sends one frame, with the connection of that server to its client,
    /// and a client.
    fn web_socket(pings: Pings) -> (BrowserServer, TcpStream, TcpStream) {
        let inner = TcpListener::bind("127.0.0.1:0").unwrap();
        let front = relay_to(&inner, pings);
        let mut client = TcpStream::connect(front.address()).unwrap();
        client.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        client.write_all(b"GET / HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\n\r\n").unwrap();
        let (mut server, _) = inner.accept().unwrap();
        server.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        server.write_all(b"HTTP/1.1 101 Switching Protocols\r\n\r\n\x82\x03abc").unwrap();
        (front, server, client)
    }

    #[test]
    fn a_client_that_answers_no_ping_is_closed() {
        let soon = Duration::from_millis(1);
        let (_front, mut server, mut client) = web_socket(Pings { interval: soon, timeout: soon });
        let mut all = Vec::new();
        // It may be reset, since the answer to nothing is not read.
        let _ = client.read_to_end(&mut all);
        let mut rest = Vec::new();
        server.read_to_end(&mut rest).unwrap();
        assert!(rest.ends_with(b"\r\n\r\n"), "the server receives the end");
    }

    #[test]
    fn a_client_that_answers_pings_stays() {
        let pings = Pings { interval: Duration::from_millis(1), timeout: Duration::from_secs(60) };
        let (_front, mut server, mut client) = web_socket(pings);
        let mut head = [0; 36];
        client.read_exact(&mut head).unwrap();
        assert!(head.ends_with(b"\r\n\r\n"));
        let mut frames = Vec::new();
        while frames.iter().filter(|frame| **frame == [0x89, 0]).count() < 10 {
            let mut start = [0; 2];
            client.read_exact(&mut start).unwrap();
            let mut content = vec![0; usize::from(start[1])];
            client.read_exact(&mut content).unwrap();
            frames.push([&start[..], &content].concat());
            client.write_all(&[0x8a, 0x80, 0, 0, 0, 0]).unwrap();
        }
        assert_eq!(frames.iter().filter(|frame| **frame == *b"\x82\x03abc").count(), 1, "frames are whole");
        drop(client);
        let mut rest = Vec::new();
        server.read_to_end(&mut rest).unwrap();
        assert!(rest.windows(2).any(|bytes| bytes == [0x8a, 0x80]), "answers pass");
    }

    #[test]
    fn a_client_that_sends_a_message_without_end_is_closed() {
        let (_front, mut server, mut client) = web_socket(PINGS);
        let sender = std::thread::spawn(move || {
            // Fragments of 64 kB, none of which is the last. They fail once the connection is closed.
            let fragment = [&[0x01, 0xff][..], &65_536_u64.to_be_bytes(), &[0; 4], &[b' '; 65_536]].concat();
            (0..1000).take_while(|_| client.write_all(&fragment).is_ok()).count()
        });
        let mut received = Vec::new();
        server.read_to_end(&mut received).unwrap();
        assert!(received.len() < 1 << 20, "{}", received.len());
        assert!(sender.join().unwrap() < 1000);
    }
}
