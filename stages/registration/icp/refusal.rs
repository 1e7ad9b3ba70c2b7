//! Why a refined alignment may not be used.

use super::initial_guess::LocalFrame;
use super::{IcpParameters, InitialGuess, Registration};
use crate::shared::number_text::beside_bound;
use gridweave_runtime::covariance_ellipse::CovarianceEllipse;
use nalgebra::Matrix2;

/// Why a refined alignment may not be used. The texts are for the user.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IcpRefusal {
    /// No common walls.
    #[error("the maps have no walls near each other at this pose")]
    NoWalls,
    /// The result is too far from the first guess.
    #[error(
        "ICP converged {step:.1} standard deviations away from the first guess, and {most:.1} are allowed (max_step): \
         one of the two is wrong"
    )]
    Step {
        /// Mahalanobis distance from the first guess.
        step: f64,
        /// Largest distance allowed.
        most: f64,
    },
    /// The position is degenerate along a direction.
    #[error(
        "the walls do not constrain the position along a bare corridor that runs at {direction:.0} degrees: its standard \
         deviation is {} m, and {} m are allowed (max_deviation)",
        beside_bound(*deviation, *most, 2)[0], beside_bound(*deviation, *most, 2)[1]
    )]
    OpenPosition {
        /// The degenerate direction, degrees in map a, from -90 to 90.
        direction: f64,
        /// Standard deviation along it, metres.
        deviation: f64,
        /// Largest deviation allowed, metres.
        most: f64,
    },
    /// The rotation is degenerate.
    #[error(
        "the walls do not constrain the rotation: its standard deviation is {degrees:.1} degrees, which moves walls by \
         {} m, and {} m are allowed (max_deviation)",
        beside_bound(*deviation, *most, 2)[0], beside_bound(*deviation, *most, 2)[1]
    )]
    OpenRotation {
        /// Standard deviation, degrees.
        degrees: f64,
        /// Standard deviation of the position of walls that follows from it, metres.
        deviation: f64,
        /// Largest deviation allowed, metres.
        most: f64,
    },
}

impl IcpRefusal {
    /// First reason against a registration, if there is one.
    pub fn of(registration: &Registration, parameters: &IcpParameters) -> Option<Self> {
        let (along, direction) =
            widest_deviation(&registration.centre_covariance.fixed_view::<2, 2>(0, 0).into_owned());
        let turn = registration.centre_covariance.m33.sqrt();
        let by_turn = turn * registration.radius;
        // Negated comparisons, so that a value that is not a number refuses.
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

    /// Reason against a registration that started at a peak of the search, if the covariance of the peak is too wide.
    /// Along a corridor with few walls across, registration converges to the nearest of them, right or wrong, and
    /// reports a small covariance; the width of the peak is then the true uncertainty.
    pub fn of_search(
        initial_guess: &InitialGuess,
        registration: &Registration,
        parameters: &IcpParameters,
    ) -> Option<Self> {
        let frame = LocalFrame { centre: registration.centre, scale: 1.0 };
        let derivative = frame.inverse_jacobian(&initial_guess.transform_a_b);
        let covariance = derivative * initial_guess.covariance * derivative.transpose();
        let (along, direction) = widest_deviation(&covariance.fixed_view::<2, 2>(0, 0).into_owned());
        let most = parameters.max_deviation;
        // A value that is not a number refuses, too.
        let is_fixed = along <= most;
        (!is_fixed).then(|| Self::OpenPosition { direction: direction.to_degrees(), deviation: along, most })
    }
}

/// Largest standard deviation of a position, metres, and its direction, radians from -pi/2 to pi/2.
fn widest_deviation(covariance: &Matrix2<f64>) -> (f64, f64) {
    let ellipse = CovarianceEllipse::new(covariance, 1.0);
    ellipse.map_or((f64::INFINITY, 0.0), |ellipse| (ellipse.half_axes[0], ellipse.direction))
}
