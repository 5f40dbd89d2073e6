//! Tables read from Parquet files.

use std::fs::File;
use std::path::Path;

use parquet::basic::{LogicalType, Type as Physical};
use parquet::column::reader::get_typed_column_reader;
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type,
};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::column::Values;
use super::{Column, Table, TableError};
use crate::wall::behind_wall;

/// Reads all columns of a Parquet file but those of lists, which [`read_lists`](super::read_lists) reads.
///
/// # Errors
/// The file cannot be read, is no Parquet file, is damaged, or has a column of a type that a [`Table`] cannot
/// hold.
pub fn read_parquet(path: &Path) -> Result<Table, TableError> {
    guarded(path, || read_selected(path, None))
}

/// Reads some columns of a Parquet file, in the order of the argument, and all metadata.
///
/// # Errors
/// As [`read_parquet`], or a column is missing.
pub fn read_columns(path: &Path, names: &[&str]) -> Result<Table, TableError> {
    guarded(path, || read_selected(path, Some(names)))
}

/// Number of rows and metadata of a Parquet file, without its columns.
///
/// # Errors
/// As [`read_parquet`].
pub fn read_metadata(path: &Path) -> Result<(usize, Vec<(String, String)>), TableError> {
    guarded(path, || {
        let reader = open(path)?;
        Ok((row_count(&reader), key_values(&reader)))
    })
}

pub(super) fn open(path: &Path) -> Result<SerializedFileReader<File>, TableError> {
    let file = File::open(path).map_err(|e| unreadable(path, e))?;
    SerializedFileReader::new(file).map_err(|e| unreadable(path, e))
}

pub(super) fn row_count(reader: &SerializedFileReader<File>) -> usize {
    usize::try_from(reader.metadata().file_metadata().num_rows()).unwrap_or(0)
}

fn key_values(reader: &SerializedFileReader<File>) -> Vec<(String, String)> {
    let entries = reader.metadata().file_metadata().key_value_metadata();
    entries
        .into_iter()
        .flatten()
        .map(|e| (e.key.clone(), e.value.clone().unwrap_or_default()))
        .collect()
}

fn read_selected(path: &Path, names: Option<&[&str]>) -> Result<Table, TableError> {
    let reader = open(path)?;
    let descriptors = reader.metadata().file_metadata().schema_descr().columns();
    let present: Vec<String> = descriptors.iter().map(|d| d.path().string()).collect();
    let selected = match names {
        None => (0..present.len())
            .filter(|k| descriptors[*k].max_rep_level() == 0)
            .collect(),
        Some(names) => positions(names, &present)?,
    };
    let mut table = Table::new();
    for (key, value) in key_values(&reader) {
        table.set_metadata(&key, value);
    }
    for index in selected {
        let column = read_column(&reader, index, &descriptors[index]).map_err(|e| unreadable(path, e))?;
        table.push_column(&present[index], column)?;
    }
    Ok(table)
}

fn positions(names: &[&str], present: &[String]) -> Result<Vec<usize>, TableError> {
    let find = |name: &&str| {
        let found = present.iter().position(|p| p == name);
        found.ok_or_else(|| TableError::Missing {
            name: (*name).to_owned(),
            present: present.to_vec(),
        })
    };
    names.iter().map(find).collect()
}

/// Reads a column as the type that its annotation names, as other programs write them too.
fn read_column(
    reader: &SerializedFileReader<File>,
    index: usize,
    descriptor: &ColumnDescriptor,
) -> Result<Column, ParquetError> {
    let integer = match descriptor.logical_type_ref() {
        Some(LogicalType::Integer(int)) => (int.bit_width, int.is_signed),
        _ => (0, true),
    };
    let text = matches!(descriptor.logical_type_ref(), Some(LogicalType::String));
    let plain = descriptor.max_rep_level() == 0 && descriptor.max_def_level() <= 1;
    let source = Source {
        reader,
        index,
        nullable: descriptor.max_def_level() == 1,
    };
    match (descriptor.physical_type(), integer) {
        _ if !plain => Err(unsupported(descriptor)),
        (Physical::DOUBLE, _) => source.read::<DoubleType, _>(Ok, Values::F64),
        (Physical::FLOAT, _) => source.read::<FloatType, _>(Ok, Values::F32),
        (Physical::BOOLEAN, _) => source.read::<BoolType, _>(Ok, Values::Bool),
        (Physical::INT64, (_, true)) => source.read::<Int64Type, _>(Ok, Values::I64),
        (Physical::INT64, (_, false)) => source.read::<Int64Type, _>(|v| Ok(v.cast_unsigned()), Values::U64),
        (Physical::INT32, (_, true)) => source.read::<Int32Type, _>(|v| Ok(i64::from(v)), Values::I64),
        (Physical::INT32, (8, _)) => source.read::<Int32Type, _>(narrow, Values::U8),
        (Physical::INT32, (16, _)) => source.read::<Int32Type, _>(narrow, Values::U16),
        (Physical::INT32, _) => source.read::<Int32Type, _>(|v| Ok(v.cast_unsigned()), Values::U32),
        (Physical::BYTE_ARRAY, _) if text => source.read::<ByteArrayType, _>(utf8, Values::Text),
        (Physical::BYTE_ARRAY, _) if descriptor.logical_type_ref().is_none() => {
            source.read::<ByteArrayType, _>(|v| Ok(v.data().to_vec()), Values::Bytes)
        }
        _ => Err(unsupported(descriptor)),
    }
}

/// One column of an open file.
struct Source<'a> {
    reader: &'a SerializedFileReader<File>,
    index: usize,
    nullable: bool,
}

impl Source<'_> {
    fn read<D: DataType, T: Clone + Default>(
        &self,
        convert: impl Fn(D::T) -> Result<T, ParquetError>,
        wrap: impl Fn(Vec<T>) -> Values,
    ) -> Result<Column, ParquetError> {
        let mut raw: Vec<D::T> = Vec::new();
        let mut levels: Vec<i16> = Vec::new();
        let mut rows = 0;
        for group in 0..self.reader.num_row_groups() {
            let group = self.reader.get_row_group(group)?;
            let expected = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
            let mut column = get_typed_column_reader::<D>(group.get_column_reader(self.index)?);
            let levels = self.nullable.then_some(&mut levels);
            let (read, _, _) = column.read_records(expected, levels, None, &mut raw)?;
            if read != expected {
                return Err(ParquetError::EOF(format!(
                    "{read} rows where {expected} should be"
                )));
            }
            rows += read;
        }
        if !self.nullable {
            let values = raw.into_iter().map(convert).collect::<Result<_, _>>()?;
            return Ok(Column::new(wrap(values), None));
        }
        let mut values = vec![T::default(); rows];
        let filled: Vec<bool> = levels.iter().map(|&level| level == 1).collect();
        let slots = values.iter_mut().zip(&filled).filter(|(_, filled)| **filled);
        for ((slot, _), value) in slots.zip(raw) {
            *slot = convert(value)?;
        }
        Ok(Column::new(wrap(values), Some(filled)))
    }
}

fn narrow<T: TryFrom<i32>>(value: i32) -> Result<T, ParquetError> {
    T::try_from(value).map_err(|_| ParquetError::General(format!("{value} is out of its column's range")))
}

fn utf8(bytes: ByteArray) -> Result<String, ParquetError> {
    Ok(bytes.as_utf8()?.to_owned())
}

fn unsupported(descriptor: &ColumnDescriptor) -> ParquetError {
    ParquetError::NYI(format!(
        "column {} is neither a number, nor a boolean, nor text, nor bytes",
        descriptor.path()
    ))
}

/// Damaged files make the decoder panic in places; this turns that into an error.
pub(super) fn guarded<T>(path: &Path, read: impl FnOnce() -> Result<T, TableError>) -> Result<T, TableError> {
    behind_wall(read).unwrap_or_else(|| Err(unreadable(path, "the file is damaged")))
}

pub(super) fn unreadable(path: &Path, reason: impl ToString) -> TableError {
    TableError::Read {
        path: path.to_owned(),
        reason: reason.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::write_parquet;

    fn example() -> Table {
        let mut table = Table::new();
        table
            .push("x", "m", "of x", vec![0.5f32, f32::NAN, -1.0])
            .unwrap();
        table
            .push("y", "m", "of y", vec![Some(1.0f64), None, Some(-0.0)])
            .unwrap();
        table.push("i", "m", "of i", vec![i64::MIN, 0, 7]).unwrap();
        table.push("u", "m", "of u", vec![u64::MAX, 0, 7]).unwrap();
        table
            .push("id", "m", "of id", vec![Some(u32::MAX), None, Some(0)])
            .unwrap();
        table.push("file", "m", "of file", vec![u16::MAX, 0, 1]).unwrap();
        table.push("small", "m", "of small", vec![u8::MAX, 0, 1]).unwrap();
        table
            .push("flag", "m", "of flag", vec![Some(true), Some(false), None])
            .unwrap();
        table
            .push(
                "name",
                "",
                "name",
                vec![Some("Größe".to_owned()), None, Some(String::new())],
            )
            .unwrap();
        table.set_metadata("origin", "[1.25, -3.0, 1e300]");
        table.set_metadata("empty", "");
        table
    }

    #[test]
    fn every_type_comes_back_with_its_empty_cells_and_metadata() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        write_parquet(&path, &example()).unwrap();
        if let Some(folder) = std::env::var_os("STONEWISE_KEEP") {
            // For testdata/clouds/check_written.py.
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::copy(&path, Path::new(&folder).join("table.parquet")).unwrap();
        }
        let back = read_parquet(&path).unwrap();
        assert_eq!(format!("{back:?}"), format!("{:?}", example()));
        let part = read_columns(&path, &["id", "x"]).unwrap();
        assert_eq!(part.names().collect::<Vec<_>>(), ["id", "x"]);
        assert_eq!(
            part.optional::<u32>("id").unwrap(),
            [Some(u32::MAX), None, Some(0)]
        );
        let (rows, metadata) = read_metadata(&path).unwrap();
        assert_eq!((rows, metadata.len()), (3, 2 * 9 + 2));
        assert!(matches!(
            read_columns(&path, &["no"]),
            Err(TableError::Missing { .. })
        ));
    }

    #[test]
    fn several_row_groups_and_none_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        let mut table = Table::new();
        let values: Vec<Option<u32>> = (0..1_200_000).map(|i| (i % 3 != 0).then_some(i)).collect();
        table.push("a", "", "number", values.clone()).unwrap();
        write_parquet(&path, &table).unwrap();
        assert_eq!(read_parquet(&path).unwrap().optional::<u32>("a").unwrap(), values);
        let mut empty = Table::new();
        empty.push("a", "m", "length", Vec::<f64>::new()).unwrap();
        write_parquet(&path, &empty).unwrap();
        assert_eq!(read_parquet(&path).unwrap(), empty);
    }

    #[test]
    fn damaged_files_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        write_parquet(&path, &example()).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in (0..whole.len()).step_by(37) {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(read_parquet(&path).is_err(), "cut to {length} bytes");
        }
        for place in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[place] ^= [0xff, 0x80, 0x01][place % 3];
            std::fs::write(&path, &bytes).unwrap();
            let _ = read_parquet(&path);
        }
    }
}
