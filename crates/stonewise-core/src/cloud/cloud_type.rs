//! Positions kept small and exact.

use nalgebra::{Point3, Vector3};

/// Points as single-precision offsets from a double-precision origin.
///
/// Within 8 m of the origin an offset is exact to half a micrometre; clouds are cut into tiles of that size.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    origin: Point3<f64>,
    offsets: Vec<[f32; 3]>,
}

impl Cloud {
    /// A cloud from offsets, metres, about an origin in the world frame.
    pub fn new(origin: Point3<f64>, offsets: Vec<[f32; 3]>) -> Self {
        Self { origin, offsets }
    }

    /// A cloud from world positions.
    pub fn from_world(origin: Point3<f64>, points: impl IntoIterator<Item = Point3<f64>>) -> Self {
        let offsets = points
            .into_iter()
            .map(|p| (p - origin).cast::<f32>().into())
            .collect();
        Self { origin, offsets }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.offsets.len()
    }

    /// Whether there are no points.
    pub fn is_empty(&self) -> bool {
        self.offsets.is_empty()
    }

    /// Where offset zero lies in the world.
    pub fn origin(&self) -> Point3<f64> {
        self.origin
    }

    /// All offsets from the origin, metres.
    pub fn offsets(&self) -> &[[f32; 3]] {
        &self.offsets
    }

    /// Point `i` relative to the origin.
    #[inline]
    pub fn local(&self, i: usize) -> Point3<f64> {
        let [x, y, z] = self.offsets[i];
        Point3::new(f64::from(x), f64::from(y), f64::from(z))
    }

    /// Point `i` in the world frame.
    #[inline]
    pub fn world(&self, i: usize) -> Point3<f64> {
        self.origin + self.local(i).coords
    }

    /// Adds the points of another cloud, moved to this one's origin.
    pub fn append(&mut self, other: &Self) {
        let shift: Vector3<f64> = other.origin - self.origin;
        self.offsets.extend((0..other.len()).map(|i| {
            let q = (other.local(i).coords + shift).cast::<f32>();
            [q.x, q.y, q.z]
        }));
    }
}
