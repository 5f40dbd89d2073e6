//! Linear least squares by normal equations and the factor that the adjustment uses.

use super::BlockPattern;
use nalgebra::{Matrix1, Vector1};

/// The x that makes |A x - b| least; `None` where the normal equations are not positive definite in double
/// precision. `rows`: those of A, all of one length.
///
/// Normal equations have the square of A's condition number: half of the digits are lost that an orthogonal
/// factor of A would keep (Björck 1996). The adjustment takes every stone about its own centroid, where that
/// leaves enough; this function exists to show it on published data.
pub fn least_squares(rows: &[Vec<f64>], observed: &[f64]) -> Option<Vec<f64>> {
    let unknowns = rows.first()?.len();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_points_and_a_singular_system() {
        // Closed form: slope 0.5, intercept 1.1666...
        let rows: Vec<Vec<f64>> = [0.0, 1.0, 2.0].map(|x| vec![1.0, x]).into();
        let x = least_squares(&rows, &[1.0, 2.0, 2.0]).unwrap();
        assert!((x[0] - 7.0 / 6.0).abs() < 1e-14 && (x[1] - 0.5).abs() < 1e-14);
        let same = vec![vec![1.0, 0.0]; 3];
        assert_eq!(least_squares(&same, &[1.0, 2.0, 2.0]), None);
        assert_eq!(least_squares(&[], &[]), None);
    }
}
