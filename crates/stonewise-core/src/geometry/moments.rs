//! Sums over points, of which planes are made.

use nalgebra::{Matrix3, Vector3};

/// Number, sum and sum of products of vectors: what the mean and the covariance of points follow from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Moments {
    /// Number of vectors.
    pub count: f64,
    /// Their sum, metres.
    pub sum: Vector3<f64>,
    /// Sums of xx, yy, zz.
    diagonal: Vector3<f64>,
    /// Sums of yz, zx, xy.
    mixed: Vector3<f64>,
}

impl Moments {
    /// Adds one vector.
    #[inline]
    pub fn add(&mut self, v: &Vector3<f64>) {
        self.count += 1.0;
        self.sum += v;
        self.diagonal += v.component_mul(v);
        self.mixed += Vector3::new(v.y * v.z, v.z * v.x, v.x * v.y);
    }

    /// Adds all vectors of other moments, each with `shift` added to it.
    #[inline]
    pub fn add_moved(&mut self, other: &Self, shift: &Vector3<f64>) {
        let (n, s, m) = (other.count, shift, &other.sum);
        self.count += n;
        self.sum += m + s * n;
        self.diagonal += other.diagonal + m.component_mul(s) * 2.0 + s.component_mul(s) * n;
        let mixed = |a: usize, b: usize| m[a] * s[b] + m[b] * s[a] + n * s[a] * s[b];
        self.mixed += other.mixed + Vector3::new(mixed(1, 2), mixed(2, 0), mixed(0, 1));
    }

    /// Sum of the products of each vector with itself, square metres.
    pub fn square(&self) -> Matrix3<f64> {
        let (d, m) = (&self.diagonal, &self.mixed);
        Matrix3::new(d.x, m.z, m.y, m.z, d.y, m.x, m.y, m.x, d.z)
    }

    /// Covariance (divisor n), square metres. The vectors' origin is best as near to them as they are to each
    /// other: the square of its distance costs digits.
    pub fn covariance(&self) -> Matrix3<f64> {
        let mean = self.sum / self.count;
        self.square() / self.count - mean * mean.transpose()
    }
}
