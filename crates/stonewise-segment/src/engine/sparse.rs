//! Sparse matrices with a fixed pattern, for gathering features.

use std::ops::Range;

/// A matrix of few non-zero entries, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseMatrix {
    columns: usize,
    /// Where each row's entries begin; one more at the end.
    starts: Vec<usize>,
    entries: Vec<(u32, f32)>,
}

impl SparseMatrix {
    /// A matrix of no rows yet.
    pub fn new(columns: usize) -> Self {
        Self {
            columns,
            starts: vec![0],
            entries: Vec::new(),
        }
    }

    /// Appends a row of (column, value); entries of the same column add up in a product.
    pub fn push_row(&mut self, entries: impl IntoIterator<Item = (u32, f32)>) {
        self.entries.extend(entries);
        self.starts.push(self.entries.len());
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// Entries (column, value) of a row.
    pub fn row(&self, row: usize) -> &[(u32, f32)] {
        &self.entries[self.range(row)]
    }

    /// The transposed matrix; the entries of a row are in ascending order of their columns. O(entries).
    pub fn transposed(&self) -> Self {
        let mut starts = vec![0usize; self.columns + 1];
        for &(column, _) in &self.entries {
            starts[column as usize + 1] += 1;
        }
        for column in 0..self.columns {
            starts[column + 1] += starts[column];
        }
        let mut next = starts.clone();
        let mut entries = vec![(0, 0.0); self.entries.len()];
        for row in 0..self.rows() {
            for &(column, value) in self.row(row) {
                entries[next[column as usize]] = (row as u32, value);
                next[column as usize] += 1;
            }
        }
        Self {
            columns: self.rows(),
            starts,
            entries,
        }
    }

    fn range(&self, row: usize) -> Range<usize> {
        self.starts[row]..self.starts[row + 1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposing_moves_every_entry() {
        let mut matrix = SparseMatrix::new(4);
        matrix.push_row([(3, 1.0), (0, 2.0), (3, 0.5)]);
        matrix.push_row([]);
        matrix.push_row([(0, -1.0)]);
        let transposed = matrix.transposed();
        assert_eq!((transposed.rows(), transposed.columns), (4, 3));
        assert_eq!(transposed.row(0), [(0, 2.0), (2, -1.0)]);
        assert_eq!(transposed.row(3), [(0, 1.0), (0, 0.5)]);
        assert!(transposed.row(1).is_empty());
    }
}
