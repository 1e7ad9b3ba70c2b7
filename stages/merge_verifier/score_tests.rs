//! How probable alignments are, by what speaks for and against them.

use super::score::{LEAST_EVIDENCE, MOST_LEAD};
use super::{Agreement, Grounds, Odds, Origin, Rival};

/// Maps that have 50 m of wall to compare, of which so large a share agrees.
fn agreement(evidence: f64, share: f64) -> Agreement {
    Agreement {
        overlap: 200.0,
        wall_on_wall: 50.0 * share,
        wall_on_free: 50.0 * (1.0 - share),
        wall_across: 0.0,
        evidence,
        confirming: 0.7,
        walls_either_way: 4,
        slide: 0.05,
        ..Default::default()
    }
}

/// Of maps that fit well in many rooms, and nowhere else.
fn grounds(origin: Origin) -> Grounds {
    Grounds {
        origin,
        found_too: false,
        found_by_tags_and_walls: false,
        is_expected: false,
        agreement: agreement(300.0, 0.9),
        bend_cost: None,
        rival: None,
    }
}

/// Another place at which the maps say that of each other.
fn rival(agreement: Agreement) -> Option<Rival> {
    Some(Rival { shift: 5.0, turn: 0.0, lead: 0.0, agreement, bend_cost: None })
}

/// The probability of a place of so much evidence, with a rival that has so large a share of it.
fn probability(evidence: f64, evidence_elsewhere: f64, origin: Origin) -> f64 {
    let rival = rival(agreement(evidence_elsewhere * evidence.max(LEAST_EVIDENCE), 0.9));
    Odds::new(&Grounds { agreement: agreement(evidence, 0.9), rival, ..grounds(origin) }).probability()
}

/// The probability of a place that a search has found, with some of its agreement changed.
fn found(lead: f64, change: impl FnOnce(&mut Agreement)) -> f64 {
    let mut grounds = grounds(Origin::Search { lead });
    change(&mut grounds.agreement);
    Odds::new(&grounds).probability()
}

#[test]
fn a_longer_lead_and_more_to_compare_make_a_place_that_walls_have_found_more_probable() {
    let with = |lead: f64, overlap: f64| found(lead, |agreement| agreement.overlap = overlap);
    assert!(with(8.0, 100.0) > 0.999 && with(1.0, 100.0) < with(8.0, 100.0));
    assert!(with(1.0, 10.0) < 0.99 && with(1.0, 200.0) > 0.999);
    assert_eq!(with(1e9, 30.0), with(MOST_LEAD, 30.0));
}

#[test]
fn tags_need_less_wall_and_tell_a_place_from_its_like() {
    assert!(probability(20.0, 1.0, Origin::Tags) > 0.999);
    assert!(probability(20.0, 0.0, Origin::FewTags) < 0.999 && probability(60.0, 0.0, Origin::FewTags) > 0.999);
    assert!(probability(60.0, 1.0, Origin::FewTags) < 0.01);
    assert!(probability(-20.0, 0.0, Origin::Tags) < 0.9);
    let told = Grounds {
        found_too: true,
        agreement: agreement(40.0, 0.8),
        rival: rival(agreement(40.0, 0.8)),
        ..grounds(Origin::Search { lead: 4.0 })
    };
    assert!(Odds::new(&told).probability() > 0.999);
}

#[test]
fn what_tags_tell_must_agree_in_most_and_less_where_a_search_has_found_it_too() {
    let with = |share: f64, by_both: bool, origin: Origin| {
        let grounds = grounds(origin);
        let agreement = agreement(300.0, share);
        let grounds = Grounds { agreement, found_too: by_both, found_by_tags_and_walls: by_both, ..grounds };
        Odds::new(&grounds)
    };
    assert!(with(0.7, false, Origin::Tags).probability() < 0.01);
    assert!(with(0.7, false, Origin::Tags).lacks_agreement(0.999));
    assert!(with(0.85, false, Origin::Tags).probability() > 0.999);
    for origin in [Origin::Tags, Origin::Search { lead: 1.0 }] {
        assert!(with(0.4, true, origin).probability() < 0.6 && with(0.46, true, origin).probability() > 0.999);
    }
}

#[test]
fn walls_that_cross_rooms_speak_against_a_place_and_rough_drawing_does_not() {
    let rough = |agreement: &mut Agreement| (agreement.wall_on_wall, agreement.wall_on_free) = (22.0, 28.0);
    assert!(found(8.0, rough) > 0.999);
    let other = |agreement: &mut Agreement| {
        rough(agreement);
        agreement.wall_across = 24.0;
    };
    assert!(found(8.0, other) < 0.99);
    let mut of_other = grounds(Origin::Search { lead: 8.0 });
    other(&mut of_other.agreement);
    assert!(Odds::new(&of_other).lacks_agreement(0.999));
    // The same share of more wall is more of it.
    let of = |metres: f64| {
        found(4.0, |agreement| {
            (agreement.wall_on_wall, agreement.wall_on_free, agreement.wall_across) =
                (0.8 * metres, 0.2 * metres, 0.15 * metres);
        })
    };
    assert!(of(200.0) < of(20.0));
}

#[test]
fn more_of_much_wall_must_agree_and_less_the_more_of_it_there_is() {
    let with = |share: f64, seen: f64| {
        found(9.0, |agreement| {
            (agreement.wall_on_wall, agreement.wall_on_free) = (share * seen, (1.0 - share) * seen);
        })
    };
    assert!(with(0.78, 100.0) < 0.6 && with(0.84, 100.0) > 0.999);
    assert!(with(0.7, 400.0) < 0.6 && with(0.76, 400.0) > 0.999);
    assert!(with(0.6, 60.0) > 0.999 && with(0.6, 80.0) < 0.01);
}

#[test]
fn maps_that_share_one_room_must_agree_in_nearly_all_of_it() {
    let with = |overlap: f64, share: f64| {
        found(10.0, |agreement| {
            agreement.overlap = overlap;
            (agreement.wall_on_wall, agreement.wall_on_free) = (20.0 * share, 20.0 * (1.0 - share));
        })
    };
    assert!(with(25.0, 0.85) < 0.5 && with(25.0, 1.0) > 0.999);
    assert!(with(40.0, 0.85) > 0.999);
}

#[test]
fn a_corner_that_fits_another_says_nothing() {
    let with =
        |confirming: f64| found(9.0, |agreement| (agreement.confirming, agreement.walls_either_way) = (confirming, 1));
    assert!(with(0.0) < 0.01 && with(0.14) < 0.01 && with(0.7) > 0.999);
}

#[test]
fn walls_that_run_one_way_only_leave_a_place_open() {
    let with = |walls: usize| {
        found(1.0, |agreement| {
            (agreement.walls_either_way, agreement.overlap, agreement.evidence) = (walls, 40.0, 30.0);
        })
    };
    assert!(with(0) < 0.99 && with(0) < with(2) && with(4) > 0.999);
}

#[test]
fn parts_that_each_fit_a_little_beside_speak_against_a_place() {
    let with = |slide: f64| found(1.0, |agreement| agreement.slide = slide);
    assert!(with(0.02) > 0.999 && with(0.5) < 0.99);
}

#[test]
fn next_to_no_wall_is_no_evidence_however_much_space_is_free() {
    let little = |agreement: &mut Agreement| {
        (agreement.wall_on_wall, agreement.wall_on_free, agreement.slide) = (1.0, 0.0, 0.0);
        (agreement.walls_either_way, agreement.overlap, agreement.evidence) = (1, 40.0, 2.0);
    };
    assert!(found(5.0, little) < 0.99);
}

#[test]
fn maps_that_are_bent_pay_for_the_bend() {
    let with = |bend_cost: Option<f64>| {
        let mut grounds = Grounds { bend_cost, ..grounds(Origin::Search { lead: 4.0 }) };
        grounds.agreement.overlap = 80.0;
        Odds::new(&grounds).probability()
    };
    assert!(with(Some(0.1)) < with(None) && with(Some(10.0)) > 0.999 && with(Some(130.0)) < 0.99);
}

#[test]
fn a_place_that_contradicts_itself_is_not_like_one_that_does_not_however_much_wall_agrees_there() {
    let with = |elsewhere: Agreement| {
        let grounds = grounds(Origin::Search { lead: 8.0 });
        let agreement = agreement(80.0, 1.0);
        Odds::new(&Grounds { agreement, rival: rival(elsewhere), ..grounds }).probability()
    };
    assert!(with(agreement(80.0, 1.0)) < 0.9, "both may be right");
    let crossed = Agreement { wall_across: 8.0, walls_either_way: 2, ..agreement(100.0, 0.8) };
    assert!(with(crossed) > 0.999);
}

#[test]
fn of_two_places_that_are_alike_the_one_that_the_search_prefers_is_a_little_more_probable() {
    let with = |lead: f64, lead_elsewhere: f64| {
        let grounds = grounds(Origin::Search { lead });
        let rival = rival(grounds.agreement).map(|rival| Rival { lead: lead_elsewhere, ..rival });
        Odds::new(&Grounds { rival, ..grounds }).probability()
    };
    assert!(with(4.0, 4.0) <= 0.5 && with(8.0, 8.0) <= 0.5);
    assert!(with(8.0, 0.0) > 0.6 && with(8.0, 0.0) < 0.95);
}

#[test]
fn a_place_that_another_outdoes_is_not_probable_whatever_its_contradictions_are() {
    let with = |elsewhere: Agreement| {
        let grounds = Grounds { agreement: agreement(110.0, 0.85), ..grounds(Origin::Search { lead: 8.0 }) };
        Odds::new(&Grounds { rival: rival(elsewhere), ..grounds }).probability()
    };
    // What contradicts there crosses rooms.
    let crossed = |evidence: f64| Agreement { wall_across: 5.0, walls_either_way: 1, ..agreement(evidence, 0.9) };
    assert!(with(crossed(100.0)) > 0.99 && with(crossed(120.0)) <= 0.5);
}

#[test]
fn points_that_meet_speak_for_a_place_less_what_a_bend_costs() {
    let with = |evidence: f64, bend_cost: Option<f64>| {
        let mut grounds = Grounds { bend_cost, ..grounds(Origin::Search { lead: 1.0 }) };
        (grounds.agreement.evidence, grounds.agreement.overlap) = (evidence, 40.0);
        Odds::new(&grounds).chance
    };
    assert!(with(0.0, None) < with(20.0, None) && with(20.0, None) < with(100.0, None));
    assert!(with(100.0, None) - with(80.0, None) < with(20.0, None) - with(0.0, None));
    assert_eq!(with(-30.0, None), with(0.0, None));
    assert_eq!(with(20.0, Some(20.0)), with(0.0, Some(20.0)), "the bend has eaten it");
    assert!(with(30.0, Some(20.0)) > with(20.0, Some(20.0)));
}

#[test]
fn where_the_user_knows_the_place_a_small_map_is_enough() {
    let small = Agreement { overlap: 15.0, wall_on_wall: 4.0, wall_on_free: 1.0, ..agreement(20.0, 0.8) };
    let small = Agreement { walls_either_way: 1, ..small };
    let small = Grounds { agreement: small, ..grounds(Origin::Search { lead: 3.0 }) };
    let expected = Grounds { is_expected: true, ..small };
    assert!(Odds::new(&small).probability() < 0.99 && Odds::new(&expected).probability() > 0.999);
    let ambiguous = Grounds { rival: rival(small.agreement), ..expected };
    assert!(Odds::new(&ambiguous).probability() < 0.9, "it is not known to the metre");
}
