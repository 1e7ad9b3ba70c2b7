//! A dense column of blocks of 3 x 3, on which all arithmetic of the factorization is done.

use nalgebra::Matrix3;

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
