//! Why a refined alignment may not be used.

use super::{Agreement, IcpParameters, Registration, Rival};
use nalgebra::{Matrix2, SymmetricEigen};

/// More steps than the main axes of two numbers ever take.
const MOST_SWEEPS: usize = 100;

/// Why a refined alignment may not be used. The texts are for the people who run the robots.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// Nothing to align.
    #[error("the maps have no walls that lie near each other")]
    NoWalls,
    /// The iteration limit was reached.
    #[error("ICP has not settled after {iterations} iterations")]
    NotConverged {
        /// Iterations made.
        iterations: usize,
    },
    /// The maps share too little.
    #[error("the maps overlap by {overlap:.0} m2, and at least {least:.0} m2 are needed")]
    Overlap {
        /// Area that both maps know, square metres.
        overlap: f64,
        /// What is asked for, square metres.
        least: f64,
    },
    /// Too little wall lies on wall.
    #[error("the maps agree on {length:.1} m of wall, and at least {least:.1} m are needed")]
    WallLength {
        /// Metres of wall on which the maps agree.
        length: f64,
        /// What is asked for, metres.
        least: f64,
    },
    /// Walls lie where the other map knows free space.
    #[error(
        "the maps contradict each other: {agree:.1} m of wall agree, but {against:.1} m of wall lie on the other map's \
         free space ({:.0} % agree, and at least {:.0} % are needed)",
        share * 100.0,
        least * 100.0
    )]
    WallAgreement {
        /// Metres of wall on which the maps agree.
        agree: f64,
        /// Metres of wall on free space.
        against: f64,
        /// The share that agrees, 0 to 1.
        share: f64,
        /// What is asked for, 0 to 1.
        least: f64,
    },
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
    /// The first guess is provisional, and the maps fit elsewhere nearly as well.
    #[error(
        "{:.0} % of the walls agree, but {:.0} % do with the map moved by {shift:.1} m and turned by {turn:.0} degrees, and \
         at least {:.0} % less are needed: it cannot be told which is right",
        share * 100.0,
        rival * 100.0,
        margin * 100.0
    )]
    Rival {
        /// The share of the walls that agree, 0 to 1.
        share: f64,
        /// The share that agrees elsewhere, 0 to 1.
        rival: f64,
        /// How far elsewhere is, metres.
        shift: f64,
        /// How much the map is turned there, degrees.
        turn: f64,
        /// By how much the share must be less, 0 to 1.
        margin: f64,
    },
    /// The rotation is open.
    #[error("the maps leave the rotation open: it is known to {deviation:.1} degrees, and {most:.1} are allowed")]
    OpenRotation {
        /// Standard deviation, degrees.
        deviation: f64,
        /// What is allowed, degrees.
        most: f64,
    },
}

impl Refusal {
    /// The first reason against an alignment, if there is one.
    pub fn of(registration: &Registration, agreement: &Agreement, parameters: &IcpParameters) -> Option<Self> {
        let (agree, against, share) = (agreement.wall_on_wall, agreement.wall_on_free, agreement.wall_agreement());
        let (along, direction) =
            widest_deviation(&registration.centre_covariance.fixed_view::<2, 2>(0, 0).into_owned());
        let turn = registration.centre_covariance.m33.sqrt();
        // Negated comparisons, so that a value that is no number refuses.
        let at_least = |value: f64, least: f64| value >= least;
        if registration.inliers == 0 {
            Some(Self::NoWalls)
        } else if !registration.converged {
            Some(Self::NotConverged { iterations: registration.iterations })
        } else if !at_least(agreement.overlap, parameters.min_overlap) {
            Some(Self::Overlap { overlap: agreement.overlap, least: parameters.min_overlap })
        } else if !at_least(agree, parameters.min_wall_length) {
            Some(Self::WallLength { length: agree, least: parameters.min_wall_length })
        } else if !at_least(share, parameters.min_wall_agreement) {
            Some(Self::WallAgreement { agree, against, share, least: parameters.min_wall_agreement })
        } else if !at_least(parameters.max_step, registration.step) {
            Some(Self::Step { step: registration.step, most: parameters.max_step })
        } else if !at_least(parameters.max_position_deviation, along) {
            let most = parameters.max_position_deviation;
            Some(Self::OpenPosition { direction: direction.to_degrees(), deviation: along, most })
        } else if !at_least(parameters.max_yaw_deviation, turn) {
            let most = parameters.max_yaw_deviation.to_degrees();
            Some(Self::OpenRotation { deviation: turn.to_degrees(), most })
        } else {
            None
        }
    }
}

impl Refusal {
    /// The reason against a provisional alignment that a rival gives, if it comes near.
    pub(super) fn by_rival(agreement: &Agreement, rival: &Rival, parameters: &IcpParameters) -> Option<Self> {
        let (share, margin) = (agreement.wall_agreement(), parameters.rival_margin);
        let is_clear = share - rival.agreement.wall_agreement() >= margin;
        (!is_clear).then(|| Self::Rival {
            share,
            rival: rival.agreement.wall_agreement(),
            shift: rival.shift,
            turn: rival.turn.to_degrees(),
            margin,
        })
    }
}

/// The greatest standard deviation of a position, metres, and its direction, radians from -pi/2 to pi/2.
fn widest_deviation(covariance: &Matrix2<f64>) -> (f64, f64) {
    let Some(eigen) = SymmetricEigen::try_new(*covariance, f64::EPSILON, MOST_SWEEPS) else {
        return (f64::INFINITY, 0.0);
    };
    let widest = usize::from(eigen.eigenvalues[1] > eigen.eigenvalues[0]);
    let axis = eigen.eigenvectors.column(widest);
    let direction = if axis.x == 0.0 { std::f64::consts::FRAC_PI_2 } else { (axis.y / axis.x).atan() };
    (eigen.eigenvalues[widest].max(0.0).sqrt(), direction)
}
