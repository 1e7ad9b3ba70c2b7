//! Senders that do not wait for answers, and what honest ones beside them notice, over the network.

use super::super::presence::{Presence, Role};
use super::super::sender::{Sender, SenderSettings};
use super::super::wire::from_bytes;
use super::super::zenoh_session::{join, peer_config};
use super::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use zenoh::handlers::FifoChannelHandler;
use zenoh::query::{Query, Reply};
use zenoh::{Session, Wait};

/// A test that waits for longer hangs.
const WATCHDOG: Duration = Duration::from_secs(60);
const FLOOD: usize = 300;

type Replies = FifoChannelHandler<Reply>;

fn endpoint() -> String {
    format!("tcp/127.0.0.1:{}", TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port())
}

fn session(connect: &[String], listen: &[String]) -> Session {
    join(peer_config(connect, listen, &[("scouting/multicast/enabled", "false")])).unwrap()
}

/// A receiver, and a session that forges batches for it.
struct World {
    endpoint: String,
    source: StageHarness,
    forger: Session,
    key: String,
    came: Vec<(u64, Vec<u8>)>,
}

impl World {
    fn new() -> Self {
        let endpoint = endpoint();
        let source = StageHarness::new(&source::kind(), &format!("listen = [\"{endpoint}\"]")).unwrap();
        let forger = session(std::slice::from_ref(&endpoint), &[]);
        let until = Instant::now() + WATCHDOG;
        let key = loop {
            let tokens = forger.liveliness().get("gridweave/bridge/*/receiver/*/*").wait().unwrap();
            if let Ok(token) = tokens.recv() {
                break token.result().unwrap().key_expr().to_string();
            }
            assert!(Instant::now() < until, "there is no receiver");
        };
        Self { endpoint, source, forger, key, came: Vec::new() }
    }

    fn ask(&self, bytes: Vec<u8>) -> Replies {
        let get = self.forger.get(&self.key).congestion_control(zenoh::qos::CongestionControl::Block);
        get.payload(bytes).timeout(2 * WATCHDOG).wait().unwrap()
    }

    /// One turn of the receiver.
    fn turn(&mut self) {
        self.source.node().wait(Duration::from_millis(5));
        self.source.node().advance().unwrap();
        for message in self.source.take_messages("other") {
            if message.header().flags.contains(MessageFlags::DATA) {
                self.came.push((message.header().log_time.0, message.bytes().to_vec()));
            }
        }
    }

    /// The answer to a query, for which the receiver turns.
    fn answer(&mut self, replies: &Replies) -> Answer {
        let until = Instant::now() + WATCHDOG;
        loop {
            if let Ok(Some(reply)) = replies.try_recv() {
                return from_bytes(&reply.result().unwrap().payload().to_bytes()).unwrap();
            }
            assert!(!replies.is_disconnected() && Instant::now() < until, "it was not answered");
            self.turn();
        }
    }
}

#[test]
fn batches_of_one_session_do_not_pile_up_while_the_receiver_is_busy() {
    let mut world = World::new();
    // Its bytes are as many as it expands to.
    let noise = |seed: usize| {
        let mut state = seed as u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 56) as u8
        };
        (0..100_000).map(|_| next()).collect::<Vec<u8>>()
    };
    let entry = |seed| Entry::new(0, &header("/robot1/pose", 1), Form::Whole, noise(seed));
    let asked: Vec<Replies> = (0..FLOOD).map(|seed| world.ask(forged(7, 1, Vec::new(), vec![entry(seed)]))).collect();
    let unreadable: Vec<Replies> = (0..FLOOD).map(|seed| world.ask(noise(seed))).collect();
    // The receiver has not turned yet, so none was answered.
    let until = Instant::now() + WATCHDOG;
    let (last, earlier) = asked.split_last().unwrap();
    let (last_unreadable, earlier_unreadable) = unreadable.split_last().unwrap();
    for replies in earlier.iter().chain(earlier_unreadable) {
        let left = until.saturating_duration_since(Instant::now());
        let reply = replies.recv_timeout(left);
        assert!(reply.is_err(), "the query has not ended: {reply:?}");
    }
    assert_eq!(world.answer(last).outcome, Outcome::Unknown);
    assert_eq!(world.answer(last_unreadable).outcome, Outcome::Unreadable);
    let counts = world.source.counts();
    assert_eq!(counts.get("batches left out, to be sent again"), Some(&(2 * FLOOD as u64 - 2)), "{counts:?}");
}

#[test]
fn a_warning_of_the_same_text_is_logged_once() {
    let mut world = World::new();
    let mut logged = Vec::new();
    for _ in 0..5 {
        let replies = world.ask(b"nonsense".to_vec());
        assert_eq!(world.answer(&replies).outcome, Outcome::Unreadable);
        logged.extend(world.source.node().take_unlogged());
    }
    assert_eq!(logged.len(), 1, "{logged:?}");
    assert!(logged[0].contains("cannot read a batch"), "{logged:?}");
    assert_eq!(world.source.warnings().get(&logged[0]), Some(&5));
}

#[test]
fn an_honest_sender_loses_nothing_beside_a_flood_of_one_session_and_of_many() {
    const MESSAGES: u64 = 200;
    let mut world = World::new();
    let wire = InputWire { port: "in", output: "other", ros_type: PoseStamped::NAME.to_owned(), ..Default::default() };
    let context = Context { inputs: vec![wire], ..Default::default() };
    let parameters = format!("connect = [\"{}\"]\nsender = \"honest\"\ninterval = 0.0", world.endpoint);
    let mut sink = StageHarness::with_context(&sink::kind(), &parameters, &context).unwrap();
    let (mut flood, mut given, mut forged_session) = (Vec::new(), 0, 1000);
    let until = Instant::now() + WATCHDOG;
    while (world.came.len() as u64) < MESSAGES {
        assert!(Instant::now() < until, "{} came; {:?}", world.came.len(), world.source.warnings());
        for _ in 0..20 {
            forged_session += 1;
            flood.push(world.ask(forged(7, 1, Vec::new(), Vec::new())));
            flood.push(world.ask(forged(forged_session, 1, Vec::new(), Vec::new())));
        }
        flood.retain(|replies| !replies.is_disconnected());
        if given < MESSAGES {
            for time in given..given + 20 {
                sink.give_message("in", Message::from_vec(header("/robot1/pose", time), vec![time as u8])).unwrap();
            }
            given += 20;
        }
        world.turn();
    }
    let expected: Messages = (0..MESSAGES).map(|time| (time, vec![time as u8])).collect();
    assert_eq!(world.came, expected);
    assert!(world.source.counts().contains_key("batches left out, to be sent again"));
}

#[test]
fn a_sender_sends_a_batch_that_was_left_out_again() {
    let endpoint = endpoint();
    let session = session(&[], std::slice::from_ref(&endpoint));
    let me = Presence { name: "base".into(), number: Presence::number_of(&session) };
    let key = me.key("base", Role::Receiver);
    let state = Arc::new((Mutex::new((Ingest::new(me.number, SECOND), Messages::new())), AtomicUsize::new(0)));
    let (of_queries, reply_key) = (Arc::clone(&state), key.clone());
    let take = move |query: Query| {
        let (state, asked) = &*of_queries;
        // Two of three are left out.
        if asked.fetch_add(1, Ordering::Relaxed) % 3 < 2 {
            return;
        }
        let mut state = state.lock().unwrap();
        let (taken, answer) = state.0.take(&query.payload().unwrap().to_bytes());
        state.1.extend(messages(&taken.items));
        let now = Clock::default().nanoseconds();
        let answer = Answer { came: now, answered: now, ..answer };
        query.reply(reply_key.as_str(), to_bytes(&answer).unwrap()).wait().unwrap();
    };
    let _queryable = session.declare_queryable(key).callback(take).wait().unwrap();
    let _token = me.declare(&session, "base", Role::Receiver).unwrap();

    let settings = SenderSettings {
        network: super::super::network::Network {
            bridge: "base".into(),
            connect: vec![endpoint],
            listen: Vec::new(),
            discover: false,
            zenoh_config: None,
            insecure: false,
            certificates: Default::default(),
        },
        name: "robot1".into(),
        limits: Limits { messages: 100, states: 100 },
        interval: Duration::ZERO,
        clock: Clock::default(),
        links: Err("there are none"),
    };
    let sender = Sender::start(settings, links(), None).unwrap();
    let mut expected = Messages::new();
    for time in 0..10 {
        sender.push(MAPS, &header("/robot1/map", time), &[time as u8; 100]).unwrap();
        expected.push((time, vec![time as u8; 100]));
    }
    assert_eq!(sender.end(WATCHDOG), None);
    assert_eq!(state.0.lock().unwrap().1, expected);
    assert!(state.1.load(Ordering::Relaxed) >= 6, "a handshake and a batch");
}

#[test]
fn what_waits_at_a_receiver_that_ends_is_not_answered() {
    let world = World::new();
    let replies = world.ask(forged(7, 0, links(), Vec::new()));
    drop(world.source);
    assert!(replies.recv_timeout(WATCHDOG).is_err());
    assert!(replies.is_disconnected());
}
