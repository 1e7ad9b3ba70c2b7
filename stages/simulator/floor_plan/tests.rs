use super::*;
use crate::shared::geometry::PointIndex;
use crate::simulator::clearances::Clearances;
use proptest::prelude::*;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

fn size() -> impl Strategy<Value = BuildingSize> {
    let layout = prop_oneof![
        Just(Layout::Random),
        Just(Layout::Symmetric),
        Just(Layout::Repeated),
        Just(Layout::Equipped),
        Just(Layout::Shelves)
    ];
    (10.0..45.0, 9.0..45.0, (2.5..8.0, 5.0..8.0), 1.4..3.0, 0.0..0.5, layout).prop_map(
        |(width, height, (room_width, room_depth), corridor_width, clutter, layout)| BuildingSize {
            width,
            height,
            room_width,
            room_depth,
            corridor_width,
            clutter,
            layout,
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]
    #[test]
    fn every_room_and_corridor_can_be_reached(size in size(), seed: u64) {
        let plan = FloorPlan::random(&size, &mut ChaCha8Rng::seed_from_u64(seed));
        prop_assert!(plan.rooms.len() >= 2);
        let space = Clearances::of(&plan);
        for area in plan.rooms.iter().map(|room| &room.bounds).chain(&plan.corridors) {
            let places = space.places_in(area).len();
            let cells = area.expanded(-0.3).width() * area.expanded(-0.3).height() / 0.01;
            prop_assert!(places as f64 > 0.15 * cells, "{places} of {cells} cells of {area:?}");
        }
    }

    #[test]
    fn the_building_is_closed_and_its_rooms_do_not_overlap(size in size(), seed: u64) {
        let plan = FloorPlan::random(&size, &mut ChaCha8Rng::seed_from_u64(seed));
        let space = Clearances::new(&plan.bounds.expanded(1.0), &plan.solids, &plan.corridors[0].centre());
        for place in space.places_in(&plan.bounds.expanded(2.0)) {
            prop_assert!(plan.bounds.contains(&place), "{place} is outside");
        }
        for (index, room) in plan.rooms.iter().enumerate() {
            prop_assert!(plan.rooms[..index].iter().all(|other| !other.bounds.overlaps(&room.bounds)));
            prop_assert!(plan.corridors.iter().all(|corridor| !corridor.overlaps(&room.bounds)));
            prop_assert!(room.bounds.width() > 1.3 && room.bounds.height() > 1.3, "{:?}", room.bounds);
        }
    }
}

#[test]
fn a_symmetric_building_is_the_same_after_half_a_turn() {
    let size = BuildingSize {
        width: 20.0,
        height: 15.0,
        room_width: 4.5,
        room_depth: 6.0,
        corridor_width: 2.0,
        clutter: 0.0,
        layout: Layout::Symmetric,
    };
    for seed in 0..5 {
        let plan = FloorPlan::random(&size, &mut ChaCha8Rng::seed_from_u64(seed));
        let space = Clearances::of(&plan);
        let places = space.places_in(&plan.bounds);
        let turned: Vec<Point2> = places.iter().map(|place| Point2::new(20.0 - place.x, 15.0 - place.y)).collect();
        let (turned, _) = PointIndex::new(&turned, 0.2);
        let same = places.iter().filter(|place| turned.nearest(place, 0.11).is_some()).count();
        assert!(same as f64 > 0.98 * places.len() as f64, "{same} of {}", places.len());
    }
}

#[test]
fn a_rearranged_building_has_the_same_walls_and_other_furniture_in_a_share_of_its_rooms() {
    let size = BuildingSize {
        width: 30.0,
        height: 15.0,
        room_width: 5.0,
        room_depth: 6.0,
        corridor_width: 2.0,
        clutter: 0.2,
        layout: Layout::Random,
    };
    let plan = FloorPlan::random(&size, &mut ChaCha8Rng::seed_from_u64(3));
    let rearranged = |share: f64| plan.rearranged(share, &size, &mut ChaCha8Rng::seed_from_u64(4));
    assert_eq!(rearranged(0.0), plan);
    let (all, half) = (rearranged(1.0), rearranged(0.5));
    let same = |other: &FloorPlan| {
        let furniture = |plan: &FloorPlan, room: usize| plan.solids[plan.furniture[room].clone()].to_vec();
        (0..plan.rooms.len()).filter(|room| furniture(&plan, *room) == furniture(other, *room)).count()
    };
    assert_eq!(all.solids[..all.wall_count], plan.solids[..plan.wall_count]);
    assert!(same(&all) <= 1 && (1..plan.rooms.len()).contains(&same(&half)), "{} {}", same(&all), same(&half));
}

#[test]
fn shelves_stand_in_rows_with_aisles_and_leave_every_door_clear() {
    let size = BuildingSize {
        width: 40.0,
        height: 30.0,
        room_width: 18.0,
        room_depth: 14.0,
        corridor_width: 2.5,
        clutter: 0.0,
        layout: Layout::Shelves,
    };
    let plan = FloorPlan::random(&size, &mut ChaCha8Rng::seed_from_u64(5));
    for (room, furniture) in plan.rooms.iter().zip(&plan.furniture) {
        let shelves: Vec<Rectangle> =
            plan.solids[furniture.clone()].iter().map(|shelf| Rectangle::bounding(&shelf.corners).unwrap()).collect();
        assert!(shelves.len() > 4, "{}", shelves.len());
        for (index, shelf) in shelves.iter().enumerate() {
            assert!(room.bounds.expanded(-1.2).contains(&shelf.min) && room.bounds.contains(&shelf.max));
            assert!(shelves[..index].iter().all(|other| !other.expanded(1.1).overlaps(shelf)));
        }
    }
}

#[test]
fn the_same_equipment_stands_in_every_room_of_a_size_in_every_building() {
    let building = |rooms: f64, seed: u64| {
        let size = BuildingSize {
            width: rooms * 4.0,
            height: 14.0,
            room_width: 4.0,
            room_depth: 6.0,
            corridor_width: 2.0,
            clutter: 0.0,
            layout: Layout::Equipped,
        };
        FloorPlan::random(&size, &mut ChaCha8Rng::seed_from_u64(seed))
    };
    let seen_from_doors = |plan: &FloorPlan| -> Vec<Vec<(i32, i32)>> {
        let centres = plan.rooms.iter().zip(&plan.furniture).map(|(room, furniture)| {
            let door = room.doors[0].centre;
            let from_door = |solid: &Solid| {
                let centre = Rectangle::bounding(&solid.corners).unwrap().centre();
                // In centimetres along the wall of the door, and into the room.
                ((100.0 * (centre.x - door.x)).round() as i32, (100.0 * (centre.y - door.y).abs()).round() as i32)
            };
            plan.solids[furniture.clone()].iter().map(from_door).collect()
        });
        centres.collect()
    };
    let [small, large] = [building(4.0, 1), building(9.0, 2)].map(|plan| seen_from_doors(&plan));
    assert!(small.len() == 8 && large.len() == 18 && small[0].len() > 1, "{small:?}");
    assert!(small.iter().chain(&large).all(|room| *room == small[0]), "{small:?} {large:?}");
}

#[test]
fn doors_are_gaps_in_walls() {
    let doors = [3.0, 1.0].map(|x| Door { centre: Point2::new(x, 0.0), width: 1.0, along_x: true });
    let parts = between_gaps(0.0, 5.0, &doors);
    assert_eq!(parts, [(-WALL / 2.0, 0.5), (1.5, 2.5), (3.5, 5.0 + WALL / 2.0)]);
}
