//! Tables in Markdown, printed row by row: a row may take minutes.

/// A table whose head is printed.
pub struct Table(usize);

impl Table {
    /// Prints the head of a table with these columns.
    pub fn begin<'a>(columns: impl IntoIterator<Item = &'a str>) -> Self {
        let columns: Vec<&str> = columns.into_iter().collect();
        line(&columns);
        line(&vec!["---"; columns.len()]);
        Self(columns.len())
    }

    /// Prints a row; cells that are missing at its end stay empty.
    pub fn row(&self, cells: impl IntoIterator<Item = String>) {
        let mut cells: Vec<String> = cells.into_iter().collect();
        cells.resize(self.0, String::new());
        line(&cells);
    }
}

fn line<S: AsRef<str>>(cells: &[S]) {
    let cells: Vec<&str> = cells.iter().map(AsRef::as_ref).collect();
    println!("| {} |", cells.join(" | "));
}
