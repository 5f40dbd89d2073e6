//! Digits that the adjustment's solver reaches on data with certified results.

use super::certificate::Figure;
use super::nist_data::{Columns, Dataset, datasets};
use stonewise_core::linalg::least_squares;

/// Digits of a double: more are not counted.
const DIGITS: f64 = 15.0;
/// Digits that must be reached on sets as they are given. Normal equations lose half of those that the set leaves.
const LEAST_AS_GIVEN: f64 = 5.0;
/// Digits that must be reached about the middle, in units of the spread, as the adjustment takes stones.
const LEAST_CENTRED: f64 = 10.0;

/// For every set the digits of the coefficients as given, and of the residuals where the columns are taken about
/// their middle.
pub(super) fn figures() -> Vec<Figure> {
    datasets()
        .iter()
        .flat_map(|set| [as_given(set), centred(set)])
        .collect()
}

/// Correct digits (log relative error, McCullough 1998).
fn digits(value: f64, certified: f64) -> f64 {
    let error = match certified {
        0.0 => value.abs(),
        certified => ((value - certified) / certified).abs(),
    };
    (-error.log10()).clamp(0.0, DIGITS)
}

fn as_given(set: &Dataset) -> Figure {
    let found = least_squares(&rows(set, &set.columns), &set.y);
    let name = format!("{}, as given: digits of the coefficients", set.name);
    match found {
        Some(found) => {
            let all = found.iter().zip(&set.coefficients).map(|(x, c)| digits(*x, *c));
            Figure::at_least("solver", name, all.fold(DIGITS, f64::min), LEAST_AS_GIVEN)
        }
        None => Figure::said(
            "solver",
            name,
            "refused: not positive definite in double precision; no wrong result is given",
        ),
    }
}

fn centred(set: &Dataset) -> Figure {
    let columns = match &set.columns {
        Columns::Several(rows) => {
            let mut rows = rows.clone();
            for k in 0..6 {
                let column: Vec<f64> = rows.iter().map(|row| row[k]).collect();
                rows.iter_mut()
                    .zip(standard(&column))
                    .for_each(|(row, x)| row[k] = x);
            }
            Columns::Several(rows)
        }
        Columns::Powers(x) => Columns::Powers(standard(x)),
    };
    let rows = rows(set, &columns);
    let name = format!("{}, about the middle: digits of the residuals", set.name);
    let Some(found) = least_squares(&rows, &set.y) else {
        return Figure::at_least("solver", name, 0.0, LEAST_CENTRED);
    };
    let fitted = rows
        .iter()
        .map(|row| row.iter().zip(&found).map(|(a, x)| a * x).sum::<f64>());
    let square: f64 = set.y.iter().zip(fitted).map(|(y, fit)| (y - fit).powi(2)).sum();
    let sd = (square / (rows.len() - found.len()) as f64).sqrt();
    // Without residuals, what is left is compared with the observations.
    let reached = match set.residual_sd {
        0.0 => digits(sd / set.y.iter().fold(0.0, |most: f64, y| most.max(y.abs())), 0.0),
        certified => digits(sd, certified),
    };
    Figure::at_least("solver", name, reached, LEAST_CENTRED)
}

/// Rows of the design matrix, the constant first.
fn rows(set: &Dataset, columns: &Columns) -> Vec<Vec<f64>> {
    match columns {
        Columns::Several(rows) => rows
            .iter()
            .map(|row| std::iter::once(1.0).chain(row.iter().copied()).collect())
            .collect(),
        Columns::Powers(x) => x
            .iter()
            .map(|x| (0..set.coefficients.len() as i32).map(|k| x.powi(k)).collect())
            .collect(),
    }
}

/// About the mean, in units of the largest distance from it.
fn standard(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let most = values.iter().fold(0.0, |most: f64, x| most.max((x - mean).abs()));
    values.iter().map(|x| (x - mean) / most).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_data_are_those_of_nist() {
        let sets = datasets();
        let of = |name: &str| sets.iter().find(|s| s.name == name).unwrap();
        // First and last observations as NIST prints them.
        let ends = |name: &str| (of(name).y[1], of(name).y[20]);
        assert_eq!(ends("Wampler 1"), (6.0, 3_368_421.0));
        assert_eq!(ends("Wampler 3"), (-2042.0, 3_369_180.0));
        assert_eq!(ends("Wampler 5"), (-20_479_994.0, 10_958_421.0));
        assert!((of("Wampler 2").y[1] - 1.11111).abs() < 1e-12);
        assert_eq!((of("Longley").y.len(), of("Filip").y.len()), (16, 82));
    }

    #[test]
    fn wrong_data_or_a_wrong_solver_are_seen() {
        let figures = figures();
        assert!(figures.iter().all(|f| f.holds), "{figures:#?}");
        let mut set = datasets().remove(0);
        set.y[3] += 1.0;
        assert!(!as_given(&set).holds && !centred(&set).holds);
        assert_eq!(digits(3.0001, 3.0).round(), 4.0);
    }
}
