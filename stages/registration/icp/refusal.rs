//! Why a refined alignment may not be used.

use super::first_guess::LocalFrame;
use super::{FirstGuess, IcpParameters, Registration};
use gridweave_runtime::covariance_ellipse::CovarianceEllipse;
use nalgebra::Matrix2;

/// Why a refined alignment may not be used. The texts are for the people who run the robots.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IcpRefusal {
    /// Nothing to align.
    #[error("the maps have no walls that lie near each other")]
    NoWalls,
    /// The maps pull away from the first guess.
    #[error(
        "the maps fit {step:.1} standard deviations away from the first guess, and {most:.1} are allowed: one of the \
         two is wrong"
    )]
    Step {
        /// Standard deviations of the first guess.
        step: f64,
        /// What is allowed.
        most: f64,
    },
    /// The place is open along a direction.
    #[error(
        "the maps only fix the place across a bare corridor that runs at {direction:.0} degrees; along it, it is known \
         to {deviation:.2} m, and {most:.2} m are allowed"
    )]
    OpenPosition {
        /// The direction that is open, degrees in map a, from -90 to 90.
        direction: f64,
        /// Standard deviation along it, metres.
        deviation: f64,
        /// What is allowed, metres.
        most: f64,
    },
    /// The rotation is open.
    #[error(
        "the maps leave the rotation open: it is known to {degrees:.1} degrees, by which walls lie {deviation:.2} m beside their \
         place, and {most:.2} m are allowed"
    )]
    OpenRotation {
        /// Standard deviation, degrees.
        degrees: f64,
        /// The standard deviation that it makes in the place of walls, metres.
        deviation: f64,
        /// What is allowed, metres.
        most: f64,
    },
}

impl IcpRefusal {
    /// The first reason against a registration, if there is one.
    pub fn of(registration: &Registration, parameters: &IcpParameters) -> Option<Self> {
        let (along, direction) =
            widest_deviation(&registration.centre_covariance.fixed_view::<2, 2>(0, 0).into_owned());
        let turn = registration.centre_covariance.m33.sqrt();
        let by_turn = turn * registration.radius;
        // Negated comparisons, so that a value that is no number refuses.
        let at_least = |value: f64, least: f64| value >= least;
        if registration.inliers == 0 {
            Some(Self::NoWalls)
        } else if !at_least(parameters.max_step, registration.step) {
            Some(Self::Step { step: registration.step, most: parameters.max_step })
        } else if !at_least(parameters.max_deviation, along) {
            let most = parameters.max_deviation;
            Some(Self::OpenPosition { direction: direction.to_degrees(), deviation: along, most })
        } else if !at_least(parameters.max_deviation, by_turn) {
            let most = parameters.max_deviation;
            Some(Self::OpenRotation { degrees: turn.to_degrees(), deviation: by_turn, most })
        } else {
            None
        }
    }

    /// The reason against a registration that began where a search over all places has found the same walls to fit best, if they leave
    /// that place open. Along a corridor with little that crosses it registration settles on what crosses it nearest, right or wrong,
    /// and is sure of that; how far the walls fit about as well tells how sure it is.
    pub fn of_search(
        first_guess: &FirstGuess,
        registration: &Registration,
        parameters: &IcpParameters,
    ) -> Option<Self> {
        let frame = LocalFrame { centre: registration.centre, scale: 1.0 };
        let derivative = frame.inverse_jacobian(&first_guess.transform_a_b);
        let covariance = derivative * first_guess.covariance * derivative.transpose();
        let (along, direction) = widest_deviation(&covariance.fixed_view::<2, 2>(0, 0).into_owned());
        let most = parameters.max_deviation;
        // What is no number is open, too.
        let is_fixed = along <= most;
        (!is_fixed).then(|| Self::OpenPosition { direction: direction.to_degrees(), deviation: along, most })
    }
}

/// The greatest standard deviation of a position, metres, and its direction, radians from -pi/2 to pi/2.
fn widest_deviation(covariance: &Matrix2<f64>) -> (f64, f64) {
    let ellipse = CovarianceEllipse::new(covariance, 1.0);
    ellipse.map_or((f64::INFINITY, 0.0), |ellipse| (ellipse.half_axes[0], ellipse.direction))
}
