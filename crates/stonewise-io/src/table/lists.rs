//! Columns of Parquet files whose cells are lists of records.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::reader::get_typed_column_reader;
use parquet::data_type::{ByteArray, ByteArrayType, DataType, DoubleType};
use parquet::errors::ParquetError;
use parquet::file::reader::FileReader;
use parquet::file::writer::SerializedRowGroupWriter;
use parquet::schema::types::{Type, TypePtr};

use super::TableError;
use super::parquet_read::{guarded, open, row_count, unreadable};

/// A column with a list in each row; each item is a text and numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Lists {
    /// Name of the column.
    pub name: String,
    /// Name of the text of an item.
    pub text: String,
    /// Names of its numbers.
    pub numbers: Vec<String>,
    /// One list for each row.
    pub rows: Vec<Vec<(String, Vec<f64>)>>,
}

impl Lists {
    /// The three levels that the format prescribes for lists.
    pub(super) fn schema(&self) -> Result<TypePtr, ParquetError> {
        let leaf = |name: &str, physical, logical| {
            Type::primitive_type_builder(name, physical)
                .with_logical_type(logical)
                .with_repetition(Repetition::REQUIRED)
                .build()
                .map(Arc::new)
        };
        let text = leaf(&self.text, Physical::BYTE_ARRAY, Some(LogicalType::String));
        let numbers = self.numbers.iter().map(|name| leaf(name, Physical::DOUBLE, None));
        let fields = std::iter::once(text)
            .chain(numbers)
            .collect::<Result<Vec<_>, _>>()?;
        let group = |name: &str, repetition, logical, fields: Vec<TypePtr>| {
            Type::group_type_builder(name)
                .with_repetition(repetition)
                .with_logical_type(logical)
                .with_fields(fields)
                .build()
                .map(Arc::new)
        };
        let element = group("element", Repetition::REQUIRED, None, fields)?;
        let list = group("list", Repetition::REPEATED, None, vec![element])?;
        group(
            &self.name,
            Repetition::REQUIRED,
            Some(LogicalType::List),
            vec![list],
        )
    }

    /// Writes the lists of some rows.
    pub(super) fn write(
        &self,
        rows: std::ops::Range<usize>,
        group: &mut SerializedRowGroupWriter<'_, File>,
    ) -> Result<(), ParquetError> {
        let rows = &self.rows[rows];
        // An empty list has one entry without a value.
        let of_row = |row: &Vec<_>| {
            let is_filled = i16::from(!row.is_empty());
            (0..row.len().max(1)).map(move |k| (is_filled, i16::from(k > 0)))
        };
        let (defined, repeated): (Vec<i16>, Vec<i16>) = rows.iter().flat_map(of_row).unzip();
        let items = || rows.iter().flatten();
        let texts: Vec<ByteArray> = items().map(|(text, _)| text.as_str().into()).collect();
        write_leaf::<ByteArrayType>(group, &texts, &defined, &repeated)?;
        for k in 0..self.numbers.len() {
            let numbers: Vec<f64> = items().map(|(_, numbers)| numbers[k]).collect();
            write_leaf::<DoubleType>(group, &numbers, &defined, &repeated)?;
        }
        Ok(())
    }
}

fn write_leaf<D: DataType>(
    group: &mut SerializedRowGroupWriter<'_, File>,
    values: &[D::T],
    defined: &[i16],
    repeated: &[i16],
) -> Result<(), ParquetError> {
    if let Some(mut out) = group.next_column()? {
        out.typed::<D>()
            .write_batch(values, Some(defined), Some(repeated))?;
        out.close()?;
    }
    Ok(())
}

/// Reads a column that [`write_parquet_with`](super::write_parquet_with) wrote; `None` where the file has none of this
/// name.
///
/// # Errors
/// The file cannot be read, is no Parquet file, or is damaged.
pub fn read_lists(path: &Path, name: &str) -> Result<Option<Lists>, TableError> {
    guarded(path, || {
        let reader = open(path)?;
        let descriptors = reader.metadata().file_metadata().schema_descr().columns();
        let of_name = descriptors.iter().enumerate();
        let leaves: Vec<(usize, String, Physical)> = of_name
            .filter(|(_, d)| d.max_rep_level() == 1 && d.path().parts()[0] == name)
            .map(|(k, d)| (k, d.name().to_owned(), d.physical_type()))
            .collect();
        let Some(((first, text, Physical::BYTE_ARRAY), numbers)) =
            leaves.split_first().map(|(f, n)| (f.clone(), n))
        else {
            return Ok(None);
        };
        let mut rows: Vec<Vec<(String, Vec<f64>)>> = Vec::with_capacity(row_count(&reader));
        let (texts, starts, filled) =
            read_leaf::<ByteArrayType>(&reader, first).map_err(|e| unreadable(path, e))?;
        let mut texts = texts.into_iter();
        for (starts, filled) in starts.iter().zip(&filled) {
            if *starts {
                rows.push(Vec::new());
            }
            if let (true, Some(row)) = (filled, rows.last_mut())
                && let Some(text) = texts.next()
            {
                let text = text.as_utf8().map_err(|e| unreadable(path, e))?;
                row.push((text.to_owned(), Vec::with_capacity(numbers.len())));
            }
        }
        for (leaf, _, _) in numbers {
            let (values, _, _) = read_leaf::<DoubleType>(&reader, *leaf).map_err(|e| unreadable(path, e))?;
            let items = rows.iter_mut().flatten();
            items.zip(values).for_each(|((_, all), value)| all.push(value));
        }
        Ok(Some(Lists {
            name: name.to_owned(),
            text,
            numbers: numbers.iter().map(|(_, name, _)| name.clone()).collect(),
            rows,
        }))
    })
}

/// Values of a leaf; for each entry whether it starts a row, and whether it has a value.
type Leaf<T> = (Vec<T>, Vec<bool>, Vec<bool>);

fn read_leaf<D: DataType>(reader: &impl FileReader, index: usize) -> Result<Leaf<D::T>, ParquetError> {
    let (mut values, mut defined, mut repeated) = (Vec::new(), Vec::new(), Vec::new());
    for group in 0..reader.num_row_groups() {
        let group = reader.get_row_group(group)?;
        let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
        let mut column = get_typed_column_reader::<D>(group.get_column_reader(index)?);
        column.read_records(rows, Some(&mut defined), Some(&mut repeated), &mut values)?;
    }
    let starts = repeated.iter().map(|level| *level == 0).collect();
    Ok((values, starts, defined.iter().map(|level| *level == 1).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::{Table, read_parquet, write_parquet_with};

    #[test]
    fn lists_come_back_beside_the_columns_and_empty_ones_stay_empty() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        let mut table = Table::new();
        table.push("a", "", "number", vec![1u32, 2, 3]).unwrap();
        let item = |text: &str, numbers: [f64; 2]| (text.to_owned(), numbers.to_vec());
        let lists = Lists {
            name: "budget".into(),
            text: "term".into(),
            numbers: vec!["x".into(), "y".into()],
            rows: vec![
                vec![item("stone", [0.5, 1.0]), item("größer", [2.0, -0.0])],
                Vec::new(),
                vec![item("scale", [4.0, 8.0])],
            ],
        };
        write_parquet_with(&path, &table, &lists).unwrap();
        assert_eq!(read_lists(&path, "budget").unwrap(), Some(lists));
        assert_eq!(read_lists(&path, "a").unwrap(), None);
        assert_eq!(read_parquet(&path).unwrap(), table);
        if let Some(folder) = std::env::var_os("STONEWISE_KEEP") {
            // For testdata/clouds/check_written.py.
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::copy(&path, Path::new(&folder).join("lists.parquet")).unwrap();
        }
    }
}
