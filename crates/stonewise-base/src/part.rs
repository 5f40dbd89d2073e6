//! A part of a survey: which points of its clouds take part.

use crate::error::{Error, Result};
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use stonewise_core::geometry::Bounds;
use stonewise_core::statistics::upper_median;
use stonewise_io::cloud::read_cloud;

/// Points that take part; all others are as if they had not been measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Part {
    /// Inside a box along the axes of the world.
    Box(Bounds),
    /// Inside an upright section of a wall, whatever its depth.
    Section {
        /// Middle of the section, world frame.
        centre: Point3<f64>,
        /// Horizontal unit vector along the wall.
        along: Vector3<f64>,
        /// Length along the wall and vertical height, metres.
        size_m: [f64; 2],
    },
}

/// Points that are enough to find the middle of a wall and its direction.
const SAMPLES: u64 = 200_000;

impl Part {
    /// The box between two opposite corners, in either order.
    pub fn between(one: [f64; 3], other: [f64; 3]) -> Self {
        let (one, other) = (Point3::from(one), Point3::from(other));
        Self::Box(Bounds {
            min: one.inf(&other),
            max: one.sup(&other),
        })
    }

    /// The section of this size in the middle of the wall that clouds show.
    ///
    /// The middle is the median of the points in each axis. The wall runs along the direction in which the
    /// points' places on the map spread most.
    ///
    /// # Errors
    /// A cloud cannot be read, or there are no points.
    pub fn in_the_middle(clouds: &[PathBuf], size_m: [f64; 2]) -> Result<Self> {
        let mut points: Vec<Point3<f64>> = Vec::new();
        for path in clouds {
            let step = (stonewise_io::cloud::cloud_info(path)?.records / SAMPLES).max(1);
            read_cloud(path, 100_000, |chunk| {
                let sampled = chunk.positions.iter().zip(&chunk.indices);
                points.extend(sampled.filter(|(_, i)| *i % step == 0).map(|(p, _)| *p));
                Ok::<(), Error>(())
            })?;
        }
        Self::middle_of(points, size_m).ok_or_else(|| Error::Input {
            path: clouds.first().cloned().unwrap_or_default(),
            message: "holds no points".to_owned(),
        })
    }

    fn middle_of(points: Vec<Point3<f64>>, size_m: [f64; 2]) -> Option<Self> {
        let median = |axis: usize| {
            let mut values: Vec<f64> = points.iter().map(|p| p[axis]).collect();
            upper_median(&mut values)
        };
        let centre = Point3::new(median(0)?, median(1)?, median(2)?);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for d in points.iter().map(|p| p - centre) {
            xx += d.x * d.x;
            xy += d.x * d.y;
            yy += d.y * d.y;
        }
        // Principal axis of a symmetric 2 x 2 matrix.
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        Some(Self::Section {
            centre,
            along: Vector3::new(angle.cos(), angle.sin(), 0.0),
            size_m,
        })
    }

    /// Whether a point takes part.
    pub fn contains(&self, p: &Point3<f64>) -> bool {
        match self {
            Self::Box(bounds) => bounds.contains(p),
            Self::Section {
                centre,
                along,
                size_m,
            } => {
                let d = p - centre;
                2.0 * d.dot(along).abs() <= size_m[0] && 2.0 * d.z.abs() <= size_m[1]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_section_follows_the_wall_whatever_way_it_runs() {
        for turn in [0.0, 0.7, 2.0] {
            let (sin, cos) = f64::sin_cos(turn);
            // 40 x 20 m, leaning back by 1:5, far from the origin.
            let wall = |a: f64, z: f64| {
                let (x, y) = (a, -0.2 * z);
                Point3::new(4e5 + x * cos - y * sin, 5e6 + x * sin + y * cos, 300.0 + z)
            };
            let points = (0..=80)
                .flat_map(|i| (0..=40).map(move |j| wall(0.5 * f64::from(i) - 20.0, 0.5 * f64::from(j))));
            let part = Part::middle_of(points.collect(), [5.0, 5.0]).unwrap();
            for (a, z, inside) in [
                (0.0, 10.0, true),
                (2.4, 12.4, true),
                (2.6, 10.0, false),
                (-2.4, 7.6, true),
                (0.0, 12.6, false),
            ] {
                assert_eq!(part.contains(&wall(a, z)), inside, "{turn} {a} {z}");
            }
        }
    }
}
