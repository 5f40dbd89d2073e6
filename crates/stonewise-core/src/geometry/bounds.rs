//! Axis-aligned boxes.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// An axis-aligned box, metres; both corners belong to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: Point3<f64>,
    /// Largest coordinates.
    pub max: Point3<f64>,
}

impl Bounds {
    /// The smallest box around the points; `None` where there are none.
    pub fn of(points: impl IntoIterator<Item = Point3<f64>>) -> Option<Self> {
        points.into_iter().fold(None, |bounds: Option<Self>, p| {
            Some(match bounds {
                None => Self { min: p, max: p },
                Some(b) => Self {
                    min: b.min.inf(&p),
                    max: b.max.sup(&p),
                },
            })
        })
    }

    /// The smallest box around both.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.inf(&other.min),
            max: self.max.sup(&other.max),
        }
    }

    /// The box somewhere else.
    pub fn moved(&self, by: &Vector3<f64>) -> Self {
        Self {
            min: self.min + by,
            max: self.max + by,
        }
    }

    /// The box, larger by `margin_m` on every side.
    pub fn grown(&self, margin_m: f64) -> Self {
        let margin = Vector3::repeat(margin_m);
        Self {
            min: self.min - margin,
            max: self.max + margin,
        }
    }

    /// Whether the point lies inside or on the border.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        (0..3).all(|i| self.min[i] <= p[i] && p[i] <= self.max[i])
    }

    /// Whether the boxes share a point.
    pub fn intersects(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// The middle of the box.
    pub fn centre(&self) -> Point3<f64> {
        nalgebra::center(&self.min, &self.max)
    }

    /// The eight corners.
    pub fn corners(&self) -> [Point3<f64>; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| {
                if i >> axis & 1 == 0 {
                    self.min[axis]
                } else {
                    self.max[axis]
                }
            };
            Point3::new(pick(0), pick(1), pick(2))
        })
    }
}
