//! Buildings that are much longer than their rooms are merged by the maps alone.

use crate::support::SimulatedWorld;
use gridweave_logs::summary::Frame;

#[test]
fn robots_along_a_corridor_of_160_metres_are_merged_with_and_without_initial_poses() {
    let settings = [
        "tags=0",
        "snapshots=1",
        "width=160",
        "height=12",
        "resolution=[0.1]",
        "duration=1500",
        "overlap=0.6",
        "beams=180",
    ];
    let world = SimulatedWorld::new("1", &settings);
    world.merge(&["--reference", "robot1"]).assert(0, &["merged 2 of 2 robots"]);
    assert!(world.error() < 0.2, "{} m", world.error());

    let Frame { x, y, yaw, .. } = world.truth();
    // Two metres for each coordinate, and any rotation.
    let initial = format!("robot2={},{},{},2,3", x + 1.5, y - 1.5, yaw + 1.0);
    world.merge(&["--reference", "robot1", "--initial", &initial]).assert(0, &["merged 2 of 2 robots"]);
    assert!(world.error() < 0.2, "{} m", world.error());
}
