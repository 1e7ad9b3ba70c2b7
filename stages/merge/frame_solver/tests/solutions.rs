//! Poses of the robots in spite of wrong alignments.

use super::*;
use crate::merge::frame_solver::FrameSolverParameters;
use crate::merge::frame_solver::simulated_graph::SimulatedGraph;
use crate::merge::frame_solver::solution::{Solution, by_name};
use crate::merge::frame_solver::solve::solve;
use crate::merge::frame_solver::uncertain::error_vector;
use proptest::prelude::*;

#[test]
fn a_certain_alignment_counts_for_more() {
    let mut run = Run::new(None);
    run.align(&between(1, 2));
    run.align(&between(2, 3));
    let mut vague = between(1, 3);
    vague.x += 0.5;
    vague.covariance = std::array::from_fn(|index| if index % 4 == 0 { 1.0 } else { 0.0 });
    run.align(&vague);
    assert!(is_near(&run.pose_of("robot3").unwrap(), &place(3), 0.02));
}

#[test]
fn robots_are_placed_right_in_spite_of_wrong_alignments() {
    let simulated = SimulatedGraph::new(10, 5, 7).with_outliers(0.1);
    let mut run = Run::new(None);
    (0..simulated.edges.len()).for_each(|index| run.align(&simulated.alignment(index)));
    let placed: Vec<(usize, Pose2)> =
        (1..10).filter_map(|robot| Some((robot, run.pose_of(&SimulatedGraph::name(robot))?))).collect();
    assert!(placed.len() >= 8, "{}", placed.len());
    assert!(placed.iter().all(|(robot, pose)| !simulated.is_wrong(*robot, pose)));
}

#[test]
fn covariances_are_consistent_with_the_errors_of_the_frames() {
    let parameters =
        FrameSolverParameters { position_floor: 1e-6, yaw_floor: 1e-6, ..FrameSolverParameters::default() };
    let robots = 12;
    let mut sum = 0.0;
    let mut count = 0.0;
    for seed in 0..60 {
        let simulated = SimulatedGraph::new(robots, 4, seed);
        let names = (0..robots).map(SimulatedGraph::name).collect();
        let alignments = (0..simulated.edges.len()).filter_map(|index| by_name(simulated.alignment(index))).collect();
        let solution = solve(&names, &alignments, &SimulatedGraph::name(0), &parameters, &Solution::default());
        for robot in 1..robots {
            let Some(frame) = solution.frames.get(&SimulatedGraph::name(robot)) else { continue };
            let truth = simulated.poses[0].inverse() * simulated.poses[robot];
            let mut error = error_vector(&frame.pose) - error_vector(&truth);
            error.z = wrap_angle(error.z);
            sum += error.dot(&(frame.covariance.try_inverse().unwrap() * error));
            count += 1.0;
        }
    }
    // The squared error in standard deviations is 3 in the mean if the covariances are right: one for each of x, y and
    // yaw. The errors of one graph are correlated, so the mean of 60 graphs scatters by about 0.25.
    let mean = sum / count;
    assert!((2.3..3.7).contains(&mean), "{mean}");
}

proptest! {
    #[test]
    fn neither_the_order_nor_the_direction_of_alignments_matters(
        order in Just((0..10usize).collect::<Vec<_>>()).prop_shuffle(),
        turned in prop::collection::vec(any::<bool>(), 10),
        noise in prop::collection::vec(-0.02..0.02, 10),
    ) {
        let pairs: Vec<(usize, usize)> = (1..=5).flat_map(|a| (a + 1..=5).map(move |b| (a, b))).collect();
        let alignment = |index: usize, turned: bool| {
            let (a, b) = pairs[index];
            let mut alignment = between(a, b);
            alignment.x += noise[index];
            alignment.yaw += noise[(index + 3) % 10] / 10.0;
            if turned {
                let transform_b_a = crate::merge::frame_solver::UncertainPose {
                    pose: alignment.transform_a_b(),
                    covariance: nalgebra::Matrix3::from_row_slice(&alignment.covariance),
                }.inverse();
                std::mem::swap(&mut alignment.a, &mut alignment.b);
                alignment.set_transform_a_b(&transform_b_a.pose);
                alignment.covariance = crate::shared::geometry::row_by_row(&transform_b_a.covariance);
            }
            alignment
        };
        let (mut plain, mut mixed) = (Run::new(Some("robot1")), Run::new(Some("robot1")));
        (0..10).for_each(|index| plain.align(&alignment(index, false)));
        order.iter().for_each(|&index| mixed.align(&alignment(index, turned[index])));
        for robot in ["robot1", "robot2", "robot3", "robot4", "robot5"] {
            let (one, other) = (plain.pose_of(robot).unwrap(), mixed.pose_of(robot).unwrap());
            prop_assert!(is_near(&one, &other, 1e-7), "{} {} {}", robot, one, other);
        }
        // In the same directions it is the same to the last bit.
        let mut shuffled = Run::new(Some("robot1"));
        order.iter().for_each(|&index| shuffled.align(&alignment(index, false)));
        prop_assert_eq!(shuffled.solved().frames, plain.solved().frames);
        prop_assert_eq!(shuffled.verdicts(), plain.verdicts());
    }

    #[test]
    fn a_chain_of_robots_is_recovered(
        steps in prop::collection::vec((-9.0..9.0, -9.0..9.0, -3.1..3.1), 1..20),
        reference in 0usize..20,
    ) {
        let mut places = vec![Pose2::identity()];
        for (x, y, yaw) in steps {
            places.push(places[places.len() - 1] * pose(x, y, yaw));
        }
        let name = |robot: usize| format!("robot{robot:02}");
        let reference = reference.min(places.len() - 1);
        let mut run = Run::new(Some(&name(reference)));
        for robot in 1..places.len() {
            run.align(&accepted(&name(robot - 1), &name(robot), places[robot - 1].inverse() * places[robot]));
        }
        for (robot, place) in places.iter().enumerate() {
            let solved = run.pose_of(&name(robot)).unwrap();
            prop_assert!(is_near(&solved, &(places[reference].inverse() * place), 1e-7));
        }
    }
}
