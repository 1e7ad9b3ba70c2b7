//! A dense column of blocks of 3 x 3, on which all arithmetic of the factorization is done.

use nalgebra::{Matrix3, Vector3};

/// Three columns of a dense matrix, one after the other in memory: the processor works on several rows at once.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct BlockColumn {
    values: Vec<f64>,
    /// Number of scalar rows.
    height: usize,
}

impl BlockColumn {
    /// A column of zeros with as many `blocks`.
    pub(super) fn zeros(blocks: usize) -> Self {
        Self { values: vec![0.0; 9 * blocks], height: 3 * blocks }
    }

    /// Number of blocks.
    pub(super) fn len(&self) -> usize {
        self.height / 3
    }

    pub(super) fn block(&self, place: usize) -> Matrix3<f64> {
        Matrix3::from_fn(|row, column| self.values[column * self.height + 3 * place + row])
    }

    pub(super) fn set(&mut self, place: usize, block: &Matrix3<f64>) {
        self.change(place, block, |value, by| *value = by);
    }

    pub(super) fn add(&mut self, place: usize, block: &Matrix3<f64>) {
        self.change(place, block, |value, by| *value += by);
    }

    fn change(&mut self, place: usize, block: &Matrix3<f64>, change: impl Fn(&mut f64, f64)) {
        for (column, values) in self.values.chunks_exact_mut(self.height).enumerate() {
            let values = &mut values[3 * place..3 * place + 3];
            (0..3).for_each(|row| change(&mut values[row], block[(row, column)]));
        }
    }

    /// Adds each block of another column at its place, less `first`.
    pub(super) fn scatter(&mut self, other: &Self, places: &[usize], first: usize) {
        let columns = self.values.chunks_exact_mut(self.height).zip(other.values.chunks_exact(other.height));
        for (into, values) in columns {
            for (place, values) in places.iter().zip(values.chunks_exact(3)) {
                let start = 3 * (place - first);
                into[start..start + 3].iter_mut().zip(values).for_each(|(into, value)| *into += value);
            }
        }
    }

    /// Takes the blocks at the given places of another column, from the block `first` on.
    pub(super) fn gather(&mut self, first: usize, other: &Self, places: &[usize]) {
        let columns = self.values.chunks_exact_mut(self.height).zip(other.values.chunks_exact(other.height));
        for (into, values) in columns {
            for (into, place) in into[3 * first..].chunks_exact_mut(3).zip(places) {
                into.copy_from_slice(&values[3 * place..3 * place + 3]);
            }
        }
    }

    /// Subtracts from this column the blocks of another one from `first` on, each times `by`.
    pub(super) fn subtract_product(&mut self, other: &Self, first: usize, by: &Matrix3<f64>) {
        let height = self.height;
        let (into_x, rest) = self.values.split_at_mut(height);
        let (into_y, into_z) = rest.split_at_mut(height);
        let part = |column: usize| &other.values[column * other.height + 3 * first..][..height];
        let from = part(0).iter().zip(part(1)).zip(part(2));
        let into = into_x.iter_mut().zip(into_y).zip(into_z);
        for (((into_x, into_y), into_z), ((x, y), z)) in into.zip(from) {
            *into_x -= x * by.m11 + y * by.m21 + z * by.m31;
            *into_y -= x * by.m12 + y * by.m22 + z * by.m32;
            *into_z -= x * by.m13 + y * by.m23 + z * by.m33;
        }
    }

    /// Subtracts the product of the blocks below the first and a vector from the rows of these blocks.
    pub(super) fn subtract_below(&self, by: &Vector3<f64>, rows: &mut [f64]) {
        let [xs, ys, zs] = self.below();
        for (((row, x), y), z) in rows.iter_mut().zip(xs).zip(ys).zip(zs) {
            *row -= x * by.x + y * by.y + z * by.z;
        }
    }

    /// Product of the transposed blocks below the first and the rows of these blocks.
    pub(super) fn product_below(&self, rows: &[f64]) -> Vector3<f64> {
        self.below().map(|column| dot(column, &rows[..column.len()])).into()
    }

    /// The three columns below the first block.
    fn below(&self) -> [&[f64]; 3] {
        std::array::from_fn(|column| &self.values[column * self.height + 3..(column + 1) * self.height])
    }

    /// Multiplies the blocks from `first` on by a matrix from the right.
    pub(super) fn multiply(&mut self, first: usize, by: &Matrix3<f64>) {
        let (xs, rest) = self.values.split_at_mut(self.height);
        let (ys, zs) = rest.split_at_mut(self.height);
        let rows = xs.iter_mut().zip(ys).zip(zs).skip(3 * first);
        for ((to_x, to_y), to_z) in rows {
            let (x, y, z) = (*to_x, *to_y, *to_z);
            *to_x = x * by.m11 + y * by.m21 + z * by.m31;
            *to_y = x * by.m12 + y * by.m22 + z * by.m32;
            *to_z = x * by.m13 + y * by.m23 + z * by.m33;
        }
    }
}

/// Scalar product, in sums of their own for the places that the processor multiplies together.
fn dot(one: &[f64], other: &[f64]) -> f64 {
    const TOGETHER: usize = 4;
    let mut sums = [0.0; TOGETHER];
    let ((ones, last_one), (others, last_other)) = (one.as_chunks::<TOGETHER>(), other.as_chunks::<TOGETHER>());
    for (one, other) in ones.iter().zip(others) {
        sums.iter_mut().zip(one.iter().zip(other)).for_each(|(sum, (one, other))| *sum += one * other);
    }
    let rest: f64 = last_one.iter().zip(last_other).map(|(one, other)| one * other).sum();
    sums.iter().sum::<f64>() + rest
}
