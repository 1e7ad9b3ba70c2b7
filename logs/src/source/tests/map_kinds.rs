//! Maps that are not those of map servers: other cell values, merged maps of other programs.

use super::*;

fn map<'a>(frame: &str, data: &'a [u8]) -> OccupancyGrid<'a> {
    let info = MapMetaData { width: data.len() as u32, height: 1, resolution: 0.05, ..Default::default() };
    OccupancyGrid { header: Header::new(LogTime(1), frame), info, data }
}

fn read(log: &dyn Fn(&mut TestLog), more: &str) -> Run {
    let (_folder, files) = write(|file| log(file));
    try_run(files, more, RobotTopics::default()).unwrap()
}

fn cells(run: &Run) -> Vec<Vec<u8>> {
    run.on("map").iter().map(|message| message.decode::<OccupancyGrid<'_>>().unwrap().data.to_vec()).collect()
}

#[test]
fn cells_of_0_and_1_are_free_and_occupied_unless_the_pipeline_keeps_them() {
    let binary = [255, 0, 0, 1, 0];
    let log = |log: &mut TestLog| {
        log.add("/a/map", OccupancyGrid::NAME, 1, &map("map", &binary));
        log.add("/b/map", OccupancyGrid::NAME, 2, &map("map", &[255, 0, 0, 100, 0]));
    };
    let converted = read(&log, "");
    assert_eq!(cells(&converted), [[255, 0, 0, 100, 0], [255, 0, 0, 100, 0]]);
    let warning = "maps on `/a/map`: values about 0 are read as free, values about 1 as occupied";
    assert_eq!(converted.warnings.get(warning), Some(&1), "{:?}", converted.warnings);
    assert!(!converted.warnings.keys().any(|warning| warning.contains("/b/map")), "{:?}", converted.warnings);
    assert_eq!(cells(&read(&log, "map_values = \"occupancy\""))[0], binary);
    assert_eq!(cells(&read(&log, "names = \"as_logged\""))[0], binary, "a log that keeps its names keeps its bytes");
}

#[test]
fn a_merged_map_of_another_program_is_no_robot() {
    let grid = [0, 0, 100, 0];
    let log = |log: &mut TestLog| {
        log.add("/a/map", OccupancyGrid::NAME, 1, &map("map", &grid));
        log.add("/b/map", OccupancyGrid::NAME, 2, &map("b/map", &grid));
        log.add("/map_merge/map", OccupancyGrid::NAME, 3, &map("world", &grid));
    };
    let read = read(&log, "");
    let robots: Vec<String> = read.on("map").iter().map(|message| message.robot().to_owned()).collect();
    assert_eq!(robots, ["a", "b"]);
    assert_eq!(read.on("other").len(), 1, "it stays in the log");
    assert!(read.warnings.keys().any(|warning| warning.starts_with("maps on `/map_merge/map` are merged ones")));
}
