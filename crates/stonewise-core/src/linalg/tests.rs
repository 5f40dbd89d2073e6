//! The block factor against results that NIST certifies: Statistical Reference Datasets for linear least squares,
//! <https://www.itl.nist.gov/div898/strd/lls/lls.shtml>, public domain.
//!
//! Normal equations have the square of the condition number (Björck 1996), so that half of the digits are lost that
//! an orthogonal factor would keep. The adjustment takes every stone about its own centroid, where that leaves enough.

use super::BlockPattern;
use nalgebra::{Matrix1, Vector1};

/// Employed people and six quantities that they depend on (Longley 1967).
#[rustfmt::skip]
const LONGLEY: [[f64; 7]; 16] = [
    [60323.0, 83.0, 234289.0, 2356.0, 1590.0, 107608.0, 1947.0],
    [61122.0, 88.5, 259426.0, 2325.0, 1456.0, 108632.0, 1948.0],
    [60171.0, 88.2, 258054.0, 3682.0, 1616.0, 109773.0, 1949.0],
    [61187.0, 89.5, 284599.0, 3351.0, 1650.0, 110929.0, 1950.0],
    [63221.0, 96.2, 328975.0, 2099.0, 3099.0, 112075.0, 1951.0],
    [63639.0, 98.1, 346999.0, 1932.0, 3594.0, 113270.0, 1952.0],
    [64989.0, 99.0, 365385.0, 1870.0, 3547.0, 115094.0, 1953.0],
    [63761.0, 100.0, 363112.0, 3578.0, 3350.0, 116219.0, 1954.0],
    [66019.0, 101.2, 397469.0, 2904.0, 3048.0, 117388.0, 1955.0],
    [67857.0, 104.6, 419180.0, 2822.0, 2857.0, 118734.0, 1956.0],
    [68169.0, 108.4, 442769.0, 2936.0, 2798.0, 120445.0, 1957.0],
    [66513.0, 110.8, 444546.0, 4681.0, 2637.0, 121950.0, 1958.0],
    [68655.0, 112.6, 482704.0, 3813.0, 2552.0, 123366.0, 1959.0],
    [69564.0, 114.2, 502601.0, 3931.0, 2514.0, 125368.0, 1960.0],
    [69331.0, 115.7, 518173.0, 4806.0, 2572.0, 127852.0, 1961.0],
    [70551.0, 116.9, 554894.0, 4007.0, 2827.0, 130081.0, 1962.0],
];
/// Certified coefficients, the constant first, and certified standard deviation of the residuals.
#[rustfmt::skip]
const COEFFICIENTS: [f64; 7] = [
    -3482258.63459582, 15.0618722713733, -0.0358191792925910, -2.02022980381683, -1.03322686717359, -0.0511041056535807,
    1829.15146461355,
];
const LONGLEY_SD: f64 = 304.854073561965;

/// What Wampler's fifth set (1970) adds 10,000 times to 1 + x + ... + x^5 at 0, 1, ... 20.
#[rustfmt::skip]
const WAMPLER: [f64; 21] = [
    759.0, -2048.0, 2048.0, -2048.0, 2523.0, -2048.0, 2048.0, -2048.0, 1838.0, -2048.0, 2048.0, -2048.0,
    1838.0, -2048.0, 2048.0, -2048.0, 2523.0, -2048.0, 2048.0, -2048.0, 759.0,
];
const WAMPLER_SD: f64 = 23601450.2379268;

/// The x that makes |A x - b| least, of normal equations; each row is one of A. `None` where they are not positive
/// definite in double precision.
fn least_squares(rows: &[Vec<f64>], observed: &[f64]) -> Option<Vec<f64>> {
    let unknowns = rows[0].len();
    let edges: Vec<(usize, usize)> = (0..unknowns)
        .flat_map(|low| (low + 1..unknowns).map(move |high| (low, high)))
        .collect();
    let pattern = BlockPattern::<1>::new(unknowns, &edges)?;
    let mut matrix = pattern.zeros();
    let mut rhs = vec![Vector1::zeros(); unknowns];
    for (row, &value) in rows.iter().zip(observed) {
        for (i, &a) in row.iter().enumerate() {
            matrix.diagonal[i] += Matrix1::new(a * a);
            rhs[i] += Vector1::new(a * value);
        }
        for (block, &(low, high)) in matrix.edges.iter_mut().zip(&edges) {
            *block += Matrix1::new(row[low] * row[high]);
        }
    }
    let solution = pattern.factor(&matrix)?.solve(&rhs);
    Some(solution.iter().map(|x| x[0]).collect())
}

/// Standard deviation of the residuals.
fn residual_sd(rows: &[Vec<f64>], observed: &[f64]) -> f64 {
    let found = least_squares(rows, observed).unwrap();
    let fitted = |row: &Vec<f64>| row.iter().zip(&found).map(|(a, x)| a * x).sum::<f64>();
    let square: f64 = rows
        .iter()
        .zip(observed)
        .map(|(row, y)| (y - fitted(row)).powi(2))
        .sum();
    (square / (rows.len() - found.len()) as f64).sqrt()
}

/// Correct digits (log relative error, McCullough 1998).
fn digits(value: f64, certified: f64) -> f64 {
    -((value - certified) / certified).abs().log10()
}

/// About the mean, in units of the largest distance from it, as the adjustment takes stones.
fn centred(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let most = values.iter().fold(0.0, |most: f64, x| most.max((x - mean).abs()));
    values.iter().map(|x| (x - mean) / most).collect()
}

#[test]
fn longleys_data_give_the_certified_results() {
    let y = LONGLEY.map(|row| row[0]);
    let as_given = LONGLEY.map(|row| [&[1.0], &row[1..]].concat());
    for (found, certified) in least_squares(&as_given, &y).unwrap().iter().zip(COEFFICIENTS) {
        assert!(digits(*found, certified) > 5.0, "{found} for {certified}");
    }
    let mut about_the_middle = as_given.clone();
    for k in 1..7 {
        let column = centred(&as_given.each_ref().map(|row| row[k]));
        for (row, x) in about_the_middle.iter_mut().zip(column) {
            row[k] = x;
        }
    }
    assert!(digits(residual_sd(&about_the_middle, &y), LONGLEY_SD) > 10.0);
    let mut wrong = y;
    wrong[3] += 1.0;
    assert!(digits(residual_sd(&about_the_middle, &wrong), LONGLEY_SD) < 5.0);
}

#[test]
fn wamplers_polynomial_gives_the_certified_results() {
    let x: Vec<f64> = (0..21).map(f64::from).collect();
    let powers = |x: &f64| (0..6).map(|k| x.powi(k)).collect::<Vec<f64>>();
    let as_given: Vec<Vec<f64>> = x.iter().map(powers).collect();
    let y: Vec<f64> = { as_given.iter().zip(WAMPLER) }
        .map(|(row, rest)| row.iter().sum::<f64>() + 10_000.0 * rest)
        .collect();
    // The second and the last observation as NIST prints them.
    assert_eq!((y[1], y[20]), (-20_479_994.0, 10_958_421.0));
    for found in least_squares(&as_given, &y).unwrap() {
        assert!(digits(found, 1.0) > 5.0, "{found}");
    }
    let about_the_middle: Vec<Vec<f64>> = centred(&x).iter().map(powers).collect();
    assert!(digits(residual_sd(&about_the_middle, &y), WAMPLER_SD) > 10.0);
}

#[test]
fn a_singular_system_has_no_solution() {
    assert_eq!(least_squares(&vec![vec![1.0, 0.0]; 3], &[1.0, 2.0, 2.0]), None);
}
