//! Tables of the experiments: numbers for files, and the same for people.

use crate::error::Result;
use crate::figure::{number, table};
use std::fmt::Write;
use stonewise_io::table::{Column, Table};

/// A table that takes one column after the other from the same rows.
pub(super) struct Columns<'a, R> {
    rows: &'a [R],
    pub table: Table,
}

impl<'a, R> Columns<'a, R> {
    pub(super) fn of(rows: &'a [R]) -> Self {
        Self {
            rows,
            table: Table::new(),
        }
    }

    /// Adds what each row has under this name; see [`Table::push`].
    pub(super) fn add<T>(&mut self, name: &str, unit: &str, meaning: &str, of: impl Fn(&R) -> T) -> Result<()>
    where
        Column: From<Vec<T>>,
    {
        let column: Vec<T> = self.rows.iter().map(of).collect();
        Ok(self.table.push(name, unit, meaning, column)?)
    }
}

/// A table of text, for a page and for Markdown.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TextTable {
    pub head: Vec<String>,
    pub rows: Vec<Vec<String>>,
}

impl TextTable {
    pub(super) fn new<const N: usize>(head: [&str; N], rows: Vec<[String; N]>) -> Self {
        Self {
            head: head.map(str::to_owned).into(),
            rows: rows.into_iter().map(Into::into).collect(),
        }
    }

    /// The numbers of a table: metres as millimetres with two decimals, all others with at most three.
    pub(super) fn of(table: &Table) -> Self {
        let is_length = |name: &str| table.description(name).is_some_and(|(unit, _)| unit == "m");
        let head = |name: &str| match name.strip_suffix("_m").filter(|_| is_length(name)) {
            Some(name) => format!("{} mm", name.replace('_', " ")),
            None => name.replace('_', " "),
        };
        let cell = |row: usize, name: &str, column: &Column| {
            if let Some(values) = column.values::<f64>().filter(|_| column.is_filled(row)) {
                match is_length(name) {
                    true => number(1e3 * values[row], 2),
                    false => ((values[row] * 1e3).round() / 1e3).to_string(),
                }
            } else if let Some(values) = column.values::<u32>() {
                values[row].to_string()
            } else {
                column
                    .values::<String>()
                    .map_or("\u{2013}".to_owned(), |values| values[row].clone())
            }
        };
        Self {
            head: table.names().map(head).collect(),
            rows: (0..table.rows())
                .map(|row| {
                    table
                        .columns()
                        .map(|(name, column)| cell(row, name, column))
                        .collect()
                })
                .collect(),
        }
    }

    /// The row with the number `best` stands out.
    pub(super) fn html(&self, best: Option<usize>) -> String {
        let head: Vec<&str> = self.head.iter().map(String::as_str).collect();
        table(&head, &self.rows, best)
    }

    pub(super) fn markdown(&self) -> String {
        let mut out = format!(
            "| {} |\n|{}\n",
            self.head.join(" | "),
            " --- |".repeat(self.head.len())
        );
        for row in &self.rows {
            let _ = writeln!(out, "| {} |", row.join(" | "));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_shown_in_millimetres_and_empty_cells_as_dashes() {
        let rows = [("a", Some(0.001_234), 0.25), ("b", None, 1.0 / 3.0)];
        let mut columns = Columns::of(&rows);
        columns.add("method", "", "method", |r| r.0.to_owned()).unwrap();
        columns.add("rmse_3d_m", "m", "error", |r| r.1).unwrap();
        columns.add("share", "", "share", |r| r.2).unwrap();
        assert_eq!(
            TextTable::of(&columns.table).markdown(),
            "| method | rmse 3d mm | share |\n| --- | --- | --- |\n| a | 1.23 | 0.25 |\n| b | – | 0.333 |\n"
        );
    }
}
