//! An outbox and an ingest with a network between them that loses, repeats and delays.

mod floods;

use super::clock::Clock;
use super::difference::difference;
use super::ingest::{Ingest, Item, Taken};
use super::outbox::{Limits, Outbox};
use super::wire::{Answer, Batch, Entry, Form, Link, Outcome, to_bytes};
use super::{sink, source};
use gridweave_runtime::message::{FixedText, LogTime, Message, MessageFlags, MessageHeader};
use gridweave_runtime::ros::{OccupancyGrid, PoseStamped, RosMessage};
use gridweave_runtime::stage::{Context, InputWire, StageHarness};
use proptest::prelude::*;
use std::net::TcpListener;
use std::time::{Duration, Instant};

const MAPS: usize = 0;
const POSES: usize = 1;
const SECOND: i64 = 1_000_000_000;

fn links() -> Vec<Link> {
    let link = |port: &str, ros_type: &str| Link { port: port.to_owned(), ros_type: ros_type.to_owned() };
    vec![link("map", OccupancyGrid::NAME), link("pose", PoseStamped::NAME)]
}

fn outbox(session: u64, states: usize) -> Outbox {
    Outbox::new("robot1".into(), session, links(), Limits { messages: 5, states })
}

fn header(topic: &str, time: u64) -> MessageHeader {
    MessageHeader {
        log_time: LogTime(time),
        publish_time: time,
        channel: 3,
        log_sequence: time as u32,
        robot: FixedText::new("robot1").unwrap(),
        topic: FixedText::new(topic).unwrap(),
        ..Default::default()
    }
}

/// The log times and the bytes of messages.
type Messages = Vec<(u64, Vec<u8>)>;

fn messages(items: &[Item]) -> Messages {
    let message = |item: &Item| match item {
        Item::Message { header, bytes, .. } => Some((header.log_time.0, bytes.clone())),
        Item::Channel { .. } => None,
    };
    items.iter().filter_map(message).collect()
}

/// Lets the batches through until there are none.
fn carry(outbox: &mut Outbox, ingest: &mut Ingest, offset: i64) -> Taken {
    let mut all = Taken::default();
    while let Some(batch) = outbox.batch().unwrap() {
        let (taken, answer) = ingest.take(batch);
        outbox.answered(&answer, Some(offset)).unwrap();
        all.items.extend(taken.items);
        all.dropped += taken.dropped;
        all.is_end |= taken.is_end;
        all.clock = taken.clock.or(all.clock);
    }
    all
}

/// A batch of a forged sender.
fn forged(session: u64, number: u64, links: Vec<Link>, entries: Vec<Entry>) -> Vec<u8> {
    let batch = Batch {
        sender: "forged".into(),
        session,
        handshake: 1,
        number,
        receiver: if number == 0 { 0 } else { 1 },
        clock_offset: 0,
        dropped: 0,
        is_end: false,
        links,
        entries,
    };
    to_bytes(&batch).unwrap()
}

#[test]
fn what_a_few_bytes_expand_to_is_limited_for_a_batch_and_for_all_senders() {
    const LARGE: usize = 100 << 20;
    let mut ingest = Ingest::new(1, SECOND);
    let large = difference(&[], &vec![0; LARGE]).unwrap();
    let entry = |topic: &str| Entry::new(MAPS as u32, &header(topic, 1), Form::Beginning, large.clone());
    let outcome = |ingest: &mut Ingest, bytes: &[u8]| {
        let (taken, answer) = ingest.take(bytes);
        (answer.outcome, taken.items.len(), taken.wrong.unwrap_or_default())
    };
    let handshake = |session| forged(session, 0, links(), Vec::new());
    ingest.announce(1);
    assert_eq!(outcome(&mut ingest, &handshake(1)).0, Outcome::Taken);
    // A batch in which each of a thousand entries expands to a large message.
    let many = forged(1, 1, Vec::new(), (0..1000).map(|number| entry(&format!("/{number}"))).collect());
    let (outcome_of_many, items, wrong) = outcome(&mut ingest, &many);
    assert_eq!((outcome_of_many, items), (Outcome::Unreadable, 0));
    assert!(wrong.contains("expands to"), "{wrong}");
    // Batches of which each has one, kept for the next difference.
    let mut taken = 0;
    for session in 2..12 {
        ingest.announce(session);
        assert_eq!(outcome(&mut ingest, &handshake(session)).0, Outcome::Taken);
        let (outcome, _, wrong) = outcome(&mut ingest, &forged(session, 1, Vec::new(), vec![entry("/map")]));
        taken += usize::from(outcome == Outcome::Taken);
        assert!(outcome == Outcome::Taken || wrong.contains("too many large messages"), "{wrong}");
    }
    assert_eq!(taken, 5, "512 MB of them");
    // Invented senders without end, which leave room for announced ones.
    let full = (20..2000).filter(|session| outcome(&mut ingest, &handshake(*session)).0 != Outcome::Taken).count();
    assert!(full > 1800, "{full}");
    ingest.announce(2000);
    assert_eq!(outcome(&mut ingest, &handshake(2000)).0, Outcome::Taken);
    ingest.forget(2000);
    assert_eq!(outcome(&mut ingest, &handshake(2000)).0, Outcome::Unreadable);
    // Links without end.
    let links = vec![Link::default(); 100_000];
    assert_eq!(outcome(&mut Ingest::new(1, SECOND), &forged(1, 0, links, Vec::new())).0, Outcome::Unreadable);
}

#[test]
fn messages_beyond_the_limit_are_dropped_and_reported_at_both_ends() {
    let (mut outbox, mut ingest) = (outbox(7, 3), Ingest::new(1, SECOND));
    for time in 0..9 {
        outbox.push(POSES, &header("/robot1/pose", time), &[time as u8]).unwrap();
        outbox.push(MAPS, &header("/robot1/map", 100 + time), &[time as u8; 50]).unwrap();
    }
    // Of five poses the last, and of maps those that came after all that waited went.
    let taken = carry(&mut outbox, &mut ingest, 0);
    let times: Vec<u64> = messages(&taken.items).iter().map(|(time, _)| *time).collect();
    assert_eq!(times, [4, 5, 6, 106, 7, 107, 8, 108]);
    assert_eq!(messages(&taken.items)[3].1, [6; 50]);
    assert_eq!((taken.dropped, outbox.totals().dropped, outbox.totals().sent), (10, 10, 8));
}

#[test]
fn an_end_is_said_once_all_is_taken() {
    let (mut outbox, mut ingest) = (outbox(7, 3), Ingest::new(1, SECOND));
    outbox.push(POSES, &header("/robot1/pose", 1), &[1]).unwrap();
    assert!(!carry(&mut outbox, &mut ingest, 0).is_end);
    outbox.push(POSES, &header("/robot1/pose", 2), &[2]).unwrap();
    outbox.end();
    assert_eq!((outbox.is_done(), outbox.unacknowledged()), (false, 1));
    assert!(carry(&mut outbox, &mut ingest, 0).is_end);
    assert_eq!((outbox.is_done(), outbox.unacknowledged()), (true, 0));
}

#[test]
fn a_receiver_that_begins_anew_gets_what_waits_and_the_last_of_each_topic() {
    let (mut outbox, mut first) = (outbox(7, 10), Ingest::new(1, SECOND));
    outbox.announce(MAPS, 3, gridweave_runtime::message::Channel::default().encode().unwrap());
    outbox.push(MAPS, &header("/robot1/map", 1), &[1; 500]).unwrap();
    outbox.push(POSES, &header("/robot1/pose", 2), &[2]).unwrap();
    assert_eq!(carry(&mut outbox, &mut first, 0).items.len(), 3);
    outbox.push(MAPS, &header("/robot1/map", 3), &[3; 500]).unwrap();
    outbox.push(MAPS, &header("/robot1/map", 4), &[4; 500]).unwrap();
    // The first receiver has taken this, and dies before it can say so.
    let batch = outbox.batch().unwrap().unwrap().to_vec();
    assert_eq!(first.take(&batch).0.items.len(), 2);
    let mut second = Ingest::new(2, SECOND);
    let taken = carry(&mut outbox, &mut second, 0);
    assert!(matches!(taken.items[0], Item::Channel { .. }));
    assert_eq!(messages(&taken.items), [(4, vec![4; 500]), (2, vec![2])]);
    // From there on differences hold again.
    outbox.push(MAPS, &header("/robot1/map", 5), &[5; 500]).unwrap();
    assert_eq!(messages(&carry(&mut outbox, &mut second, 0).items), [(5, vec![5; 500])]);
}

#[test]
fn the_reports_of_an_end_do_not_pile_up_and_are_not_counted() {
    let (mut outbox, mut ingest) = (outbox(7, 3), Ingest::new(1, SECOND));
    outbox.report_on(MAPS);
    carry(&mut outbox, &mut ingest, 0);
    for time in 0..5 {
        outbox.report(&header("/robot1/stages", time), &[time as u8; 40]).unwrap();
    }
    assert_eq!(outbox.unacknowledged(), 0);
    // While one waits, no other is taken.
    assert_eq!(messages(&carry(&mut outbox, &mut ingest, 0).items), [(0, vec![0; 40])]);
    outbox.report(&header("/robot1/stages", 5), &[5; 40]).unwrap();
    assert_eq!(messages(&carry(&mut outbox, &mut ingest, 0).items), [(5, vec![5; 40])]);
    outbox.end();
    outbox.report(&header("/robot1/stages", 6), &[6; 40]).unwrap();
    assert!(carry(&mut outbox, &mut ingest, 0).is_end);
    assert_eq!((outbox.totals().sent, outbox.totals().dropped, outbox.is_done()), (0, 0, true));
}

#[test]
fn times_are_corrected_where_the_clocks_differ_by_more_than_they_may() {
    const HOUR: i64 = 3600 * SECOND;
    let at = 2 * HOUR as u64;
    for (offset, expected, clock) in [
        (0, at, None),
        (SECOND / 2, at, None),
        (-HOUR, at - HOUR as u64, Some(-HOUR)),
        (HOUR, at + HOUR as u64, Some(HOUR)),
    ] {
        let (mut outbox, mut ingest) = (outbox(7, 3), Ingest::new(1, SECOND));
        outbox.push(POSES, &header("/robot1/pose", at), &[1]).unwrap();
        let taken = carry(&mut outbox, &mut ingest, offset);
        assert_eq!((messages(&taken.items)[0].0, taken.clock), (expected, clock), "{offset}");
    }
}

#[test]
fn a_clock_that_is_off_by_an_hour_is_seen_when_the_ends_meet() {
    const HOUR: u64 = 3600 * SECOND as u64;
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let mut source = StageHarness::new(&source::kind(), &format!("listen = [\"tcp/127.0.0.1:{port}\"]")).unwrap();
    let wire = InputWire { port: "in", output: "map", ros_type: OccupancyGrid::NAME.to_owned(), ..Default::default() };
    let context = Context { inputs: vec![wire], ..Default::default() };
    let mut sink = |name: &str, ahead: u64| {
        let parameters = format!("connect = [\"tcp/127.0.0.1:{port}\"]\nsender = \"{name}\"");
        let kind = sink::kind_with(Clock { ahead: ahead as i64 });
        let mut sink = StageHarness::with_context(&kind, &parameters, &context).unwrap();
        let now = Clock::default().nanoseconds() as u64;
        let message = Message::from_vec(header("/robot1/map", now + ahead), vec![1; 30]);
        sink.give_message("in", message).unwrap();
        let (mut came, until) = (Vec::new(), Instant::now() + Duration::from_secs(60));
        while came.is_empty() {
            assert!(Instant::now() < until, "{:?}", source.warnings());
            source.node().wait(Duration::from_millis(20));
            source.node().advance().unwrap();
            let is_data = |message: &Message| message.header().flags.contains(MessageFlags::DATA);
            came.extend(source.take_messages("map").into_iter().filter(is_data));
        }
        assert_eq!(came[0].bytes(), [1; 30]);
        (
            came[0].header().log_time.0.abs_diff(now),
            source.warnings().keys().any(|text| text.contains("its times are corrected")),
        )
    };
    // By loopback the measured offset is right to far below a minute, however busy the machine.
    let (difference, is_told) = sink("right", 0);
    assert!(difference < HOUR / 60 && !is_told, "{difference}");
    let (difference, is_told) = sink("ahead", HOUR);
    assert!(difference < HOUR / 60 && is_told, "{difference}");
}

#[test]
fn invalid_batches_are_reported_and_change_nothing() {
    let (mut outbox, mut ingest) = (outbox(7, 3), Ingest::new(1, SECOND));
    outbox.push(MAPS, &header("/robot1/map", 1), &[1; 100]).unwrap();
    carry(&mut outbox, &mut ingest, 0);
    for nonsense in [&b""[..], b"abc", b"\x01\0\0\0 and so on", b"\x02\0\0\0"] {
        let (taken, answer) = ingest.take(nonsense);
        assert!(taken.wrong.is_some() && taken.items.is_empty() && answer.outcome == Outcome::Unreadable);
    }
    outbox.push(MAPS, &header("/robot1/map", 2), &[2; 100]).unwrap();
    assert_eq!(messages(&carry(&mut outbox, &mut ingest, 0).items), [(2, vec![2; 100])]);
}

/// A map with a header of its size, so that one that grows or moves differs everywhere.
fn map(width: usize, height: usize, origin: i8, walls: u64) -> Vec<u8> {
    let cell = |at: usize| {
        let (x, y) = ((at % width) as i64 + i64::from(origin), (at / width) as i64 + i64::from(origin));
        let is_wall = (x.rem_euclid(7) == 0 || y.rem_euclid(9) == 0) && (walls >> (at % 64)) & 1 == 1;
        if is_wall { 100 } else { (x.rem_euclid(3) == 0) as u8 }
    };
    let size = [width as u8, height as u8, origin as u8];
    size.into_iter().chain((0..width * height).map(cell)).collect()
}

/// What the network does.
#[derive(Clone, Copy, Debug)]
enum Step {
    Push(usize, usize, i8, u64),
    Pose,
    Carry,
    LoseBatch,
    LoseAnswer,
    /// A batch that was sent before comes again.
    Repeat,
    /// The receiver is started again.
    Restart,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        4 => (1usize..60, 1usize..60, -9i8..9, any::<u64>()).prop_map(|(w, h, o, walls)| Step::Push(w, h, o, walls)),
        2 => Just(Step::Pose),
        4 => Just(Step::Carry),
        1 => Just(Step::LoseBatch),
        2 => Just(Step::LoseAnswer),
        2 => Just(Step::Repeat),
        1 => Just(Step::Restart),
    ]
}

proptest! {
    #[test]
    fn maps_that_grow_shrink_and_move_are_rebuilt_byte_for_byte_whatever_is_lost_or_repeated(
        steps in prop::collection::vec(step(), 1..60),
    ) {
        let mut outbox = Outbox::new("robot1".into(), 7, links(), Limits { messages: 1000, states: 1000 });
        let mut receiver = 1;
        let mut ingest = Ingest::new(receiver, SECOND);
        let (mut sent, mut came): (Messages, Messages) = (Vec::new(), Vec::new());
        let (mut before, mut restarts) = (Vec::<Vec<u8>>::new(), 0);
        let ask = |outbox: &mut Outbox, ingest: &mut Ingest, came: &mut Messages, is_answered: bool| {
            let batch = outbox.batch().unwrap().map(<[u8]>::to_vec)?;
            let (taken, answer): (Taken, Answer) = ingest.take(&batch);
            assert_eq!(taken.wrong, None);
            came.extend(messages(&taken.items));
            if is_answered {
                outbox.answered(&answer, Some(0)).unwrap();
            }
            Some(batch)
        };
        for step in steps {
            let time = sent.len() as u64;
            match step {
                Step::Push(width, height, origin, walls) => {
                    let bytes = map(width, height, origin, walls);
                    outbox.push(MAPS, &header("/robot1/map", time), &bytes).unwrap();
                    sent.push((time, bytes));
                }
                Step::Pose => {
                    outbox.push(POSES, &header("/robot1/pose", time), &time.to_le_bytes()).unwrap();
                    sent.push((time, time.to_le_bytes().to_vec()));
                }
                Step::Carry => before.extend(ask(&mut outbox, &mut ingest, &mut came, true)),
                Step::LoseBatch => drop(outbox.batch().unwrap()),
                Step::LoseAnswer => before.extend(ask(&mut outbox, &mut ingest, &mut came, false)),
                Step::Repeat => {
                    for batch in before.iter().rev().take(3) {
                        let (taken, _) = ingest.take(batch);
                        assert_eq!(taken.items, []);
                    }
                }
                Step::Restart => {
                    restarts += 1;
                    receiver += 1;
                    ingest = Ingest::new(receiver, SECOND);
                }
            }
        }
        outbox.end();
        for _ in 0..1000 {
            if outbox.is_done() {
                break;
            }
            ask(&mut outbox, &mut ingest, &mut came, true);
        }
        prop_assert!(outbox.is_done());
        for message in &came {
            prop_assert!(sent.contains(message));
        }
        if restarts == 0 && outbox.totals().dropped == 0 {
            prop_assert_eq!(&came, &sent);
        }
        // Whatever was, the last of each is there.
        let last = |all: &[(u64, Vec<u8>)], is_pose: bool| all.iter().rfind(|(time, bytes)| (*bytes == time.to_le_bytes()) == is_pose).cloned();
        for is_pose in [false, true] {
            prop_assert_eq!(last(&came, is_pose), last(&sent, is_pose));
        }
    }
}
