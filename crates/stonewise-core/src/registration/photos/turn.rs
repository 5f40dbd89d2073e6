//! How a photo shows the rotation of a stone.

use nalgebra::RowVector3;

/// Turn of the picture of a face, from the axis along to the axis up, per rotation of the face about each of
/// its axes (along, up, out).
///
/// A rotation vector w moves the place (u, v) of the face by w x (u, v, 0), and what rises out of the face is
/// shifted in the picture by the parallax q: the gradient of the shift is [[-q_x w_y, -w_z + q_x w_x],
/// [w_z - q_y w_y, q_y w_x]], whose antisymmetric part is w_z - (q_x w_x + q_y w_y) / 2.
pub(crate) fn turn_by_rotation(parallax: [f64; 2]) -> RowVector3<f64> {
    RowVector3::new(-0.5 * parallax[0], -0.5 * parallax[1], 1.0)
}

#[cfg(test)]
mod tests {
    use super::super::matching::Warp;
    use super::*;
    use nalgebra::{Matrix2, Rotation3, Vector2, Vector3};

    #[test]
    fn the_turn_of_the_picture_agrees_with_rays_through_the_turned_face() {
        // The camera stands obliquely before the face; a ray meets the plane of the face that did not turn.
        let camera = Vector3::new(3.0, -2.0, 6.0);
        let rotation = Vector3::new(2e-4, -3e-4, 1.5e-4);
        let seen = |u: f64, v: f64| {
            let at = Rotation3::from_scaled_axis(rotation) * Vector3::new(u, v, 0.0);
            let ray = at - camera;
            (camera - ray * (camera.z / ray.z)).xy()
        };
        let step = 1e-3;
        let along: Vector2<f64> = (seen(step, 0.0) - seen(-step, 0.0)) / (2.0 * step);
        let up: Vector2<f64> = (seen(0.0, step) - seen(0.0, -step)) / (2.0 * step);
        let picture = Warp {
            shift: Vector2::zeros(),
            matrix: Matrix2::from_columns(&[along, up]),
        };
        let ray = -camera;
        let parallax = [-ray.x / ray.z, -ray.y / ray.z];
        let found = (turn_by_rotation(parallax) * rotation).x;
        assert!(
            (found - picture.turn()).abs() < 1e-6,
            "{found} {}",
            picture.turn()
        );
    }
}
