//! Known motions for self-checks.

use nalgebra::{Point3, Unit, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Rounds of the fixed point that undoes a motion: a motion changes by a tenth of itself at most over its own
/// length, so that each round gains a digit.
const ROUNDS: usize = 8;

/// A known displacement of every point, a function of where the point was.
///
/// In files a table with `kind`: `{ kind = "translation", d = [x, y, z] }`, or `{ kind = "bulge", centre =
/// [x, y, z], depth = m, diameter = m, direction = [x, y, z] }`; world frame, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Keys", into = "Keys")]
pub struct MotionField(Kind);

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Translation(Vector3<f64>),
    Bulge {
        centre: Point3<f64>,
        depth_m: f64,
        diameter_m: f64,
        direction: Unit<Vector3<f64>>,
    },
}

/// Why a motion cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionFieldError {
    /// Infinite, or not a number.
    #[error("{0} of the motion is not finite")]
    NotFinite(&'static str),
    /// Nothing would move, or it would move inside out.
    #[error("diameter of the bulge is {0} m, it must be positive")]
    Diameter(f64),
    /// No direction.
    #[error("direction of the bulge is zero, it must point somewhere")]
    NoDirection,
}

impl MotionField {
    /// Every point moves by `d`, metres.
    ///
    /// ```
    /// use nalgebra::{Point3, Vector3};
    /// use stonewise_core::evaluate::MotionField;
    ///
    /// let field = MotionField::translation(Vector3::new(0.0, 0.02, 0.05))?;
    /// assert_eq!(field.displacement_at(&Point3::origin()), Vector3::new(0.0, 0.02, 0.05));
    /// # Ok::<(), stonewise_core::evaluate::MotionFieldError>(())
    /// ```
    ///
    /// # Errors
    /// A component is no finite number.
    pub fn translation(d: Vector3<f64>) -> Result<Self, MotionFieldError> {
        finite("d", d.iter())?;
        Ok(Self(Kind::Translation(d)))
    }

    /// The displacement that all points share, metres; `None` for a bulge.
    pub fn common_displacement(&self) -> Option<Vector3<f64>> {
        match &self.0 {
            Kind::Translation(d) => Some(*d),
            Kind::Bulge { .. } => None,
        }
    }

    /// A round bulge: depth * cos^2(pi r / diameter) along `direction` (any length but zero) for r < diameter
    /// / 2.
    ///
    /// r is measured from `centre`, perpendicular to `direction`; the bulge reaches through the whole wall.
    /// A negative depth is a dent.
    ///
    /// # Errors
    /// A number is not finite, the diameter is not positive, or the direction is zero.
    pub fn bulge(
        centre: Point3<f64>,
        depth_m: f64,
        diameter_m: f64,
        direction: Vector3<f64>,
    ) -> Result<Self, MotionFieldError> {
        finite("centre", centre.iter())?;
        finite("depth", [depth_m].iter())?;
        finite("diameter", [diameter_m].iter())?;
        finite("direction", direction.iter())?;
        if diameter_m <= 0.0 {
            return Err(MotionFieldError::Diameter(diameter_m));
        }
        let direction = Unit::try_new(direction, 0.0).ok_or(MotionFieldError::NoDirection)?;
        Ok(Self(Kind::Bulge {
            centre,
            depth_m,
            diameter_m,
            direction,
        }))
    }

    /// Displacement of a point that was at `p`, metres, world frame.
    pub fn displacement_at(&self, p: &Point3<f64>) -> Vector3<f64> {
        match &self.0 {
            Kind::Translation(d) => *d,
            Kind::Bulge {
                centre,
                depth_m,
                diameter_m,
                direction,
            } => {
                let r = (p - centre).cross(direction).norm();
                if r < 0.5 * diameter_m {
                    direction.into_inner() * (depth_m * (std::f64::consts::PI * r / diameter_m).cos().powi(2))
                } else {
                    Vector3::zeros()
                }
            }
        }
    }

    /// Where a point that was at `p` is after the motion.
    pub fn apply(&self, p: &Point3<f64>) -> Point3<f64> {
        p + self.displacement_at(p)
    }

    /// Where a point that is at `moved` after the motion was before it.
    pub fn undo(&self, moved: &Point3<f64>) -> Point3<f64> {
        (0..ROUNDS).fold(*moved, |at, _| moved - self.displacement_at(&at))
    }

    /// No point moves further than this, metres.
    pub fn largest_m(&self) -> f64 {
        match &self.0 {
            Kind::Translation(d) => d.norm(),
            Kind::Bulge { depth_m, .. } => depth_m.abs(),
        }
    }
}

fn finite<'a>(what: &'static str, values: impl IntoIterator<Item = &'a f64>) -> Result<(), MotionFieldError> {
    if values.into_iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(MotionFieldError::NotFinite(what))
    }
}

/// The motion as files spell it.
#[derive(Clone, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
enum Keys {
    /// Every point moves alike.
    Translation {
        /// The motion, world frame, metres.
        d: [f64; 3],
    },
    /// A round bulge: depth * cos^2(pi r / diameter) along the direction for r < diameter / 2.
    Bulge {
        /// Where it is deepest, world frame, metres.
        centre: [f64; 3],
        /// Motion at the centre, metres.
        depth: f64,
        /// Diameter, metres.
        diameter: f64,
        /// Direction of the motion, world frame, of any length.
        direction: [f64; 3],
    },
}

impl TryFrom<Keys> for MotionField {
    type Error = MotionFieldError;

    fn try_from(keys: Keys) -> Result<Self, MotionFieldError> {
        match keys {
            Keys::Translation { d } => Self::translation(d.into()),
            Keys::Bulge {
                centre,
                depth,
                diameter,
                direction,
            } => Self::bulge(centre.into(), depth, diameter, direction.into()),
        }
    }
}

impl From<MotionField> for Keys {
    fn from(field: MotionField) -> Self {
        match field.0 {
            Kind::Translation(d) => Self::Translation { d: d.into() },
            Kind::Bulge {
                centre,
                depth_m,
                diameter_m,
                direction,
            } => Self::Bulge {
                centre: centre.into(),
                depth: depth_m,
                diameter: diameter_m,
                direction: direction.into_inner().into(),
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> Result<MotionField, String> {
        serde_json::from_str(json).map_err(|e| e.to_string())
    }

    #[test]
    fn a_bulge_is_deepest_at_its_axis_and_ends_at_its_rim() {
        let json =
            r#"{"kind":"bulge","centre":[0.1,-0.3,1.4],"depth":0.05,"diameter":4.0,"direction":[2,0,0]}"#;
        let bulge = read(json).unwrap();
        // Anywhere along the axis; half way out cos^2(pi / 4) = 1/2; at 2/3 of the radius cos^2(60 deg) =
        // 1/4.
        let at = |x: f64, y: f64, z: f64| bulge.displacement_at(&Point3::new(x, y, z));
        assert!((at(-7.0, -0.3, 1.4) - Vector3::new(0.05, 0.0, 0.0)).norm() < 1e-15);
        assert!((at(0.0, 0.7, 1.4).x - 0.025).abs() < 1e-15);
        assert!((at(0.0, -0.3, 1.4 - 4.0 / 3.0).x - 0.0125).abs() < 1e-15);
        assert_eq!(at(0.0, -0.3, 3.4), Vector3::zeros());
        assert_eq!(bulge.largest_m(), 0.05);
        let moved = bulge.apply(&Point3::new(1.0, 0.7, 1.4));
        assert!((moved.x - 1.025).abs() < 1e-15 && moved.y == 0.7);
    }

    #[test]
    fn motions_are_read_as_they_are_written() {
        let shift = read(r#"{"kind":"translation","d":[0,0.02,0.05]}"#).unwrap();
        assert_eq!(
            shift.apply(&Point3::new(1.0, 1.0, 1.0)),
            Point3::new(1.0, 1.02, 1.05)
        );
        let text = serde_json::to_string(&shift).unwrap();
        assert_eq!(text, r#"{"kind":"translation","d":[0.0,0.02,0.05]}"#);
        assert_eq!(read(&text).unwrap(), shift);
    }

    #[test]
    fn impossible_motions_are_refused() {
        assert!(
            read(r#"{"kind":"translation","d":[0,0,1],"speed":3}"#)
                .unwrap_err()
                .contains("speed")
        );
        assert!(
            read(r#"{"kind":"twist","d":[0,0,1]}"#)
                .unwrap_err()
                .contains("twist")
        );
        let bulge = |diameter, direction| MotionField::bulge(Point3::origin(), 0.05, diameter, direction);
        assert_eq!(bulge(0.0, Vector3::x()), Err(MotionFieldError::Diameter(0.0)));
        assert_eq!(bulge(1.0, Vector3::zeros()), Err(MotionFieldError::NoDirection));
        let nan = MotionField::translation(Vector3::new(f64::NAN, 0.0, 0.0));
        assert_eq!(nan, Err(MotionFieldError::NotFinite("d")));
    }
}
