//! The motions of finished results with chosen stones as the datum.
//!
//! An S-transformation (Baarda 1973; Teunissen 1985). Let d be the motions, H t the motions that a rigid motion of six
//! parameters t causes, and F the chosen stones. Least squares, weighted by the covariances C of single stones,
//! estimate t from the motions of F; d - H t takes the place of d. The registration error that all stones share
//! cancels. All other errors of the stones count as independent, so that the covariance of a stone in F becomes
//! C - H Q H' and that of any other C + H Q H', with Q the covariance of t.

use super::ResultSet;
use super::budget::Term;
use super::columns::column;
use super::stone_row::{Reference, RowMotion, StoneRow};
use nalgebra::Matrix3;
use std::collections::BTreeSet;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_core::geometry::{DisplacementSample, SmallMotion};
use stonewise_io::table::{Table, TableError};

/// Columns of the table, as in the stone table.
const COLUMNS: [&str; 22] = [
    "stone_id",
    "x",
    "y",
    "z",
    "status",
    "dx",
    "dy",
    "dz",
    "d_along",
    "d_up",
    "d_out",
    "cov_xx",
    "cov_xy",
    "cov_xz",
    "cov_yy",
    "cov_yz",
    "cov_zz",
    "lod95",
    "significant",
    "sd_along",
    "sd_up",
    "sd_out",
];
/// Fewest stones that determine six parameters.
const LEAST_STONES: usize = 3;

/// The motions of all later epochs with these stones as the datum: the epoch's name, then columns of the stone table.
/// `fixed`: numbers of stones with commas between them, or the name of a zone of `[thresholds]`.
///
/// # Errors
/// There are no results, a stone or zone is not in them, or fewer than three of the stones were measured in an epoch.
pub fn fixed_datum(dir: &Path, fixed: &str) -> Result<Table, Error> {
    let first = ResultSet::read_motions(dir, 1)?;
    let wrong = |message: String| Error::Parameters(format!("--fixed {fixed}: {message}"));
    let stones = chosen(&first, fixed).map_err(wrong)?;
    let (mut epochs, mut rows) = (Vec::new(), Vec::new());
    for pair in 1..=first.pairs {
        let results = ResultSet::read_motions(dir, pair)?;
        let epoch = results.run.as_ref().and_then(|run| run.epochs.get(pair));
        let name = epoch.map_or_else(|| (pair + 1).to_string(), |e| e.name.clone());
        let moved =
            with_fixed(&results, &stones).map_err(|message| wrong(format!("epoch {name}: {message}")))?;
        epochs.extend(vec![name; moved.len()]);
        rows.extend(moved);
    }
    Ok(table(epochs, &rows)?)
}

/// The rows of a pair with the rigid motion of the fixed stones taken off.
fn with_fixed(results: &ResultSet, fixed: &BTreeSet<u32>) -> Result<Vec<StoneRow>, String> {
    let own = |row: &StoneRow, motion: &RowMotion| {
        let shared = results.datum().and_then(|d| d.covariance_at(&row.centroid));
        motion.covariance - shared.unwrap_or_else(Matrix3::zeros)
    };
    let measured = results
        .measured()
        .into_iter()
        .filter(|(row, _)| fixed.contains(&row.stone_id));
    let samples: Vec<DisplacementSample> = measured
        .map(|(row, motion)| DisplacementSample {
            place: row.centroid,
            displacement: motion.displacement,
            covariance: own(row, motion),
        })
        .collect();
    let rigid = SmallMotion::fit(&samples).filter(|_| samples.len() >= LEAST_STONES);
    let rigid = rigid.ok_or_else(|| {
        format!(
            "measured of the {1} fixed stones: {0}, and at least {LEAST_STONES} are needed: name more stones",
            samples.len(),
            fixed.len()
        )
    })?;
    let transformed = |row: &StoneRow| {
        let of_rigid = rigid.covariance_at(&row.centroid);
        let is_fixed = fixed.contains(&row.stone_id);
        let reference = Reference {
            error: rigid.at(&row.centroid),
            turn: rigid.rotation(),
            terms: vec![(Term::CommonMotion, if is_fixed { -of_rigid } else { of_rigid })],
            ..Reference::default()
        };
        let motion = row.motion.as_ref().map(|motion| {
            let bare = RowMotion {
                covariance: own(row, motion),
                ..motion.clone()
            };
            bare.against(&results.normal(row), &reference)
        });
        StoneRow {
            motion,
            ..row.clone()
        }
    };
    Ok(results.stones.iter().map(transformed).collect())
}

/// The stones that are named.
fn chosen(results: &ResultSet, fixed: &str) -> Result<BTreeSet<u32>, String> {
    let numbers: Result<BTreeSet<u32>, _> = fixed.split(',').map(|part| part.trim().parse()).collect();
    let stones = results.stones.iter();
    if let Ok(numbers) = numbers {
        let known: BTreeSet<u32> = stones.map(|s| s.stone_id).collect();
        return match numbers.iter().find(|n| !known.contains(n)) {
            Some(missing) => Err(format!(
                "the results have no stone {missing}: take numbers from stones.csv"
            )),
            None => Ok(numbers),
        };
    }
    let thresholds = results.run.as_ref().map(|run| &run.parameters.thresholds);
    let zones = thresholds.map_or(&[][..], |t| t.zones());
    let Some(zone) = zones.iter().find(|zone| zone.name == fixed.trim()) else {
        let names: Vec<&str> = zones.iter().map(|zone| zone.name.as_str()).collect();
        return Err(format!(
            "there is no such zone in [[thresholds.zones]] of the project ({}): give one of them, or numbers of stones as 12,13,14",
            if names.is_empty() {
                "none".to_owned()
            } else {
                names.join(", ")
            }
        ));
    };
    let inside = stones.filter(|s| zone.contains(&[s.along_m, s.up_m].into()));
    Ok(inside.map(|s| s.stone_id).collect())
}

fn table(epochs: Vec<String>, rows: &[StoneRow]) -> Result<Table, TableError> {
    let mut table = Table::new();
    table.push("epoch", "", "later epoch", epochs)?;
    for column in COLUMNS.iter().filter_map(|name| column(name)) {
        table.push(column.name, column.unit, column.meaning, column.of(rows))?;
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::records::{Datum, DatumState, RegistrationRecord};
    use crate::testing::{folder, registration_record, rows};
    use nalgebra::{DMatrix, DVector, Matrix6, Vector3, Vector6};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use stonewise_core::geometry::lever;

    const FIXED: [u32; 5] = [1, 2, 5, 8, 11];

    /// Covariance of the registration error: 4 mm per axis, 1 mrad.
    fn shared() -> Matrix6<f64> {
        Matrix6::from_diagonal(&Vector6::new(16e-6, 16e-6, 16e-6, 1e-6, 1e-6, 1e-6))
    }

    /// Results with a known datum, whose stones have errors of their own of different size.
    fn results() -> ResultSet {
        let mut results = ResultSet::read_measured(folder(&rows()).path(), 1).unwrap();
        let centre = results.stones[0].centroid;
        let datum = Datum::known(DatumState::Stated, &centre, &shared(), String::new());
        for (i, stone) in results.stones.iter_mut().enumerate() {
            let root =
                Matrix3::new(1.0, 0.3, 0.0, 0.0, 0.6, 0.2, 0.1, 0.0, 0.9) * 1e-3 * (1.0 + i as f64 / 9.0);
            if let Some(motion) = &mut stone.motion {
                motion.covariance = root * root.transpose() + datum.covariance_at(&stone.centroid).unwrap();
            }
        }
        results.registration = Some(RegistrationRecord {
            datum,
            ..registration_record()
        });
        results
    }

    fn transformed(results: &ResultSet) -> Vec<StoneRow> {
        let fixed: BTreeSet<u32> = FIXED.into();
        assert!(
            results
                .measured()
                .iter()
                .filter(|(s, _)| fixed.contains(&s.stone_id))
                .count()
                >= 4
        );
        with_fixed(results, &fixed).unwrap()
    }

    fn displacements(rows: &[StoneRow]) -> Vec<Vector3<f64>> {
        rows.iter()
            .filter_map(|r| Some(r.motion.as_ref()?.displacement))
            .collect()
    }

    /// The same results after a rigid motion of the whole later epoch.
    fn moved(results: &ResultSet, motion: &Vector6<f64>) -> ResultSet {
        let mut results = results.clone();
        for stone in &mut results.stones {
            let rigid = lever(&(stone.centroid - nalgebra::Point3::new(3.0, -2.0, 1.0))) * motion;
            stone.motion.iter_mut().for_each(|m| m.displacement += rigid);
        }
        results
    }

    #[test]
    fn a_rigid_motion_of_the_epoch_changes_nothing() {
        let results = results();
        let before = transformed(&results);
        let after = transformed(&moved(
            &results,
            &Vector6::new(0.05, -0.03, 0.02, 1e-3, -2e-3, 3e-3),
        ));
        for (a, b) in displacements(&before).iter().zip(displacements(&after)) {
            assert!((a - b).norm() < 1e-9, "{a} {b}");
        }
    }

    #[test]
    fn the_fixed_stones_rest_and_the_same_again_changes_nothing() {
        let results = results();
        let once = transformed(&results);
        // Weighted with their own covariances, as in the normal equations of the shift.
        let (mut sum, mut weights) = (Vector3::zeros(), Matrix3::zeros());
        for (row, before) in once
            .iter()
            .zip(&results.stones)
            .filter(|(r, _)| FIXED.contains(&r.stone_id))
        {
            let (Some(after), Some(before)) = (&row.motion, &before.motion) else {
                continue;
            };
            let datum = results.datum().unwrap().covariance_at(&row.centroid).unwrap();
            let weight = (before.covariance - datum).try_inverse().unwrap();
            sum += weight * after.displacement;
            weights += weight;
        }
        let mean = weights.try_inverse().unwrap() * sum;
        assert!(mean.norm() < 1e-9, "{mean}");

        let mut again = results.clone();
        for (stone, once) in again.stones.iter_mut().zip(&once) {
            if let (Some(motion), Some(once)) = (&mut stone.motion, &once.motion) {
                motion.displacement = once.displacement;
            }
        }
        for (a, b) in displacements(&once)
            .iter()
            .zip(displacements(&transformed(&again)))
        {
            assert!((a - b).norm() < 1e-9, "{a} {b}");
        }
    }

    /// Draws of all errors, transformed by least squares with one dense matrix.
    #[test]
    fn covariances_are_those_of_many_draws() {
        const DRAWS: usize = 20_000;
        let results = results();
        let datum = results.datum().unwrap().clone();
        let centre = nalgebra::Point3::from(datum.centre);
        let measured = results.measured();
        let roots: Vec<Matrix3<f64>> = measured
            .iter()
            .map(|(s, m)| {
                (m.covariance - datum.covariance_at(&s.centroid).unwrap())
                    .cholesky()
                    .unwrap()
                    .l()
            })
            .collect();
        let levers: Vec<_> = measured
            .iter()
            .map(|(s, _)| lever(&(s.centroid - centre)))
            .collect();
        let places: Vec<usize> = (0..measured.len())
            .filter(|i| FIXED.contains(&measured[*i].0.stone_id))
            .collect();
        let n = 3 * places.len();
        let (mut a, mut w) = (DMatrix::zeros(n, 6), DMatrix::zeros(n, n));
        for (k, i) in places.iter().enumerate() {
            a.view_mut((3 * k, 0), (3, 6)).copy_from(&levers[*i]);
            let weight = (roots[*i] * roots[*i].transpose()).try_inverse().unwrap();
            w.view_mut((3 * k, 3 * k), (3, 3)).copy_from(&weight);
        }
        let solve = (a.transpose() * &w * &a).try_inverse().unwrap() * a.transpose() * &w;
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let mut draw = || stonewise_testing::normal(&mut rng);
        let root = shared().cholesky().unwrap().l();
        let mut sums = vec![Matrix3::zeros(); measured.len()];
        for _ in 0..DRAWS {
            let common = root * Vector6::from_fn(|_, _| draw());
            let errors: Vec<Vector3<f64>> = roots
                .iter()
                .zip(&levers)
                .map(|(root, lever)| root * Vector3::from_fn(|_, _| draw()) + lever * common)
                .collect();
            let chosen = DVector::from_iterator(n, places.iter().flat_map(|i| errors[*i].iter().copied()));
            let rigid = &solve * chosen;
            for ((sum, error), lever) in sums.iter_mut().zip(&errors).zip(&levers) {
                let left = error - lever * Vector6::from_column_slice(rigid.as_slice());
                *sum += left * left.transpose() / DRAWS as f64;
            }
        }
        let rows = transformed(&results);
        for (row, drawn) in rows.iter().filter(|r| r.motion.is_some()).zip(&sums) {
            let stated = row.motion.as_ref().unwrap().covariance;
            // Five standard deviations of a variance from so many draws.
            let apart = (stated - drawn).norm() / drawn.norm();
            assert!(
                apart < 5.0 * (2.0 / DRAWS as f64).sqrt(),
                "{}: {apart}",
                row.stone_id
            );
        }
    }

    #[test]
    fn stones_are_named_by_number_or_zone() {
        let folder = folder(&rows());
        let of = |fixed: &str| fixed_datum(folder.path(), fixed);
        let table = of("1, 2,5,8, 11").unwrap();
        assert_eq!(table.rows(), rows().len());
        let names: Vec<&str> = table.names().collect();
        assert_eq!(names[..2], ["epoch", "stone_id"]);
        assert_eq!(names.len(), COLUMNS.len() + 1);
        for (fixed, words) in [
            ("1,2,999", "--fixed 1,2,999: the results have no stone 999"),
            ("crest", "--fixed crest: there is no such zone"),
            (
                "1",
                "measured of the 1 fixed stones: 1, and at least 3 are needed",
            ),
        ] {
            let message = of(fixed).unwrap_err().to_string();
            assert!(message.contains(words), "{message}");
        }
    }
}
