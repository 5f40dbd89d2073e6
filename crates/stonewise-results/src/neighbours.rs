//! `neighbours.parquet`: covariances of the motions of neighbours relative to each other.

use super::evidence::read_table;
use super::names::PairFile;
use nalgebra::Matrix3;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_core::id::StoneId;
use stonewise_core::stone::NeighbourCovariance;
use stonewise_io::table::{Table, write_parquet};

/// Columns of the covariance, with row and column of the matrix.
const COVARIANCE: [(&str, [usize; 2]); 6] = [
    ("cov_xx", [0, 0]),
    ("cov_xy", [0, 1]),
    ("cov_xz", [0, 2]),
    ("cov_yy", [1, 1]),
    ("cov_yz", [1, 2]),
    ("cov_zz", [2, 2]),
];

/// Writes the file of a pair of epochs, one row for each pair of neighbours that were both measured, in the
/// order of their numbers.
///
/// # Errors
/// The file cannot be written.
pub fn write_neighbours(dir: &Path, pair: usize, neighbours: &[NeighbourCovariance]) -> Result<(), Error> {
    let mut neighbours = neighbours.to_vec();
    neighbours.sort_by_key(|pair| pair.stones);
    let mut table = Table::new();
    let columns = [("stone_1", "one of two neighbours"), ("stone_2", "the other")];
    for (k, (name, meaning)) in columns.into_iter().enumerate() {
        let ids: Vec<u32> = neighbours.iter().map(|pair| pair.stones[k].0).collect();
        table.push(name, "", meaning, ids)?;
    }
    for (name, [r, c]) in COVARIANCE {
        let values: Vec<f64> = neighbours.iter().map(|pair| pair.covariance[(r, c)]).collect();
        table.push(
            name,
            "m2",
            "covariance of the displacement of stone_2 less that of stone_1, world; errors that both \
             share cancel",
            values,
        )?;
    }
    Ok(write_parquet(
        &dir.join(PairFile::Neighbours.place(pair)),
        &table,
    )?)
}

/// Reads the file of a pair of epochs, in the order of the stones' numbers; empty if there is none.
///
/// # Errors
/// The file is damaged.
pub fn read_neighbours(dir: &Path, pair: usize) -> Result<Vec<NeighbourCovariance>, Error> {
    let path = dir.join(PairFile::Neighbours.place(pair));
    let Some(table) = read_table(&path)? else {
        return Ok(Vec::new());
    };
    let [first, second] = ["stone_1", "stone_2"].map(|name| table.required::<u32>(name));
    let (first, second) = (first?, second?);
    let values = COVARIANCE
        .iter()
        .map(|(name, _)| table.required::<f64>(name))
        .collect::<Result<Vec<_>, _>>()?;
    let covariance = |row: usize| {
        let mut matrix = Matrix3::zeros();
        for ((_, [r, c]), column) in COVARIANCE.iter().zip(&values) {
            (matrix[(*r, *c)], matrix[(*c, *r)]) = (column[row], column[row]);
        }
        matrix
    };
    let pair = |row: usize| NeighbourCovariance {
        stones: [first[row], second[row]].map(StoneId),
        covariance: covariance(row),
    };
    let mut neighbours: Vec<NeighbourCovariance> = (0..first.len()).map(pair).collect();
    neighbours.sort_by_key(|pair| pair.stones);
    Ok(neighbours)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covariances_come_back_as_written() {
        let folder = tempfile::tempdir().unwrap();
        let covariance = Matrix3::new(4.0, 1.0, 2.0, 1.0, 5.0, 3.0, 2.0, 3.0, 6.0) * 1e-6;
        let pair = |a: u32, b: u32, factor: f64| NeighbourCovariance {
            stones: [StoneId(a), StoneId(b)],
            covariance: covariance * factor,
        };
        assert!(read_neighbours(folder.path(), 2).unwrap().is_empty());
        write_neighbours(folder.path(), 2, &[pair(3, 7, 2.0), pair(1, 2, 1.0)]).unwrap();
        let read = read_neighbours(folder.path(), 2).unwrap();
        assert_eq!(read, [pair(1, 2, 1.0), pair(3, 7, 2.0)]);
    }
}
