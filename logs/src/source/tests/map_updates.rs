//! Map updates in a log, and the maps that stages receive.

use super::*;
use gridweave_runtime::ros::OccupancyGridUpdate;

const UPDATE: &str = OccupancyGridUpdate::NAME;
const SECOND: u64 = 1_000_000_000;

fn stamped(second: u64, frame: &str) -> Header {
    Header::new(LogTime(second * SECOND), frame)
}

fn map(second: u64, width: u32, data: &[u8]) -> OccupancyGrid<'_> {
    let info = MapMetaData { width, height: data.len() as u32 / width, ..Default::default() };
    OccupancyGrid { header: stamped(second, "map"), info, data }
}

fn update(second: u64, x: i32, data: &[u8]) -> OccupancyGridUpdate<'_> {
    OccupancyGridUpdate { header: stamped(second, "map"), x, y: 0, width: data.len() as u32, height: 1, data }
}

fn log() -> (Folder, Vec<PathBuf>) {
    write(|log| {
        log.add("/robot1/map_updates", UPDATE, 0, &update(0, 0, &[5]));
        log.add("/robot1/map", OccupancyGrid::NAME, SECOND, &map(1, 3, &[0, 0, 0]));
        log.add("/robot2/map", OccupancyGrid::NAME, SECOND, &map(1, 2, &[0, 0]));
        let mut add = |second: u64, data: &OccupancyGridUpdate<'_>| {
            log.add("/robot1/map_updates", UPDATE, second * SECOND, data);
        };
        add(2, &update(2, 2, &[1]));
        add(3, &update(3, 0, &[2, 3]));
        add(4, &update(4, 2, &[4, 4]));
        add(5, &update(5, 2, &[6]));
        log.raw("/robot1/map_updates", UPDATE, 6 * SECOND, b"cut");
    })
}

/// A source that has sent all its messages.
fn read(files: &[PathBuf], more: &str) -> StageHarness {
    let mut source = StageHarness::new(&kind(), &format!("files = [{:?}]\n{more}", files[0])).unwrap();
    while source.node().advance().unwrap() {}
    source
}

/// The messages sent on a port, without announcements.
fn sent(source: &mut StageHarness, port: &str) -> Vec<Message> {
    let mut sent = source.take_messages(port);
    sent.retain(|message| message.header().flags.contains(MessageFlags::DATA));
    sent
}

/// For each sent map: log time, stamp in seconds, and cells.
fn maps(source: &mut StageHarness) -> Vec<(u64, i32, Vec<u8>)> {
    let seen = |message: &Message| {
        let map: OccupancyGrid<'_> = message.decode().unwrap();
        assert_eq!(map.header.frame_id, format!("{}/map", message.robot()));
        (message.header().log_time.0 / SECOND, map.header.stamp.sec, map.data.to_vec())
    };
    sent(source, "map").iter().map(seen).collect()
}

#[test]
fn stages_see_whole_maps_with_the_updates_in_them() {
    let (_folder, files) = log();
    let mut source = read(&files, "");
    let expected = [
        (1, 1, vec![0, 0, 0]),
        (1, 1, vec![0, 0]),
        // By then, updates have brought three cells, as many as the map has.
        (3, 3, vec![2, 3, 1]),
        // The last state is sent at the end.
        (6, 5, vec![2, 3, 6]),
    ];
    assert_eq!(maps(&mut source), expected);
    assert_eq!(sent(&mut source, "other").len(), 6, "updates are passed on");
    for why in
        ["no whole map was received before them", "they reach beyond the latest map", "they do not match their type"]
    {
        let warning = format!("updates on `/robot1/map_updates` were ignored: {why}");
        assert_eq!(source.warnings().get(&warning), Some(&1), "{:?}", source.warnings());
    }
}

#[test]
fn updates_before_the_start_are_in_a_map_that_is_sent_at_the_start() {
    let (_folder, files) = log();
    let mut source = read(&files, "start = 2.5\nend = 4.5\nmap_values = 'occupancy'");
    let expected = [(2, 1, vec![0, 0, 0]), (2, 1, vec![0, 0]), (2, 2, vec![0, 0, 1]), (4, 3, vec![2, 3, 1])];
    assert_eq!(maps(&mut source), expected);
}

#[test]
fn no_map_is_derived_where_messages_keep_their_logged_names() {
    let (_folder, files) = log();
    let run = run_as_logged(files);
    assert_eq!(run.times("map"), [SECOND, SECOND]);
    assert!(run.warnings.is_empty(), "{:?}", run.warnings);
}
