//! How the cells of a face scatter in what their slopes say of a motion in the face.

/// Sums over a stone's small cells: each gives an estimate of the motion in the face from its own slopes,
/// with the weight of its points.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SlopeScatter {
    weights: f64,
    squares: f64,
    /// Motion times weight, times the square of the weight, and its square times that.
    products: [f64; 3],
}

impl SlopeScatter {
    pub fn add(&mut self, motion: f64, weight: f64) {
        self.weights += weight;
        self.squares += weight * weight;
        self.products[0] += weight * motion;
        self.products[1] += weight * weight * motion;
        self.products[2] += (weight * motion).powi(2);
    }

    /// Sum of the squared weighted distances from the mean, and what noise alone would make it.
    pub fn sums(&self) -> [f64; 2] {
        if self.weights <= 0.0 {
            return [0.0; 2];
        }
        let [first, second, third] = self.products;
        let mean = first / self.weights;
        let found = third - 2.0 * mean * second + mean * mean * self.squares;
        [found, self.weights - self.squares / self.weights]
    }

    /// How many cells of equal weight would scatter as reliably, less one for the mean.
    pub fn freedom(&self) -> f64 {
        (self.weights * self.weights / self.squares.max(f64::MIN_POSITIVE) - 1.0).max(0.0)
    }
}
