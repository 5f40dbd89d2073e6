//! Other instruments beside the stones: whether both show the same motion, and what instruments say of the datum.
//!
//! At an instrument, the motion of the stones around it less that of the instrument is
//!
//! ```text
//! d_i = J_i r + e_i,   cov(e_i, e_j) = C_ij,   cov(r) = D
//! ```
//!
//! with r the registration error of the later epoch, a rigid motion that all stones share, and C_ij the covariance of
//! what is left of the stones' motion and of the reading; points of one network have readings that correlate. d_i
//! against J_i D J_i' + C_ii is the test of agreement; the conditional mean and covariance of r, given all d_i, are
//! generalised least squares.

use crate::geometry::lever;
use crate::statistics::{NONCENTRALITY, chi_square_p};
use nalgebra::{DMatrix, DVector, Matrix6, Point3, SMatrix, Vector3, Vector6};

/// Standard deviation of a registration of which nothing is known: of a shift, and of a rotation at a typical
/// arm, metres.
const UNKNOWN_M: f64 = 1.0;
/// A motion that is known to this standard deviation, metres, is determined where it was not known before.
const DETERMINED_M: f64 = 0.01;

/// The motion of stones less that of an instrument among them, world.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Where the instrument is.
    pub place: Point3<f64>,
    /// Metres, along the axes that it measures.
    pub value: [Option<f64>; 3],
}

/// A registration error: shift at the centre and rotation vector.
#[derive(Clone, Debug, PartialEq)]
pub struct RegistrationError {
    /// Place that it refers to.
    pub centre: Point3<f64>,
    /// Its mean, m, rad.
    pub mean: Vector6<f64>,
    /// Its covariance, m^2, m rad, rad^2.
    pub covariance: Matrix6<f64>,
}

/// What the test says of one instrument.
#[derive(Clone, Debug, PartialEq)]
pub struct Tested {
    /// The difference that is tested, metres: where nothing is known of the registration, against what the other
    /// instruments say of it.
    pub difference: [Option<f64>; 3],
    /// Its standard deviations.
    pub sd: [Option<f64>; 3],
    /// Probability of so large a difference by chance; `None` where neither the registration nor the other instruments
    /// say how it should be.
    pub p: Option<f64>,
    /// Sum of the redundancy numbers of its observations (Baarda 1968).
    pub redundancy: f64,
    /// Smallest offset that a test against all others finds, with a significance level of 0.1 % and a power of 80 %, in the
    /// direction in which it is found worst, metres; `None` where the others do not say how it should be.
    pub smallest_blunder_m: Option<f64>,
}

/// Whether instruments and stones agree.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// The test of each instrument.
    pub instruments: Vec<Tested>,
    /// Probability of so large differences of all of them together; `None` where nothing is left over to test.
    pub p: Option<f64>,
    /// The registration error that is left, as the instruments show it.
    pub error: RegistrationError,
    /// Whether that determines it: always where something was known of it before.
    pub is_determined: bool,
}

/// Compares instruments with stones. `errors`: the covariance of stones and instruments without the registration error, m^2, three
/// rows for each difference. `centre`: of the registration error; `known`: its covariance, or `None` where nothing is
/// known of it. `None` without differences, or where the numbers fail.
///
/// Cost: the cube of the number of differences.
pub fn agreement(
    differences: &[Difference],
    errors: &DMatrix<f64>,
    centre: &Point3<f64>,
    known: Option<&Matrix6<f64>>,
) -> Option<Agreement> {
    // Of each observation: instrument, axis and value.
    let observed: Vec<(usize, usize, f64)> = differences
        .iter()
        .enumerate()
        .flat_map(|(i, d)| (0..3).filter_map(move |axis| Some((i, axis, d.value[axis]?))))
        .collect();
    let count = observed.len();
    if count == 0 {
        return None;
    }
    let prior = known.copied().unwrap_or_else(|| unknown(differences, centre));
    let levers: Vec<SMatrix<f64, 3, 6>> = differences.iter().map(|d| lever(&(d.place - centre))).collect();
    let design = DMatrix::from_fn(count, 6, |row, c| levers[observed[row].0][(observed[row].1, c)]);
    let place = |row: usize| 3 * observed[row].0 + observed[row].1;
    let own = DMatrix::from_fn(count, count, |r, c| errors[(place(r), place(c))]);

    let values = DVector::from_fn(count, |row, _| observed[row].2);
    let by_error = &design * DMatrix::from_fn(6, 6, |r, c| prior[(r, c)]);
    let covariance = &by_error * design.transpose() + &own;
    let precision = covariance.clone().cholesky()?.inverse();
    let weighted = &precision * &values;
    let error = RegistrationError {
        centre: *centre,
        mean: to_vector(&(by_error.transpose() * &weighted)),
        covariance: symmetric(prior - to_matrix(&(by_error.transpose() * &precision * &by_error))),
    };
    let shown = match known {
        Some(_) => 0,
        None => shown(&prior, &error.covariance)?,
    };

    let square = values.dot(&weighted);
    let rows_of = |i: usize| -> Vec<usize> { (0..count).filter(|&row| observed[row].0 == i).collect() };
    let tested = |i: usize| {
        let rows = rows_of(i);
        let block = |m: &DMatrix<f64>| m.select_rows(&rows).select_columns(&rows);
        let part = |v: &DVector<f64>| v.select_rows(&rows);
        let from_others = block(&precision).cholesky().map(|c| c.inverse());
        let worst = from_others
            .as_ref()
            .filter(|_| !rows.is_empty())
            .map(|c| c.symmetric_eigenvalues().max());
        // Against the others: the inverse of a block of the precision is the covariance of the difference from what
        // they predict.
        let found = match known {
            Some(_) => Some((part(&values), block(&covariance))),
            None => from_others.map(|c| (&c * part(&weighted), c)),
        };
        let mut of = Tested {
            difference: [None; 3],
            sd: [None; 3],
            p: None,
            redundancy: block(&own).component_mul(&block(&precision)).sum(),
            smallest_blunder_m: worst
                .filter(|variance| *variance <= DETERMINED_M * DETERMINED_M)
                .map(|variance| NONCENTRALITY * variance.sqrt()),
        };
        let Some((difference, covariance)) = found else {
            return of;
        };
        if known.is_none() && covariance.diagonal().max() > DETERMINED_M * DETERMINED_M {
            return of;
        }
        for (k, &row) in rows.iter().enumerate() {
            of.difference[observed[row].1] = Some(difference[k]);
            of.sd[observed[row].1] = Some(covariance[(k, k)].sqrt());
        }
        let square = covariance
            .cholesky()
            .map(|c| difference.dot(&c.solve(&difference)));
        of.p = square
            .filter(|_| !rows.is_empty())
            .map(|square| chi_square_p(square, rows.len()));
        of
    };

    Some(Agreement {
        instruments: (0..differences.len()).map(tested).collect(),
        p: (count > shown).then(|| chi_square_p(square, count - shown)),
        error,
        is_determined: known.is_some() || shown == 6,
    })
}

/// The covariance of a registration of which nothing is known.
fn unknown(differences: &[Difference], centre: &Point3<f64>) -> Matrix6<f64> {
    let squares: f64 = differences
        .iter()
        .map(|d| (d.place - centre).norm_squared())
        .sum();
    let arm_m = (squares / differences.len().max(1) as f64).sqrt().max(1.0);
    let variance = UNKNOWN_M * UNKNOWN_M;
    let turn = variance / (arm_m * arm_m);
    Matrix6::from_diagonal(&[variance, variance, variance, turn, turn, turn].into())
}

/// How many of the six motions observations show of which nothing was known.
fn shown(prior: &Matrix6<f64>, posterior: &Matrix6<f64>) -> Option<usize> {
    let scale = prior.diagonal().map(|v| 1.0 / v.sqrt());
    let relative = Matrix6::from_fn(|r, c| posterior[(r, c)] * scale[r] * scale[c]);
    let least = (DETERMINED_M / UNKNOWN_M).powi(2);
    let eigen = relative.symmetric_eigenvalues();
    eigen
        .iter()
        .all(|v| v.is_finite())
        .then(|| eigen.iter().filter(|v| **v < least).count())
}

fn to_vector(v: &DVector<f64>) -> Vector6<f64> {
    Vector6::from_fn(|r, _| v[r])
}

fn to_matrix(m: &DMatrix<f64>) -> Matrix6<f64> {
    Matrix6::from_fn(|r, c| m[(r, c)])
}

fn symmetric(m: Matrix6<f64>) -> Matrix6<f64> {
    0.5 * (m + m.transpose())
}

impl RegistrationError {
    /// The error at a place, metres.
    pub fn at(&self, place: &Point3<f64>) -> Vector3<f64> {
        lever(&(place - self.centre)) * self.mean
    }

    /// Its rotation vector, radians.
    pub fn turn(&self) -> Vector3<f64> {
        self.mean.fixed_rows::<3>(3).into_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    struct Draw(ChaCha8Rng);

    impl Draw {
        fn new(seed: u64) -> Self {
            Self(ChaCha8Rng::seed_from_u64(seed))
        }

        fn uniform(&mut self) -> f64 {
            self.0.random_range(0.0..1.0)
        }

        fn normal(&mut self) -> f64 {
            let pair = [self.uniform(), self.uniform()];
            crate::statistics::normal_pair(pair)[0]
        }
    }

    const CENTRE: Point3<f64> = Point3::new(100.0, 50.0, 10.0);

    /// Targets on a wall of 12 x 6 m with errors of 0.3 mm, every third one of heights alone, and a registration error
    /// drawn from `prior`.
    fn drawn(draw: &mut Draw, count: usize, prior: &Matrix6<f64>) -> (Vec<Difference>, Vector6<f64>) {
        let root = prior.map(|v| v.sqrt());
        let error = Vector6::from_fn(|r, _| root[(r, r)] * draw.normal());
        let difference = |i: usize| {
            let place = CENTRE
                + Vector3::new(0.5, 12.0, 6.0).component_mul(&Vector3::from_fn(|_, _| draw.uniform() - 0.5));
            let at = lever(&(place - CENTRE)) * error;
            let value = [0, 1, 2].map(|axis| {
                let noisy = at[axis] + 3e-4 * draw.normal();
                (axis == 2 || !i.is_multiple_of(3)).then_some(noisy)
            });
            Difference { place, value }
        };
        ((0..count).map(difference).collect(), error)
    }

    fn prior() -> Matrix6<f64> {
        Matrix6::from_diagonal(&[1e-6, 4e-6, 1e-6, 1e-8, 1e-8, 4e-8].into())
    }

    /// The agreement of differences with independent errors of 0.3 mm.
    fn independent(differences: &[Difference], known: Option<&Matrix6<f64>>) -> Option<Agreement> {
        let size = 3 * differences.len();
        agreement(
            differences,
            &(DMatrix::identity(size, size) * 9e-8),
            &CENTRE,
            known,
        )
    }

    #[test]
    fn it_is_least_squares_with_the_prior_as_observations() {
        let (differences, _) = drawn(&mut Draw::new(3), 7, &prior());
        // Errors of all readings that correlate, as those of a network.
        let mut draw = Draw::new(4);
        let root = DMatrix::from_fn(21, 21, |_, _| 1e-4 * draw.normal());
        let errors = &root * root.transpose() + DMatrix::identity(21, 21) * 9e-8;
        let found = agreement(&differences, &errors, &CENTRE, Some(&prior())).unwrap();

        let measured: Vec<usize> = (0..21)
            .filter(|k| differences[k / 3].value[k % 3].is_some())
            .collect();
        let weight = errors.select_rows(&measured).select_columns(&measured);
        let weight = weight.try_inverse().unwrap();
        let design = DMatrix::from_fn(measured.len(), 6, |row, c| {
            let k = measured[row];
            lever(&(differences[k / 3].place - CENTRE))[(k % 3, c)]
        });
        let values = DVector::from_iterator(
            measured.len(),
            measured.iter().map(|k| differences[k / 3].value[k % 3].unwrap()),
        );
        let normal = to_matrix(&(design.transpose() * &weight * &design)) + prior().try_inverse().unwrap();
        let covariance = normal.try_inverse().unwrap();
        let mean = covariance * to_vector(&(design.transpose() * &weight * values));
        assert!((found.error.mean - mean).norm() < 1e-9 * mean.norm());
        assert!((found.error.covariance - covariance).norm() < 1e-9 * covariance.norm());
        assert!(found.is_determined);
    }

    #[test]
    fn influence_of_instruments_is_that_of_least_squares_without_them() {
        let (differences, _) = drawn(&mut Draw::new(3), 7, &prior());
        let found = independent(&differences, Some(&prior())).unwrap();
        for (i, (difference, tested)) in differences.iter().zip(&found.instruments).enumerate() {
            let others: Vec<Difference> = { differences.iter().enumerate() }
                .filter(|(other, _)| *other != i)
                .map(|(_, difference)| difference.clone())
                .collect();
            let without = independent(&others, Some(&prior())).unwrap();
            let axes: Vec<usize> = (0..3).filter(|&a| difference.value[a].is_some()).collect();
            let by = lever(&(difference.place - CENTRE));
            let own = |covariance: &Matrix6<f64>| {
                let all = by * covariance * by.transpose();
                DMatrix::from_fn(axes.len(), axes.len(), |r, c| all[(axes[r], axes[c])])
            };
            let redundancy = axes.len() as f64 - own(&found.error.covariance).trace() / 9e-8;
            assert!((tested.redundancy - redundancy).abs() < 1e-9, "{redundancy}");
            let of_offset = own(&without.error.covariance) + DMatrix::identity(axes.len(), axes.len()) * 9e-8;
            let blunder_m = 4.13 * of_offset.symmetric_eigenvalues().max().sqrt();
            assert!(
                (tested.smallest_blunder_m.unwrap() - blunder_m).abs() < 1e-9,
                "{blunder_m}"
            );
        }
    }

    /// Number of 400 draws whose p is below 5 %: 20 expected, with a standard deviation of 4.4. Where the others are nearly
    /// on one line and say nothing there is no p.
    fn rejected(known: bool, of: impl Fn(&Agreement) -> Option<f64>) -> usize {
        let mut draw = Draw::new(11);
        let below = |_: usize| {
            let (differences, _) = drawn(&mut draw, 6, &prior());
            let known = known.then(prior);
            of(&independent(&differences, known.as_ref()).unwrap()).is_some_and(|p| p < 0.05)
        };
        (0..400).map(below).filter(|below| *below).count()
    }

    #[test]
    fn agreement_is_denied_by_chance_as_often_as_stated() {
        for known in [true, false] {
            let all = rejected(known, |a| a.p);
            let one = rejected(known, |a| a.instruments[1].p);
            assert!(
                (7..=33).contains(&all) && (7..=33).contains(&one),
                "{known}: {all} {one}"
            );
        }
    }

    #[test]
    fn a_target_that_moved_by_itself_is_told_from_a_wrong_datum() {
        let mut draw = Draw::new(5);
        let (mut differences, _) = drawn(&mut draw, 8, &prior());
        let with = |differences: &[Difference]| independent(differences, None).unwrap();
        let before = with(&differences);
        // A rigid motion of any size changes nothing where the datum is not known.
        let rigid = Vector6::new(0.02, -0.01, 0.03, 1e-4, 2e-4, -1e-4);
        for difference in &mut differences {
            let at = lever(&(difference.place - CENTRE)) * rigid;
            (0..3).for_each(|a| difference.value[a] = difference.value[a].map(|v| v + at[a]));
        }
        let moved = with(&differences);
        assert!((moved.p.unwrap() - before.p.unwrap()).abs() < 1e-3);
        assert!((moved.error.mean - before.error.mean - rigid).norm() < 1e-3 * rigid.norm());
        differences[4].value[1] = differences[4].value[1].map(|v| v + 0.004);
        let one = with(&differences);
        assert!(one.p.unwrap() < 1e-4 && one.instruments[4].p.unwrap() < 1e-4);
        let least = (0..8).min_by(|a, b| one.instruments[*a].p.partial_cmp(&one.instruments[*b].p).unwrap());
        assert_eq!(least, Some(4));
    }

    #[test]
    fn heights_alone_do_not_determine_a_datum() {
        let (mut differences, _) = drawn(&mut Draw::new(9), 6, &prior());
        for difference in &mut differences {
            difference.value = [None, None, difference.value[2]];
        }
        let found = independent(&differences, None).unwrap();
        assert!(!found.is_determined && found.p.is_some());
        let alone = independent(&differences[..1], None).unwrap();
        assert_eq!((alone.p, alone.instruments[0].p), (None, None));
        assert!(independent(&[], None).is_none());
        // With a datum that is known, one height is enough for a test.
        let known = independent(&differences[..1], Some(&prior())).unwrap();
        assert!(known.p.is_some() && known.is_determined);
    }
}
