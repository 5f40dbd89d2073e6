//! The idealised face of the dam: battered, straight or curved in plan.

use nalgebra::{Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use stonewise_core::geometry::{FaceFrame, Rigid3};

/// A battered face and its coordinates: `a` along the face from its middle, `u` up in the face, `n` out of
/// it.
///
/// World frame: x downstream (out of the face, at the middle), y along the dam, z up; (0, 0, 0) has a = u = n
/// = 0. Lengths along `a` are measured at u = n = 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// Cosine and sine of the lean.
    lean: [f64; 2],
    /// Radius in plan, metres; infinite for a straight wall.
    radius_m: f64,
}

/// Coordinates on the face, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacePoint {
    /// Along the face.
    pub a: f64,
    /// Up in the face.
    pub u: f64,
    /// Out of the face.
    pub n: f64,
}

impl Face {
    /// A face that leans back by `batter` metres per metre of height. `plan_radius_m`: radius of the plan,
    /// centre downstream where positive (the visible face is hollow, as on most dams); 0 means straight.
    pub fn new(batter: f64, plan_radius_m: f64) -> Self {
        let length = batter.hypot(1.0);
        Self {
            lean: [1.0 / length, batter / length],
            radius_m: if plan_radius_m == 0.0 {
                f64::INFINITY
            } else {
                plan_radius_m
            },
        }
    }

    /// Whether the plan is straight, so that the face is a plane.
    pub fn is_plane(&self) -> bool {
        self.radius_m.is_infinite()
    }

    /// Where a world point lies in face coordinates.
    #[inline]
    pub fn face_of(&self, p: &Point3<f64>) -> FacePoint {
        self.face_and_out(p).0
    }

    /// Where a world point lies in face coordinates, and the outward normal of the face there.
    #[inline]
    pub fn face_and_out(&self, p: &Point3<f64>) -> (FacePoint, Vector3<f64>) {
        let [c, s] = self.lean;
        let (x, a, out) = if self.is_plane() {
            (p.x, p.y, Vector3::new(c, 0.0, s))
        } else {
            let side = self.radius_m.signum();
            let (dx, dy) = (side * (self.radius_m - p.x), side * p.y);
            // Not hypot, which guards against overflow at several times the cost.
            let from_axis = (dx * dx + dy * dy).sqrt();
            (
                self.radius_m - side * from_axis,
                dy.atan2(dx) * self.radius_m,
                Vector3::new(c * dx / from_axis, -c * dy / from_axis, s),
            )
        };
        let at = FacePoint {
            a,
            u: c * p.z - s * x,
            n: c * x + s * p.z,
        };
        (at, out)
    }

    /// Distance along a ray at which it first comes down to `height_m` over the face; 0 where it starts there
    /// or lower, `None` where it never does. `along` is a unit vector.
    ///
    /// Places of one height over a curved face lie on a cone about the axis of the plan: a quadratic
    /// equation.
    pub fn come_down(&self, from: &Point3<f64>, along: &Vector3<f64>, height_m: f64) -> Option<f64> {
        let (at, out) = self.face_and_out(from);
        let above = at.n - height_m;
        // A ray that starts there may seem to start a rounding error above.
        if above <= 1e-9 {
            return Some(0.0);
        }
        if self.is_plane() {
            let descent = -along.dot(&out);
            return (descent > 1e-9).then(|| above / descent);
        }
        // The cone's signed radius at distance t is q + r t, the ray's distance from the axis in plan the
        // root of (x - along.x t)^2 + (y + along.y t)^2.
        let [c, s] = self.lean;
        let (x, y) = (self.radius_m - from.x, from.y);
        let (q, r) = (self.radius_m - (height_m - s * from.z) / c, s * along.z / c);
        let square = along.x * along.x + along.y * along.y - r * r;
        let half = y * along.y - x * along.x - q * r;
        let rest = x * x + y * y - q * q;
        let discriminant = half * half - square * rest;
        if discriminant < 0.0 {
            return None;
        }
        let k = -(half + half.signum() * discriminant.sqrt());
        // The other half of the double cone is no face.
        let valid = |t: f64| t.is_finite() && t >= 0.0 && (q + r * t) * self.radius_m > 0.0;
        let mut roots = [k / square, rest / k];
        roots.sort_by(f64::total_cmp);
        roots.into_iter().find(|t| valid(*t))
    }

    /// The world point at face coordinates; inverse of [`Face::face_of`].
    pub fn world_of(&self, f: &FacePoint) -> Point3<f64> {
        let [c, s] = self.lean;
        let (x, z) = (c * f.n - s * f.u, c * f.u + s * f.n);
        if self.is_plane() {
            return Point3::new(x, f.a, z);
        }
        let (from_axis, angle) = (self.radius_m - x, f.a / self.radius_m);
        Point3::new(
            self.radius_m - from_axis * angle.cos(),
            from_axis * angle.sin(),
            z,
        )
    }

    /// Where a ray that starts in front of the face meets it within `limit_m`; `along` is a unit vector.
    pub fn meet(&self, from: &Point3<f64>, along: &Vector3<f64>, limit_m: f64) -> Option<FacePoint> {
        let n = |t: f64| self.face_of(&(from + along * t)).n;
        let (mut before, mut behind) = (0.0, 1.0);
        while n(behind) > 0.0 {
            before = behind;
            behind += 1.0;
            if behind > limit_m {
                return None;
            }
        }
        for _ in 0..50 {
            let middle = 0.5 * (before + behind);
            if n(middle) > 0.0 {
                before = middle;
            } else {
                behind = middle;
            }
        }
        Some(self.face_of(&(from + along * before)))
    }

    /// Axes (along, up, out) of the face at `a`.
    pub fn frame(&self, a: f64) -> FaceFrame {
        let angle = if self.is_plane() { 0.0 } else { a / self.radius_m };
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -angle);
        let [c, s] = self.lean;
        FaceFrame {
            along: turn * Vector3::y(),
            up: turn * Vector3::new(-s, 0.0, c),
            out: turn * Vector3::new(c, 0.0, s),
        }
    }

    /// Pose of a flat patch that touches the face at (a, u): its x, y, z are along, up, out.
    pub fn world_from_patch(&self, a: f64, u: f64) -> Rigid3 {
        let frame = self.frame(a);
        let axes =
            Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[frame.along, frame.up, frame.out]));
        let at = self.world_of(&FacePoint { a, u, n: 0.0 });
        Rigid3::from_parts(
            Translation3::from(at.coords),
            UnitQuaternion::from_rotation_matrix(&axes),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn face_coordinates_round_trip_and_follow_the_frame() {
        for radius in [0.0, 120.0, -80.0] {
            let face = Face::new(0.2, radius);
            for (a, u, n) in [(0.0, 0.0, 0.0), (3.0, 2.0, 0.05), (-60.0, 20.0, -0.1)] {
                let there = FacePoint { a, u, n };
                let back = face.face_of(&face.world_of(&there));
                assert!((back.a - a).abs() < 1e-9 && (back.u - u).abs() < 1e-9 && (back.n - n).abs() < 1e-9);
                let patch = face.world_from_patch(a, u);
                let out = face.world_of(&FacePoint { a, u, n: 0.3 });
                assert!((patch * Point3::new(0.0, 0.0, 0.3) - out).norm() < 1e-9);
                let beside = face.world_of(&FacePoint {
                    a: a + 1e-4,
                    u: 0.0,
                    n: 0.0,
                });
                let here = face.world_of(&FacePoint { a, u: 0.0, n: 0.0 });
                assert!(((beside - here) / 1e-4 - face.frame(a).along).norm() < 1e-5);
                let from = face.world_of(&FacePoint {
                    a: a + 3.0,
                    u,
                    n: 9.0,
                });
                let target = face.world_of(&FacePoint { a, u, n: 0.0 });
                let met = face.meet(&from, &(target - from).normalize(), 50.0).unwrap();
                assert!((met.a - a).abs() < 1e-6 && (met.u - u).abs() < 1e-6);
                assert!(face.meet(&from, &face.frame(a).out, 50.0).is_none());
                assert!((face.face_and_out(&from).1 - face.frame(a + 3.0).out).norm() < 1e-12);
                for (height, along) in [
                    (0.0, target - from),
                    (0.4, target - from),
                    (1.5, Vector3::new(-0.9, 0.4, 0.0)),
                ] {
                    let along = along.normalize();
                    let t = face.come_down(&from, &along, height).unwrap();
                    let n = |t: f64| face.face_of(&(from + along * t)).n;
                    assert!((n(t) - height).abs() < 1e-9, "{radius} {height}: {}", n(t));
                    assert!((0..100).all(|k| n(t * f64::from(k) / 100.0) > height));
                }
                // Outwards a hollow face is met again on the other side of its circle.
                let beyond = face.come_down(&from, &face.frame(a + 3.0).out, 1.0);
                assert!(beyond.is_none_or(|t| t > 100.0), "{beyond:?}");
                assert_eq!(face.come_down(&from, &Vector3::z(), 9.5), Some(0.0));
                assert_eq!(face.come_down(&from, &-face.frame(a + 3.0).out, 9.0), Some(0.0));
            }
        }
    }
}
