//! Tap sessions with links whose messages the tests control.

use super::message_queue::Limits;
use super::requests::{Request, State, TapAnswer};
use super::sessions::TapSessions;
use gridweave_runtime::message::{Message, MessageFlags, MessageHeader};
use gridweave_runtime::stage::{LinkView, RunLink, RunLinks, StageError};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// What is known of the one link of a run.
#[derive(Debug, Default)]
struct TestLink {
    is_made: bool,
    is_broken: bool,
    /// The numbers of the messages that have passed, and were not taken.
    passed: Vec<u64>,
    missed: u64,
    /// The number of attempts to open it, and of its current views.
    tried: usize,
    viewers: usize,
}

type SharedLink = Arc<Mutex<TestLink>>;

struct Viewer(SharedLink);

impl LinkView for Viewer {
    fn take(&mut self, take: &mut dyn FnMut(Message)) -> Result<(), StageError> {
        let mut link = self.0.lock().unwrap();
        if link.is_broken {
            return Err(StageError::new("observe", "it is broken"));
        }
        for sequence in link.passed.drain(..) {
            let header = MessageHeader { sequence, flags: MessageFlags::DATA, ..Default::default() };
            take(Message::from_vec(header, vec![sequence as u8; 10]));
        }
        Ok(())
    }

    fn missed(&self) -> u64 {
        self.0.lock().unwrap().missed
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.0.lock().unwrap().viewers -= 1;
    }
}

/// Sessions with the link `slam.map` and the link `slam.pose`, of which nothing is known, and answers what it was asked
/// by the number of the question.
fn sessions(limits: Limits) -> (TapSessions<u32>, SharedLink) {
    let link = Arc::new(Mutex::new(TestLink { is_made: true, ..Default::default() }));
    let named = |output: &str| RunLink { stage: "slam".into(), output: output.into(), ..Default::default() };
    let of_open = Arc::clone(&link);
    let links = RunLinks::new([named("map"), named("pose")], move |index| {
        assert_eq!(index, 0);
        let mut link = of_open.lock().unwrap();
        link.tried += 1;
        if !link.is_made {
            return Ok(None);
        }
        link.viewers += 1;
        Ok(Some(Box::new(Viewer(Arc::clone(&of_open)))))
    });
    (TapSessions::new(Ok(links), limits), link)
}

fn request(opening: u64, taken: u64) -> Request {
    Request { tapper: 5, link: "slam.map".into(), opening, taken }
}

fn pass(link: &SharedLink, numbers: impl IntoIterator<Item = u64>) {
    link.lock().unwrap().passed.extend(numbers);
}

fn viewers(link: &SharedLink) -> usize {
    link.lock().unwrap().viewers
}

/// The one answer, and what it says: the opening, the batch, and the messages.
#[track_caller]
fn said(answers: &[(u32, TapAnswer)], asked: u32) -> (u64, u64, Vec<u64>) {
    let [(to, answer)] = answers else { panic!("{answers:?}") };
    assert_eq!((*to, &answer.text), (asked, &String::new()));
    (answer.opening, answer.number, answer.passed.iter().map(|passed| passed.sequence).collect())
}

#[track_caller]
fn refusal(answers: impl IntoIterator<Item = (u32, TapAnswer)>) -> String {
    let answers: Vec<_> = answers.into_iter().collect();
    let [(_, TapAnswer { state: State::Refused, text, .. })] = answers.as_slice() else { panic!("{answers:?}") };
    text.clone()
}

#[test]
fn a_tap_gets_each_message_once_and_a_lost_answer_again() {
    let (mut sessions, link) = sessions(Limits::default());
    let now = Instant::now();
    assert_eq!(sessions.request(&request(0, 0), 1, now), None);
    assert_eq!(sessions.poll(now), []);
    pass(&link, 1..4);
    assert_eq!(said(&sessions.poll(now), 1), (1, 1, vec![1, 2, 3]));
    pass(&link, [4]);
    // What passes while nobody asks waits.
    assert_eq!(sessions.poll(now), []);
    let lost = sessions.request(&request(1, 0), 2, now).unwrap();
    assert_eq!(said(&[lost], 2), (1, 1, vec![1, 2, 3]));
    assert_eq!(sessions.request(&request(1, 1), 3, now), None);
    assert_eq!(said(&sessions.poll(now), 3), (1, 2, vec![4]));
    assert_eq!((viewers(&link), link.lock().unwrap().tried), (1, 1));
}

#[test]
fn where_nothing_passes_that_is_answered_after_a_while() {
    let (mut sessions, link) = sessions(Limits::default());
    let now = Instant::now();
    sessions.request(&request(0, 0), 1, now);
    assert_eq!(sessions.poll(now + Duration::from_secs(1)), []);
    assert_eq!(said(&sessions.poll(now + Duration::from_secs(3)), 1), (1, 0, vec![]));
    let later = now + Duration::from_secs(4);
    assert_eq!(sessions.request(&request(1, 0), 2, later), None);
    pass(&link, [1]);
    assert_eq!(said(&sessions.poll(later), 2), (1, 1, vec![1]));
}

#[test]
fn what_builds_upon_what_is_not_known_begins_anew() {
    let (mut sessions, link) = sessions(Limits::default());
    let now = Instant::now();
    for (asked, opening, taken) in [(1, 0, 0), (2, 77, 3), (3, 2, 5), (4, 0, 0)] {
        assert_eq!(sessions.request(&request(opening, taken), asked, now), None);
        pass(&link, [u64::from(asked)]);
        assert_eq!(said(&sessions.poll(now), asked), (u64::from(asked), 1, vec![u64::from(asked)]));
        assert_eq!(viewers(&link), 1, "that before it is closed");
    }
}

#[test]
fn a_link_is_released_when_its_tap_has_left_or_is_silent() {
    let (mut sessions, link) = sessions(Limits::default());
    let now = Instant::now();
    sessions.request(&request(0, 0), 1, now);
    sessions.poll(now);
    sessions.remove(6);
    assert_eq!((viewers(&link), sessions.is_idle()), (1, false), "another has left");
    sessions.remove(5);
    assert_eq!((viewers(&link), sessions.is_idle()), (0, true));
    sessions.request(&request(0, 0), 2, now);
    sessions.poll(now);
    sessions.poll(now + Duration::from_secs(59));
    assert_eq!(viewers(&link), 1);
    sessions.poll(now + Duration::from_secs(60));
    assert_eq!((viewers(&link), sessions.is_idle()), (0, true));
}

#[test]
fn what_waits_for_a_slow_program_is_bounded_and_what_is_dropped_counts_as_missed() {
    let (mut sessions, link) = sessions(Limits { messages: 10, bytes: 1000 });
    let now = Instant::now();
    sessions.request(&request(0, 0), 1, now);
    pass(&link, [0]);
    assert_eq!(said(&sessions.poll(now), 1), (1, 1, vec![0]));
    for round in 0..5 {
        pass(&link, 10 * round..10 * round + 10);
        sessions.poll(now);
    }
    link.lock().unwrap().missed = 7;
    assert_eq!(sessions.request(&request(1, 1), 2, now), None);
    let answers = sessions.poll(now);
    assert_eq!((answers[0].1.missed, said(&answers, 2)), (47, (1, 2, (40..50).collect())));
}

#[test]
fn the_links_are_listed_and_others_refused() {
    let (mut sessions, link) = sessions(Limits::default());
    let now = Instant::now();
    let (_, answer) = sessions.request(&Request::default(), 1, now).unwrap();
    let names: Vec<String> = answer.links.iter().map(|link| format!("{}.{}", link.stage, link.output)).collect();
    assert_eq!((answer.state, names), (State::GoesOn, vec!["slam.map".to_owned(), "slam.pose".to_owned()]));
    let other = Request { link: "slam.scan".into(), ..request(0, 0) };
    assert!(refusal(sessions.request(&other, 2, now)).contains("no link `slam.scan`"));
    assert!(sessions.is_idle() && link.lock().unwrap().tried == 0);
    let mut closed = TapSessions::new(Err("nobody may"), Limits::default());
    assert_eq!(refusal(closed.request(&Request::default(), 3, now)), "nobody may");
    assert_eq!(refusal(closed.request(&request(0, 0), 4, now)), "nobody may");
    assert!(closed.is_idle());
}

#[test]
fn a_link_that_is_not_made_is_looked_for_now_and_then_and_given_up() {
    let (mut sessions, link) = sessions(Limits::default());
    link.lock().unwrap().is_made = false;
    let start = Instant::now();
    let after = |milliseconds: u64| start + Duration::from_millis(milliseconds);
    sessions.request(&request(0, 0), 1, start);
    for milliseconds in 0..1000 {
        assert_eq!(sessions.poll(after(milliseconds)), []);
    }
    assert_eq!(link.lock().unwrap().tried, 10);
    // The program asks again meanwhile.
    assert_eq!(said(&sessions.poll(after(9000)), 1), (1, 0, vec![]));
    assert_eq!(sessions.request(&request(1, 0), 2, after(9000)), None);
    let why = refusal(sessions.poll(after(10_000)));
    assert!(why.contains("has not created the link within 10 s"), "{why}");
    assert!(sessions.is_idle());
}

#[test]
fn an_unreadable_link_is_reported_and_closed() {
    let (mut sessions, link) = sessions(Limits::default());
    let now = Instant::now();
    sessions.request(&request(0, 0), 1, now);
    sessions.poll(now);
    link.lock().unwrap().is_broken = true;
    assert!(refusal(sessions.poll(now)).contains("it is broken"));
    assert_eq!((viewers(&link), sessions.is_idle()), (0, true));
}

#[test]
fn at_the_end_of_a_run_its_last_messages_are_sent() {
    let (mut sessions, link) = sessions(Limits::default());
    let now = Instant::now();
    sessions.request(&request(0, 0), 1, now);
    sessions.poll(now);
    pass(&link, [1]);
    sessions.end();
    let answers = sessions.poll(now);
    assert_eq!((answers[0].1.state, said(&answers, 1)), (State::Ended, (1, 1, vec![1])));
    assert_eq!((viewers(&link), sessions.is_idle()), (0, true));
}
