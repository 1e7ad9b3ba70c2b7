//! The servers of the Foxglove SDK: one for each client, so that it is known what has been sent to which.

use super::front::{PINGS, random_address};
use super::viewers::{ViewerNumber, Viewers};
use crate::browsers::{Connection, Request};
use foxglove::websocket::{ChannelView, Client, ServerListener};
use foxglove::{WebSocketServer, WebSocketServerHandle};
use std::collections::BTreeMap;
use std::io;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

/// The servers of all clients.
#[derive(Clone)]
pub(super) struct Servers {
    /// The served channels.
    channels: Arc<foxglove::Context>,
    viewers: Viewers,
    /// The maximum number of messages in the queue of a client.
    backlog: usize,
    /// A client that comes again sees by it that the run is the same.
    session: String,
    /// `None` after the end.
    open: Arc<Mutex<Option<BTreeMap<ViewerNumber, WebSocketServerHandle>>>>,
}

impl Servers {
    pub(super) fn new(channels: Arc<foxglove::Context>, viewers: Viewers, backlog: usize) -> Self {
        let session = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_millis().to_string();
        Self { channels, viewers, backlog, session, open: Arc::new(Mutex::new(Some(BTreeMap::new()))) }
    }

    /// Serves a client until it leaves.
    ///
    /// # Errors
    /// The server cannot be started, or reached.
    pub(super) fn serve(&self, client: Connection, request: &Request) -> io::Result<()> {
        let number = self.viewers.enter();
        let result = self.relay(number, client, request);
        // Now the queue of the client is gone.
        self.viewers.leave(number);
        result
    }

    fn relay(&self, number: ViewerNumber, client: Connection, request: &Request) -> io::Result<()> {
        let address = random_address()?;
        let server = WebSocketServer::new()
            .name("gridweave")
            .session_id(&self.session)
            .context(&self.channels)
            .listener(Arc::new(Subscriptions { viewers: self.viewers.clone(), number }))
            .message_backlog_size(self.backlog)
            .bind(address.to_string(), 0)
            .start_blocking()
            .map_err(io::Error::other)
            .inspect_err(|error| tracing::warn!("a viewer cannot be served: {error}"))?;
        let inner = (address, server.port()).into();
        match self.lock().as_mut() {
            Some(open) => open.insert(number, server),
            None => {
                drop(server.stop());
                return Ok(());
            }
        };
        let result = client.relay(inner, request, PINGS, |what| self.viewers.relayed(number, &what));
        let server = self.lock().as_mut().and_then(|open| open.remove(&number));
        if let Some(server) = server {
            // Its connection is closed, so it ends soon.
            server.stop().wait_blocking();
        }
        result
    }

    /// Closes all connections, and lets in no more.
    pub(super) fn close(&self) {
        for server in self.lock().take().into_iter().flat_map(BTreeMap::into_values) {
            // Does not wait for clients: one that does not read could block the end of the run.
            drop(server.stop());
        }
    }

    fn lock(&self) -> MutexGuard<'_, Option<BTreeMap<ViewerNumber, WebSocketServerHandle>>> {
        // The servers are consistent between any two changes.
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Hears of the subscriptions of a viewer.
struct Subscriptions {
    viewers: Viewers,
    number: ViewerNumber,
}

impl ServerListener for Subscriptions {
    fn on_subscribe(&self, client: Client, channel: ChannelView<'_>) {
        self.viewers.subscribe(self.number, client.sink_id(), channel.id());
    }

    fn on_unsubscribe(&self, client: Client, channel: ChannelView<'_>) {
        self.viewers.unsubscribe(self.number, client.sink_id(), channel.id());
    }
}

#[cfg(test)]
mod tests {
    use super::super::front;
    use super::*;
    use foxglove::{ChannelBuilder, Context, RawChannel};
    use std::io::{Read, Write};
    use std::net::TcpStream;
    use std::time::Duration;

    /// Larger than what the system keeps of a connection.
    const MAP: usize = 30 << 20;

    struct Viewer(TcpStream);

    impl Viewer {
        fn connect(address: std::net::SocketAddr) -> Self {
            let mut stream = TcpStream::connect(address).unwrap();
            stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
            let request = "GET / HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
                           Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\
                           Sec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n";
            stream.write_all(request.as_bytes()).unwrap();
            let mut head = Vec::new();
            while !head.ends_with(b"\r\n\r\n") {
                head.push(0);
                let last = head.len() - 1;
                stream.read_exact(&mut head[last..]).unwrap();
            }
            assert!(head.starts_with(b"HTTP/1.1 101"), "{}", String::from_utf8_lossy(&head));
            Self(stream)
        }

        fn say(&mut self, text: &str) {
            let length = u8::try_from(text.len()).unwrap();
            assert!(length < 126);
            self.0.write_all(&[&[0x81, 0x80 | length, 0, 0, 0, 0], text.as_bytes()].concat()).unwrap();
        }

        fn subscribe(&mut self, subscription: u8, channel: &RawChannel) {
            let channel = u64::from(channel.id());
            self.say(&format!(
                r#"{{"op":"subscribe","subscriptions":[{{"id":{subscription},"channelId":{channel}}}]}}"#
            ));
        }

        fn unsubscribe(&mut self, subscription: u8) {
            self.say(&format!(r#"{{"op":"unsubscribe","subscriptionIds":[{subscription}]}}"#));
        }

        /// The next message: the number of its subscription, and its length.
        fn message(&mut self) -> (u8, usize) {
            loop {
                let mut head = [0; 2];
                self.0.read_exact(&mut head).unwrap();
                let count = match head[1] {
                    126 => 2,
                    127 => 8,
                    _ => 0,
                };
                let mut more = [0; 8];
                self.0.read_exact(&mut more[8 - count..]).unwrap();
                let length = if count == 0 { usize::from(head[1]) } else { u64::from_be_bytes(more) as usize };
                let mut content = vec![0; length];
                self.0.read_exact(&mut content).unwrap();
                if head[0] == 0x82 {
                    return (content[1], length - 13);
                }
            }
        }
    }

    #[test]
    fn a_viewer_that_subscribes_again_and_again_gets_no_copy_for_each() {
        let (channels, viewers) = (Context::new(), Viewers::default());
        let channel = |topic: &str| ChannelBuilder::new(topic).message_encoding("x").context(&channels).build_raw();
        let (map, end) = (channel("/map").unwrap(), channel("/end").unwrap());
        viewers.send(&map, true, 1, &vec![0; MAP]);
        viewers.send(&end, true, 2, b"end");
        let servers = Servers::new(channels.clone(), viewers.clone(), 256);
        let serving = servers.clone();
        let front = front::start("127.0.0.1", 0, Vec::new(), move |client, request| serving.serve(client, request));
        let front = front.unwrap();
        let mut viewer = Viewer::connect(front.address());
        for _ in 0..50 {
            viewer.subscribe(1, &map);
            viewer.unsubscribe(1);
        }
        viewer.subscribe(2, &end);
        let mut maps = 0;
        loop {
            match viewer.message() {
                (1, MAP) => maps += 1,
                other => break assert_eq!(other, (2, 3)),
            }
        }
        assert!(maps <= 2, "{maps} maps were queued");
        viewer.subscribe(3, &map);
        assert_eq!(viewer.message(), (3, MAP), "one that reads gets it again");
        servers.close();
        let mut rest = Vec::new();
        // It may be reset.
        let _ = viewer.0.read_to_end(&mut rest);
        assert!(TcpStream::connect(front.address()).is_ok(), "only the end of the front closes the port");
    }
}
