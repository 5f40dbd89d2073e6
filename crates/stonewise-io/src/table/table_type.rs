//! The table itself.

use super::{Cell, Column, TableError};

/// Named columns of equal length, in order, and text metadata.
///
/// ```
/// use stonewise_io::table::Table;
/// let mut stones = Table::new();
/// stones.push("stone_id", "", "stone of the first epoch", vec![1u32, 2])?;
/// stones.push("lod95", "m", "detection limit", vec![Some(0.004), None])?;
/// assert_eq!(stones.required::<u32>("stone_id")?, [1, 2]);
/// assert_eq!(stones.optional::<f64>("lod95")?, [Some(0.004), None]);
/// assert_eq!(stones.description("lod95"), Some(("m", "detection limit")));
/// # Ok::<(), stonewise_io::table::TableError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    columns: Vec<(String, Column)>,
    metadata: Vec<(String, String)>,
}

impl Table {
    /// A table without columns.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a column at the end: a `Vec` of values, or of options where cells may be empty.
    ///
    /// `unit`: empty for counts, ratios, names and flags. Unit and meaning become the metadata entries
    /// `NAME.unit` and `NAME.meaning`.
    ///
    /// # Errors
    /// The length differs from the columns before, or the name is taken.
    pub fn push(
        &mut self,
        name: &str,
        unit: &str,
        meaning: &str,
        column: impl Into<Column>,
    ) -> Result<(), TableError> {
        self.push_column(name, column.into())?;
        self.set_metadata(&format!("{name}.unit"), unit);
        self.set_metadata(&format!("{name}.meaning"), meaning);
        Ok(())
    }

    /// Adds a column as [`push`](Self::push) does, but one whose metadata, if any, are set already.
    pub(super) fn push_column(&mut self, name: &str, column: Column) -> Result<(), TableError> {
        if !self.columns.is_empty() && column.len() != self.rows() {
            return Err(TableError::Rows {
                name: name.to_owned(),
                rows: column.len(),
                expected: self.rows(),
            });
        }
        if self.names().any(|n| n == name) {
            return Err(TableError::Duplicate(name.to_owned()));
        }
        self.columns.push((name.to_owned(), column));
        Ok(())
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |(_, c)| c.len())
    }

    /// Names of the columns, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(|(n, _)| n.as_str())
    }

    /// The columns with their names, in order.
    pub fn columns(&self) -> impl ExactSizeIterator<Item = (&str, &Column)> {
        self.columns.iter().map(|(n, c)| (n.as_str(), c))
    }

    /// A column by name.
    ///
    /// # Errors
    /// There is no such column.
    pub fn column(&self, name: &str) -> Result<&Column, TableError> {
        let found = self.columns.iter().find(|(n, _)| n == name);
        found.map(|(_, c)| c).ok_or_else(|| TableError::Missing {
            name: name.to_owned(),
            present: self.names().map(str::to_owned).collect(),
        })
    }

    /// The values of a column in which no cell is empty.
    ///
    /// # Errors
    /// There is no such column, it has another type, or a cell is empty.
    pub fn required<T: Cell>(&self, name: &str) -> Result<&[T], TableError> {
        let column = self.column(name)?;
        let values = self.typed(name, column)?;
        if column.filled().is_some_and(|f| f.contains(&false)) {
            return Err(TableError::Empty(name.to_owned()));
        }
        Ok(values)
    }

    /// The cells of a column, `None` where empty.
    ///
    /// # Errors
    /// There is no such column, or it has another type.
    pub fn optional<T: Cell>(&self, name: &str) -> Result<Vec<Option<T>>, TableError> {
        let column = self.column(name)?;
        let values = self.typed::<T>(name, column)?;
        let cells = values.iter().enumerate();
        Ok(cells
            .map(|(row, v)| column.is_filled(row).then(|| v.clone()))
            .collect())
    }

    /// Sets a metadata entry, replacing one of the same key.
    pub fn set_metadata(&mut self, key: &str, value: impl Into<String>) {
        self.metadata.retain(|(k, _)| k != key);
        self.metadata.push((key.to_owned(), value.into()));
    }

    /// Unit and meaning of a column.
    pub fn description(&self, name: &str) -> Option<(&str, &str)> {
        let entry = |what: &str| self.metadata(&format!("{name}.{what}"));
        entry("unit").zip(entry("meaning"))
    }

    /// A metadata entry.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        let found = self.metadata.iter().find(|(k, _)| k == key);
        found.map(|(_, v)| v.as_str())
    }

    /// All metadata entries, in the order in which they were set.
    pub fn metadata_entries(&self) -> &[(String, String)] {
        &self.metadata
    }

    fn typed<'a, T: Cell>(&self, name: &str, column: &'a Column) -> Result<&'a [T], TableError> {
        column.values().ok_or_else(|| TableError::Type {
            name: name.to_owned(),
            found: column.raw().type_name(),
            expected: T::NAME,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_that_do_not_fit_are_refused() {
        let mut table = Table::new();
        table.push("a", "m", "length", vec![1.0, 2.0]).unwrap();
        assert!(matches!(
            table.push("b", "", "count", vec![1u32]),
            Err(TableError::Rows { rows: 1, .. })
        ));
        assert!(matches!(
            table.push("a", "", "count", vec![1u32, 2]),
            Err(TableError::Duplicate(_))
        ));
        assert_eq!(table.description("a"), Some(("m", "length")));
        assert_eq!(table.description("b"), None);
        assert!(matches!(
            table.required::<f64>("c"),
            Err(TableError::Missing { .. })
        ));
        assert!(matches!(table.required::<f32>("a"), Err(TableError::Type { .. })));
        table.push("e", "", "flag", vec![Some(true), None]).unwrap();
        assert!(matches!(table.required::<bool>("e"), Err(TableError::Empty(_))));
        assert_eq!(table.optional::<bool>("e").unwrap(), [Some(true), None]);
    }
}
