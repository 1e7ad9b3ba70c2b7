//! What programs have of a map whose changes the sink publishes, over a router on this machine.

use crate::stages::{sink, source_with, wait_until_heard};
use crate::waiting::{give, sent};
use crate::wire::{Robot, Router, TopicSubscriber, WATCHDOG, topic};
use gridweave_ros::qos::Qos;
use gridweave_runtime::ros::{Header, MapMetaData, OccupancyGrid, OccupancyGridUpdate, RosMessage, decode, encode};
use gridweave_runtime::stage::StageHarness;
use std::time::Instant;

const WIDTH: usize = 40;
const CELLS: usize = 40 * 30;

/// Publishes maps of which each differs in one cell from the one before.
struct Merge {
    sink: StageHarness,
    cells: Vec<u8>,
    sent: usize,
}

impl Merge {
    fn start(router: &Router, more: &str) -> Self {
        let parameters = format!("{}\n{more}", router.parameters());
        Self { sink: sink(&parameters, &[(OccupancyGrid::NAME, "/map")]), cells: vec![0; CELLS], sent: 0 }
    }

    fn send_next(&mut self) {
        let cell = 5 * WIDTH + 7 + self.sent % 3;
        self.cells[cell] = self.cells[cell].wrapping_add(1) % 100;
        self.sent += 1;
        let info = MapMetaData { width: WIDTH as u32, height: 30, resolution: 0.05, ..Default::default() };
        let header = Header { frame_id: "world".into(), ..Default::default() };
        give(&mut self.sink, 0, "/map", encode(&OccupancyGrid { header, info, data: &self.cells }).unwrap());
    }
}

/// A program that shows a map, as RViz does.
struct Viewer {
    subscriber: TopicSubscriber,
    cells: Vec<u8>,
    /// The last whole map.
    whole: Vec<u8>,
    /// How many whole maps and how many updates have come.
    heard: [usize; 2],
    _robot: Robot,
}

impl Viewer {
    fn start(router: &Router, name: &str, receives_updates: bool, qos: Qos) -> Self {
        let robot = Robot::start(router, name);
        let (map, updates) = (topic("/map", OccupancyGrid::NAME), topic("/map_updates", OccupancyGridUpdate::NAME));
        let subscriber = match receives_updates {
            true => robot.subscribe_both([(&map, qos), (&updates, Qos::reliable(5))]),
            false => robot.subscribe(&map, qos),
        };
        Self { subscriber, cells: Vec::new(), whole: Vec::new(), heard: [0; 2], _robot: robot }
    }

    /// Takes what has come.
    fn look(&mut self) {
        while let Some(message) = self.subscriber.try_next() {
            if message.len() > CELLS {
                self.whole = decode::<OccupancyGrid<'_>>(&message).unwrap().data.to_vec();
                self.cells.clone_from(&self.whole);
                self.heard[0] += 1;
                continue;
            }
            let update: OccupancyGridUpdate<'_> = decode(&message).unwrap();
            assert_eq!(update.header.frame_id, "world");
            self.heard[1] += 1;
            for (row, cells) in update.data.chunks_exact(update.width as usize).enumerate() {
                let start = (update.y as usize + row) * WIDTH + update.x as usize;
                if let Some(part) = self.cells.get_mut(start..start + cells.len()) {
                    part.copy_from_slice(cells);
                }
            }
        }
    }
}

/// Lets maps be sent until something holds.
#[track_caller]
fn send_until(merge: &mut Merge, what: &str, mut holds: impl FnMut(&Merge) -> bool) {
    let until = Instant::now() + WATCHDOG;
    while !holds(merge) {
        assert!(Instant::now() < until, "{what}");
        merge.send_next();
        std::thread::yield_now();
    }
}

/// Waits until a viewer has the map as it is, without another one being sent.
#[track_caller]
fn wait_until_seen(merge: &Merge, viewer: &mut Viewer) {
    let until = Instant::now() + WATCHDOG;
    while viewer.cells != merge.cells {
        assert!(Instant::now() < until, "{:?}", viewer.heard);
        viewer.look();
        std::thread::yield_now();
    }
}

#[test]
fn subscribers_get_the_map_by_updates_and_late_joiners_at_once() {
    let router = Router::start();
    let mut merge = Merge::start(&router, "");
    let mut viewer = Viewer::start(&router, "rviz", true, Qos::latched(1));
    send_until(&mut merge, "no update comes", |_| {
        viewer.look();
        viewer.heard[1] >= 3
    });
    wait_until_seen(&merge, &mut viewer);
    // Nothing is sent any more.
    let mut late = Viewer::start(&router, "late", true, Qos::latched(1));
    wait_until_seen(&merge, &mut late);
    let mut volatile = Viewer::start(&router, "volatile", true, Qos::reliable(1));
    wait_until_seen(&merge, &mut volatile);
    merge.send_next();
    wait_until_seen(&merge, &mut viewer);
    wait_until_seen(&merge, &mut late);
    wait_until_seen(&merge, &mut volatile);
}

#[test]
fn with_a_subscriber_without_updates_all_maps_are_whole() {
    let router = Router::start();
    let mut merge = Merge::start(&router, "");
    let mut viewer = Viewer::start(&router, "rviz", true, Qos::latched(1));
    send_until(&mut merge, "no update comes", |_| {
        viewer.look();
        viewer.heard[1] >= 1
    });
    let mut alone = Viewer::start(&router, "nav2", false, Qos::latched(1));
    wait_until_seen(&merge, &mut alone);
    for _ in 0..10 {
        merge.send_next();
        wait_until_seen(&merge, &mut alone);
    }
    wait_until_seen(&merge, &mut viewer);
    drop(alone);
    let before = viewer.heard[1];
    send_until(&mut merge, "no update comes any more", |_| {
        viewer.look();
        viewer.heard[1] > before
    });
}

#[test]
fn at_the_end_the_map_is_whole() {
    let router = Router::start();
    let mut merge = Merge::start(&router, "");
    let mut viewer = Viewer::start(&router, "rviz", true, Qos::latched(1));
    let updates = |merge: &Merge| merge.sink.counts().get("map updates published").copied().unwrap_or_default();
    send_until(&mut merge, "no update is sent", |merge| updates(merge) > 0);
    merge.sink.finish(Default::default()).unwrap();
    let until = Instant::now() + WATCHDOG;
    while viewer.whole != merge.cells {
        assert!(Instant::now() < until, "no whole map comes");
        viewer.look();
        std::thread::yield_now();
    }
    wait_until_seen(&merge, &mut viewer);
}

#[test]
fn without_updates_every_map_is_whole() {
    let router = Router::start();
    let mut merge = Merge::start(&router, "map_updates = false");
    let mut viewer = Viewer::start(&router, "rviz", true, Qos::latched(1));
    for _ in 0..30 {
        merge.send_next();
        wait_until_seen(&merge, &mut viewer);
    }
    assert_eq!(viewer.heard[1], 0);
}

/// A robot that publishes a map of 40 x 30 cells and one update of one cell, and the source that takes them.
fn updated_by_one_cell(router: &Router, parameters: &str) -> (StageHarness, Robot) {
    let mut source = source_with(router, parameters);
    let robot = Robot::start(router, "slam");
    let mut maps = robot.publish(&topic("/robot1/map", OccupancyGrid::NAME), Qos::latched(1));
    let mut updates = robot.publish(&topic("/robot1/map_updates", OccupancyGridUpdate::NAME), Qos::reliable(5));
    wait_until_heard(&mut source, &maps);
    wait_until_heard(&mut source, &updates);
    let header = Header { frame_id: "map".into(), ..Default::default() };
    let info = MapMetaData { width: WIDTH as u32, height: 30, resolution: 0.05, ..Default::default() };
    maps.send(&encode(&OccupancyGrid { header: header.clone(), info, data: &[0; CELLS] }).unwrap());
    let first = sent(&mut source, "map", 1).remove(0);
    assert_eq!(first.decode::<OccupancyGrid<'_>>().unwrap().data, [0; CELLS]);
    updates.send(&encode(&OccupancyGridUpdate { header, x: 3, y: 0, width: 1, height: 1, data: &[100] }).unwrap());
    (source, robot)
}

#[test]
fn a_map_with_an_update_is_sent_although_no_other_update_follows() {
    let router = Router::start();
    let (mut source, _robot) = updated_by_one_cell(&router, "update_period = 0.05");
    let updated = sent(&mut source, "map", 1).remove(0);
    assert_eq!(updated.decode::<OccupancyGrid<'_>>().unwrap().data[..5], [0, 0, 0, 100, 0]);
}

#[test]
fn a_run_that_is_asked_to_end_sends_the_map_with_its_last_update() {
    let router = Router::start();
    let (mut source, _robot) = updated_by_one_cell(&router, "update_period = 3600.0");
    let updates = sent(&mut source, "other", 1);
    assert_eq!(updates[0].decode::<OccupancyGridUpdate<'_>>().unwrap().data, [100]);
    assert!(source.take_messages("map").is_empty(), "updates are gathered");
    source.finish(Default::default()).unwrap();
    let updated = source.take_messages("map").remove(0);
    assert_eq!(updated.decode::<OccupancyGrid<'_>>().unwrap().data[3], 100);
}
