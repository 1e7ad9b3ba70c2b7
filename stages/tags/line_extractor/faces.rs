//! Direction of one wall from all cells near it: a line of cells, a solid band, or two parallel faces.
//!
//! A least squares line through all cells near a wall is turned by partly seen faces, and by what stands at the wall.
//! So the wall is first turned until its profile, the histogram of the cells' distances from its line, is sharpest:
//! the sum of its squares is greatest when each face is in few bins. The profile is then split at its valleys into
//! faces, and all faces are fitted at once: one slope for all and an offset for each, where cells far from their face
//! have little or no weight (Tukey's biweight).

/// Bins of the profile per cell.
const BINS_A_CELL: f64 = 2.0;
/// Empty bins to either side, for smoothing.
const MARGIN: usize = 5;
/// Largest height of a valley between two faces, as a share of the lower of the two peaks beside it.
const VALLEY: f64 = 0.6;
/// Least share of the cells of the greatest face for another face; less is what stands at the wall.
const LEAST_SHARE: f64 = 0.2;
/// Least standard deviation of the cells of a face, in cells. A straight line of single cells has 0.3, and the cells
/// of walls that begin a cell beside it do not count.
const LEAST_DEVIATION: f64 = 0.33;
/// Outlier bound of cells, standard deviations from their face.
const OUTLIER_DEVIATIONS: f64 = 3.0;
/// Variance of a normal distribution that is left after weighting by the biweight.
const VARIANCE_LEFT: f64 = 0.6364;
/// Number of fits of all faces.
const FITS: usize = 3;
/// Most slopes tried to either side.
const MOST_TURNS: f64 = 12.0;
/// Approximate number of cells by which the sharpest profile is found.
const SAMPLE: usize = 150;

/// A cell in the coordinates of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Offset {
    /// Along the wall, from its middle, in cells.
    pub(super) along: f64,
    /// Across the wall, from its line, in cells.
    pub(super) across: f64,
}

/// Correction of a wall's line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Correction {
    /// Tangent of the angle to turn by, about the wall's middle.
    pub(super) slope: f64,
    /// Offset across, in cells.
    pub(super) across: f64,
}

/// Fits all faces of a wall at once. The cells are within `half_length` along and `reach` across, in cells.
///
/// `None` if they do not determine a direction.
pub(super) fn fit_faces(cells: &[Offset], half_length: f64, reach: f64) -> Option<Correction> {
    let (mut slope, profile) = sharpest(cells, half_length, reach);
    let mut faces: Vec<Face> = profile.faces();
    for _ in 0..FITS {
        let mut sums = vec![Sums::default(); faces.len()];
        for cell in cells {
            let across = cell.across - slope * cell.along;
            if let Some(index) = faces.iter().position(|face| across < face.high) {
                sums[index].add(cell.along, across, faces[index].weight(across));
            }
        }
        let (mut covariance, mut variance) = (0.0, 0.0);
        for (face, sums) in faces.iter_mut().zip(&sums).filter(|(_, sums)| sums.weight > 0.0) {
            face.update(sums);
            covariance += sums.covariance() / face.variance;
            variance += sums.variance_along() / face.variance;
        }
        let change = covariance / variance;
        if !change.is_finite() {
            return None;
        }
        slope += change;
        for (face, sums) in faces.iter_mut().zip(&sums).filter(|(_, sums)| sums.weight > 0.0) {
            face.place -= change * sums.along / sums.weight;
        }
    }
    let weight: f64 = faces.iter().map(|face| face.members).sum();
    let across = faces.iter().map(|face| face.place * face.members).sum::<f64>() / weight;
    across.is_finite().then_some(Correction { slope, across })
}

/// The slope at which the profile is sharpest, and the profile.
fn sharpest(cells: &[Offset], half_length: f64, reach: f64) -> (f64, Profile) {
    // A turn moves the ends of the wall by a cell.
    let turn = 1.0 / half_length.max(1.0);
    let turns = reach.ceil().min(MOST_TURNS);
    let stride = cells.len().div_ceil(SAMPLE).max(1);
    let mut profile = Profile::new(reach + turns + 1.0);
    let mut best = (0.0, f64::NEG_INFINITY);
    // From the middle outwards: of equal slopes the least is taken.
    for step in 0..=2 * turns as i32 {
        let slope = turn * f64::from(if step % 2 == 0 { step / 2 } else { -(step + 1) / 2 });
        profile.fill(cells.iter().step_by(stride), slope);
        let sharpness = profile.sharpness();
        if sharpness > best.1 {
            best = (slope, sharpness);
        }
    }
    profile.fill(cells.iter(), best.0);
    (best.0, profile)
}

/// Histogram of the distances of cells from a line.
struct Profile {
    /// Distance at which the first bin begins, and the counts.
    low: f64,
    bins: Vec<f64>,
    smooth: Vec<f64>,
}

impl Profile {
    /// An empty profile of the distances up to `reach` to both sides.
    fn new(reach: f64) -> Self {
        let bins = (2.0 * reach * BINS_A_CELL).ceil() as usize + 2 * MARGIN + 1;
        Self { low: -(bins as f64) / (2.0 * BINS_A_CELL), bins: vec![0.0; bins], smooth: vec![0.0; bins] }
    }

    /// Counts the cells' distances from a line of the given slope. The counts are smoothed, so that rows of cells
    /// that a line crosses do not look like faces.
    fn fill<'a>(&mut self, cells: impl Iterator<Item = &'a Offset>, slope: f64) {
        self.bins.fill(0.0);
        let last = self.bins.len() - MARGIN - 1;
        for cell in cells {
            let place = (cell.across - slope * cell.along - self.low) * BINS_A_CELL + 0.5;
            self.bins[(place as usize).clamp(MARGIN, last)] += 1.0;
        }
        for _ in 0..2 {
            smooth(&self.bins, &mut self.smooth);
            std::mem::swap(&mut self.bins, &mut self.smooth);
        }
    }

    fn sharpness(&self) -> f64 {
        self.bins.iter().map(|count| count * count).sum()
    }

    /// Splits the profile at its valleys, and leaves out what is too small to be a face.
    fn faces(&self) -> Vec<Face> {
        let mut faces = Vec::new();
        // The greatest count since the last border, and the bin of the least count since then.
        let (mut start, mut peak, mut valley) = (0, 0.0, 0);
        for (bin, &count) in self.bins.iter().enumerate() {
            let least = self.bins[valley];
            if count <= least {
                valley = bin;
            } else if peak > 0.0 && least <= VALLEY * count.min(peak) {
                // Past the valley the profile has risen enough for a face of its own.
                faces.push(self.face(start, valley));
                (start, peak, valley) = (valley, count, bin);
            } else if count > peak {
                (peak, valley) = (count, bin);
            }
        }
        faces.push(Face { high: f64::INFINITY, ..self.face(start, self.bins.len()) });
        let most = faces.iter().map(|face| face.members).fold(0.0, f64::max);
        faces.retain(|face| face.members >= LEAST_SHARE * most);
        faces
    }

    /// The face in the bins from `start` to before `end`.
    fn face(&self, start: usize, end: usize) -> Face {
        let (mut count, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for bin in start..end {
            let place = self.place(bin);
            count += self.bins[bin];
            sum += self.bins[bin] * place;
            squares += self.bins[bin] * place * place;
        }
        let place = if count > 0.0 { sum / count } else { self.place(start) };
        let variance = if count > 0.0 { squares / count - place * place } else { 0.0 };
        Face { high: self.place(end), place, variance: variance.max(LEAST_DEVIATION.powi(2)), members: count }
    }

    fn place(&self, bin: usize) -> f64 {
        self.low + bin as f64 / BINS_A_CELL
    }
}

/// Smooths with the binomial kernel of five bins, a standard deviation of one bin. The two bins at either end stay
/// empty.
fn smooth(from: &[f64], to: &mut [f64]) {
    for (value, near) in to[2..].iter_mut().zip(from.windows(5)) {
        *value = ((near[0] + near[4]) + 4.0 * (near[1] + near[3]) + 6.0 * near[2]) / 16.0;
    }
}

/// One side of a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Face {
    /// Offset across at which the next face begins.
    high: f64,
    /// Offset of the face across the wall.
    place: f64,
    /// Variance of its cells across the wall.
    variance: f64,
    /// Sum of its cells' weights.
    members: f64,
}

impl Face {
    /// Weight of a cell: the biweight.
    fn weight(&self, across: f64) -> f64 {
        let offset = across - self.place;
        let share = 1.0 - offset * offset / (self.variance * OUTLIER_DEVIATIONS * OUTLIER_DEVIATIONS);
        share.max(0.0) * share.max(0.0)
    }

    fn update(&mut self, sums: &Sums) {
        self.place = sums.across / sums.weight;
        let variance = sums.squares / sums.weight - self.place * self.place;
        self.variance = (variance / VARIANCE_LEFT).max(LEAST_DEVIATION.powi(2));
        self.members = sums.weight;
    }
}

/// Weighted sums over the cells of a face.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    weight: f64,
    along: f64,
    across: f64,
    along_squares: f64,
    squares: f64,
    products: f64,
}

impl Sums {
    fn add(&mut self, along: f64, across: f64, weight: f64) {
        self.weight += weight;
        self.along += weight * along;
        self.across += weight * across;
        self.along_squares += weight * along * along;
        self.squares += weight * across * across;
        self.products += weight * along * across;
    }

    fn covariance(&self) -> f64 {
        self.products - self.along * self.across / self.weight
    }

    fn variance_along(&self) -> f64 {
        self.along_squares - self.along * self.along / self.weight
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Cells of lines at the given offsets across, with a slope, from `from` to `to` along. Since cells have integer
    /// coordinates, a line determines its slope only to about three quarters of a cell over half its length.
    fn faces(slope: f64, faces: &[(f64, f64, f64)]) -> Vec<Offset> {
        let face = |&(across, from, to): &(f64, f64, f64)| {
            let steps = (to - from) as usize;
            (0..=steps).map(move |step| {
                let along = from + step as f64;
                Offset { along, across: (across + slope * along - 0.5).round() + 0.5 }
            })
        };
        faces.iter().flat_map(face).collect()
    }

    proptest! {
        #[test]
        fn one_line_of_cells_determines_its_slope_and_offset(slope in -0.04..0.04, across in -1.5..1.5) {
            let correction = fit_faces(&faces(slope, &[(across, -60.0, 60.0)]), 60.0, 4.0).unwrap();
            prop_assert!((correction.slope - slope).abs() < 0.8 / 60.0, "{correction:?}");
            prop_assert!((correction.across - across).abs() < 0.55, "{correction:?}");
        }

        #[test]
        fn two_faces_that_are_seen_in_different_parts_do_not_turn_the_wall(slope in -0.03..0.03, gap in 5.0..6.5f64) {
            let cells = faces(slope, &[(-0.5 * gap, -60.0, 10.0), (0.5 * gap, -20.0, 60.0)]);
            let correction = fit_faces(&cells, 60.0, 5.0).unwrap();
            prop_assert!((correction.slope - slope).abs() < 0.8 / 35.0, "{correction:?}");
        }

        #[test]
        fn whatever_the_cells_are_the_correction_is_made_of_numbers(
            cells in prop::collection::vec((-50.0..50.0, -8.0..8.0), 0..40), half in 0.1..60.0, reach in 0.1..8.0,
        ) {
            let cells: Vec<Offset> = cells.iter().map(|&(along, across)| Offset { along, across }).collect();
            if let Some(correction) = fit_faces(&cells, half, reach) {
                prop_assert!(correction.slope.is_finite() && correction.across.is_finite());
            }
        }
    }

    #[test]
    fn a_solid_wall_is_fitted_as_a_whole() {
        let rows: Vec<(f64, f64, f64)> = (-3..=3).map(|row| (f64::from(row), -80.0, 80.0)).collect();
        for slope in [-0.02, 0.0, 0.013] {
            let correction = fit_faces(&faces(slope, &rows), 80.0, 5.0).unwrap();
            assert!((correction.slope - slope).abs() < 0.002, "{slope} {correction:?}");
        }
    }

    #[test]
    fn furniture_at_a_wall_does_not_turn_it() {
        let wall = (0.0, -60.0, 60.0);
        let furniture = (3.5, 20.0, 55.0);
        let with = fit_faces(&faces(0.01, &[wall, furniture]), 60.0, 4.5).unwrap();
        assert!((with.slope - 0.01).abs() < 0.004, "{with:?}");
    }

    #[test]
    fn cells_at_one_position_and_no_cells_determine_nothing() {
        assert_eq!(fit_faces(&[], 10.0, 4.0), None);
        assert_eq!(fit_faces(&[Offset { along: 1.0, across: 0.5 }; 9], 10.0, 4.0), None);
    }

    #[test]
    fn a_profile_is_cut_at_its_valleys_only() {
        let cut = |lines: &[(f64, f64, f64)]| {
            let mut profile = Profile::new(6.0);
            profile.fill(faces(0.0, lines).iter(), 0.0);
            profile.faces().len()
        };
        assert_eq!(cut(&[(0.0, 0.0, 50.0)]), 1);
        assert_eq!(cut(&[(-0.5, 0.0, 50.0), (0.5, 50.0, 99.0)]), 1, "a line that crosses two rows of cells");
        assert_eq!(cut(&[(-3.0, 0.0, 50.0), (3.0, 0.0, 30.0)]), 2);
        assert_eq!(cut(&[(-4.5, 0.0, 50.0), (-0.5, 0.0, 50.0), (3.5, 0.0, 20.0)]), 3);
        assert_eq!(cut(&[]), 1);
    }
}
