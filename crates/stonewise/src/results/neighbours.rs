//! `neighbours.parquet`: covariances of the motions of neighbours relative to each other.

use super::evidence::read_table;
use super::names::PairFile;
use crate::error::Error;
use nalgebra::Matrix3;
use std::collections::BTreeMap;
use std::path::Path;
use stonewise_core::stone::Contrast;
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

/// Covariances of the second stone's displacement less the first's, world, m^2, by the ids of both stones;
/// the lower id comes first.
pub type NeighbourCovariances = BTreeMap<[u32; 2], Matrix3<f64>>;

/// Writes the file of a pair of epochs, one row for each pair of neighbours that were both measured.
///
/// # Errors
/// The file cannot be written.
pub(crate) fn write_neighbours(dir: &Path, pair: usize, contrasts: &[Contrast]) -> Result<(), Error> {
    let covariances: NeighbourCovariances = contrasts.iter().map(by_ids).collect();
    let mut table = Table::new();
    let columns = [("stone_1", "one of two neighbours"), ("stone_2", "the other")];
    for (k, (name, meaning)) in columns.into_iter().enumerate() {
        let ids: Vec<u32> = covariances.keys().map(|ids| ids[k]).collect();
        table.push(name, "", meaning, ids)?;
    }
    for (name, [r, c]) in COVARIANCE {
        let values: Vec<f64> = covariances.values().map(|m| m[(r, c)]).collect();
        table.push(
            name,
            "m2",
            "covariance of the displacement of stone_2 less that of stone_1, world; errors that both \
             share cancel",
            values,
        )?;
    }
    Ok(write_parquet(&dir.join(PairFile::Neighbours.name(pair)), &table)?)
}

fn by_ids(contrast: &Contrast) -> ([u32; 2], Matrix3<f64>) {
    let mut ids = contrast.stones.map(|s| s.0);
    ids.sort_unstable();
    (ids, contrast.covariance)
}

/// Reads the file of a pair of epochs; empty if there is none.
///
/// # Errors
/// The file is damaged.
pub(crate) fn read_neighbours(dir: &Path, pair: usize) -> Result<NeighbourCovariances, Error> {
    let path = dir.join(PairFile::Neighbours.name(pair));
    let Some(table) = read_table(&path)? else {
        return Ok(NeighbourCovariances::new());
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
    Ok((0..first.len())
        .map(|row| ([first[row], second[row]], covariance(row)))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use stonewise_core::id::StoneId;

    #[test]
    fn covariances_come_back_as_written() {
        let folder = tempfile::tempdir().unwrap();
        let covariance = Matrix3::new(4.0, 1.0, 2.0, 1.0, 5.0, 3.0, 2.0, 3.0, 6.0) * 1e-6;
        let contrast = |a: u32, b: u32, factor: f64| Contrast {
            stones: [StoneId(a), StoneId(b)],
            covariance: covariance * factor,
        };
        assert!(read_neighbours(folder.path(), 2).unwrap().is_empty());
        write_neighbours(folder.path(), 2, &[contrast(7, 3, 2.0), contrast(1, 2, 1.0)]).unwrap();
        let read = read_neighbours(folder.path(), 2).unwrap();
        let expected = [([1, 2], covariance), ([3, 7], covariance * 2.0)];
        assert_eq!(read, NeighbourCovariances::from(expected));
    }
}
