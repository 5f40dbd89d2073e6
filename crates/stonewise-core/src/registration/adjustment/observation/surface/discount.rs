//! Less weight for what a stone's slopes say than for what its heights say.
//!
//! A motion perpendicular to the face is seen by every point; a motion in it only where the face is steep, at rims and
//! edges, where points err more: mixed pixels, the beam's footprint, relief finer than the cells of the
//! surface. [`super::correlation`] measures by how much.

use crate::registration::adjustment::observation::normal_equations::NormalEquations;
use nalgebra::{Matrix3, Vector3};

/// Unknowns in the face: two translations and the rotation about the normal.
const INSIDE: [usize; 3] = [0, 1, 5];
/// The others.
const ACROSS: [usize; 3] = [2, 3, 4];
/// Relative ridge on every unknown: keeps those that no point determines solvable; far below any information
/// that counts, as blocks are scaled to a unit diagonal and double precision has 16 digits.
const RIDGE: f64 = 1e-12;
/// Information of an unknown of which no point says anything, so that its inverse stays finite.
const NOTHING: f64 = 1e-100;

/// The equations with the variances of the motion in the face times `factor`, at least 1, and those of the
/// translation in it larger by `error_m` squared; its optimum, and what is known of the other unknowns once
/// that motion is given, stay.
///
/// With A, B, D the blocks of the information (in the face, both, across), S = A - B D^-1 B' is what is known
/// of the motion in the face alone; the log likelihood is its quadratic form plus one that depends on the
/// others given it. S becomes (factor S^-1 + E)^-1, E the covariance of the error.
pub(crate) fn discounted(equations: NormalEquations, factor: f64, error_m: f64) -> NormalEquations {
    with_log_det(equations, factor, error_m).0
}

/// Equations discounted for an error alone, as a log likelihood in the error too: the constant holds the log
/// determinant by which the density of the optimum spreads.
pub(crate) fn with_error_likelihood(equations: NormalEquations, error_m: f64) -> NormalEquations {
    let (mut equations, log_det) = with_log_det(equations, 1.0, error_m);
    equations.constant -= 0.5 * log_det;
    equations
}

/// The equations with an error of the translation, `error_m` per axis, that all points of the stone share:
/// that of a sensor against the one that measured the stones around it. The optimum stays.
pub(crate) fn with_shift_error(mut equations: NormalEquations, error_m: f64) -> NormalEquations {
    let columns = equations.information.fixed_columns::<3>(0) * error_m;
    let of_error = equations.vector.fixed_rows::<3>(0) * error_m;
    let inner = Matrix3::identity() + columns.fixed_rows::<3>(0) * error_m;
    let Some(inverse) = inner.try_inverse() else {
        return equations;
    };
    equations.information -= columns * inverse * columns.transpose();
    equations.vector -= columns * inverse * of_error;
    equations.constant += 0.5 * of_error.dot(&(inverse * of_error));
    equations
}

/// The discounted equations, and the log determinant of the covariance with the error over that without.
fn with_log_det(mut equations: NormalEquations, factor: f64, error_m: f64) -> (NormalEquations, f64) {
    let a = Matrix3::from_fn(|r, c| equations.information[(INSIDE[r], INSIDE[c])]);
    let b = Matrix3::from_fn(|r, c| equations.information[(INSIDE[r], ACROSS[c])]);
    let d = Matrix3::from_fn(|r, c| equations.information[(ACROSS[r], ACROSS[c])]);
    let of_inside = Vector3::from_fn(|r, _| equations.vector[INSIDE[r]]);
    let of_across = Vector3::from_fn(|r, _| equations.vector[ACROSS[r]]);
    let Some(inverse) = inverted(d) else {
        return (equations, 0.0);
    };
    let known = a - b * inverse * b.transpose();
    let pull = of_inside - b * inverse * of_across;
    let Some(optimum) = inverted(known).map(|i| i * pull) else {
        return (equations, 0.0);
    };
    let scaled = known / factor.max(1.0);

    let error = Matrix3::from_diagonal(&Vector3::new(error_m, error_m, 0.0));
    // (S^-1 + E)^-1 = S - S e (I + e S e)^-1 e S with E = e e, which holds for a singular S too.
    let Some(inner) = (Matrix3::identity() + error * scaled * error).try_inverse() else {
        return (equations, 0.0);
    };
    let left = scaled - scaled * error * inner * error * scaled;
    let taken = known - 0.5 * (left + left.transpose());
    let pull_taken = taken * optimum;

    for r in 0..3 {
        equations.vector[INSIDE[r]] -= pull_taken[r];
        for c in 0..3 {
            equations.information[(INSIDE[r], INSIDE[c])] -= taken[(r, c)];
        }
    }

    equations.constant += 0.5 * pull_taken.dot(&optimum);
    (equations, -inner.determinant().ln())
}

/// Inverse of a positive semi-definite matrix whose rows have different units.
fn inverted<const N: usize>(matrix: nalgebra::SMatrix<f64, N, N>) -> Option<nalgebra::SMatrix<f64, N, N>>
where
    nalgebra::Const<N>: nalgebra::DimSub<nalgebra::U1>,
{
    let scale = nalgebra::SVector::<f64, N>::from_fn(|r, _| matrix[(r, r)].max(NOTHING).sqrt().recip());
    let scaled = nalgebra::SMatrix::<f64, N, N>::from_fn(|r, c| {
        matrix[(r, c)] * scale[r] * scale[c] + if r == c { RIDGE } else { 0.0 }
    });
    let inverse = scaled.cholesky()?.inverse();
    Some(nalgebra::SMatrix::from_fn(|r, c| {
        inverse[(r, c)] * scale[r] * scale[c]
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix6, Vector6};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_face_without_any_slope_says_nothing_of_a_motion_in_it() {
        // Ground in coordinates rounded to a centimetre: all heights are equal.
        let mut information = Matrix6::zeros();
        ACROSS.iter().for_each(|&k| information[(k, k)] = 1e6);
        let mut flat = NormalEquations::nothing();
        flat.information = information;
        let found = discounted(flat, 3.0, 1e-3);
        assert_eq!(found.information, information);
        assert!(
            found.constant == 0.0 && found.vector == Vector6::zeros(),
            "{found:?}"
        );
    }

    fn term(columns: usize) -> NormalEquations {
        let mut rng = ChaCha8Rng::seed_from_u64(9);
        let mut information = Matrix6::zeros();
        for _ in 0..columns {
            let row = Vector6::from_fn(|k, _| rng.random_range(-1.0..1.0) * if k < 3 { 1e3 } else { 50.0 });
            information += row * row.transpose();
        }
        let optimum = Vector6::from_fn(|_, _| rng.random_range(-1.0..1.0));
        NormalEquations {
            vector: information * optimum,
            information,
            constant: 3.0,
        }
    }

    #[test]
    fn variances_in_the_face_grow_and_the_rest_stays() {
        let (before, factor) = (term(30), 1.7);
        let after = discounted(before.clone(), factor, 0.0);
        let [c, d] = [&before, &after].map(|t| t.information.try_inverse().unwrap());
        for &i in &INSIDE {
            for &j in &INSIDE {
                assert!((d[(i, j)] / c[(i, j)] - factor).abs() < 1e-6);
            }
        }
        let optimum = c * before.vector;
        assert!((d * after.vector - optimum).norm() < 1e-6);
        let peak = |t: &NormalEquations| t.constant + 0.5 * optimum.dot(&t.vector);
        assert!((peak(&after) - peak(&before)).abs() < 1e-6 * peak(&before).abs());
        let given = |t: &NormalEquations| Matrix3::from_fn(|r, c| t.information[(ACROSS[r], ACROSS[c])]);
        assert_eq!(given(&after), given(&before));
    }

    #[test]
    fn an_error_in_the_face_adds_to_the_variances_of_the_translation_there() {
        let (before, error_m) = (term(30), 2e-4);
        let after = discounted(before.clone(), 1.0, error_m);
        let [c, d] = [&before, &after].map(|t| t.information.try_inverse().unwrap());
        for &i in &INSIDE {
            for &j in &INSIDE {
                let added = if i == j && i < 2 { error_m * error_m } else { 0.0 };
                assert!((d[(i, j)] - c[(i, j)] - added).abs() < 1e-6 * d[(i, i)].max(d[(j, j)]));
            }
        }
        assert!((d * after.vector - c * before.vector).norm() < 1e-6);
    }

    #[test]
    fn an_error_of_the_sensor_adds_to_the_variances_of_the_translation() {
        let (before, error_m) = (term(30), 2e-4);
        let after = with_shift_error(before.clone(), error_m);
        let [c, d] = [&before, &after].map(|t| t.information.try_inverse().unwrap());
        for (k, (d, c)) in d.diagonal().iter().zip(c.diagonal().iter()).enumerate() {
            let added = if k < 3 { error_m * error_m } else { 0.0 };
            assert!((d - c - added).abs() < 1e-6 * d, "{k}");
        }
        let optimum = c * before.vector;
        assert!((d * after.vector - optimum).norm() < 1e-6);
        let peak = |t: &NormalEquations| t.constant + 0.5 * optimum.dot(&t.vector);
        assert!((peak(&after) - peak(&before)).abs() < 1e-6 * peak(&before).abs());
    }

    #[test]
    fn what_no_point_determines_stays_undetermined() {
        let before = term(4);
        let after = discounted(before.clone(), 2.0, 1e-3);
        let eigen = before.information.symmetric_eigen();
        for k in 0..6 {
            let direction = eigen.eigenvectors.column(k);
            if eigen.eigenvalues[k] < 1e-6 {
                assert!((after.information * direction).norm() < 1e-3);
            }
        }
    }
}
