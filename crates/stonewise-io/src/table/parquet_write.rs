//! Tables written as Parquet files.

use std::fs::File;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{BoolType, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;

use super::column::Values;
use super::{Column, Lists, Table, TableError};
use crate::atomic::write_atomically;

/// Rows per row group: large enough to compress well, small enough for readers that take one at a time.
const ROWS_PER_GROUP: usize = 1 << 20;

/// Writes a table as a Parquet file, compressed with Snappy, with its metadata as key-value pairs.
///
/// Equal tables give equal bytes. A column of options is nullable; the others are required.
///
/// # Errors
/// The file cannot be written; an earlier file is kept then.
pub fn write_parquet(path: &Path, table: &Table) -> Result<(), TableError> {
    write(path, table, None)
}

/// As [`write_parquet`], with a column of lists behind the others, one list for each row.
///
/// # Errors
/// As [`write_parquet`].
pub fn write_parquet_with(path: &Path, table: &Table, lists: &Lists) -> Result<(), TableError> {
    write(path, table, Some(lists))
}

fn write(path: &Path, table: &Table, lists: Option<&Lists>) -> Result<(), TableError> {
    let written: Result<(), ParquetError> = write_atomically(path, |partial| {
        let file = File::create(partial)?;
        let mut writer =
            SerializedFileWriter::new(file, Arc::new(schema(table, lists)?), Arc::new(properties(table)))?;
        for start in (0..table.rows()).step_by(ROWS_PER_GROUP) {
            let rows = start..table.rows().min(start + ROWS_PER_GROUP);
            let mut group = writer.next_row_group()?;
            for (_, column) in table.columns() {
                if let Some(mut out) = group.next_column()? {
                    write_column(&mut out, column, rows.clone())?;
                    out.close()?;
                }
            }
            if let Some(lists) = lists {
                lists.write(rows, &mut group)?;
            }
            group.close()?;
        }
        writer.close()?;
        Ok(())
    });
    written.map_err(|e| TableError::unwritable(path, e))
}

fn schema(table: &Table, lists: Option<&Lists>) -> Result<Type, ParquetError> {
    let fields = table.columns().map(|(name, column)| {
        let (physical, logical) = match column.raw() {
            Values::F64(_) => (Physical::DOUBLE, None),
            Values::F32(_) => (Physical::FLOAT, None),
            Values::I64(_) => (Physical::INT64, None),
            Values::U64(_) => (Physical::INT64, Some(LogicalType::integer(64, false))),
            Values::U32(_) => (Physical::INT32, Some(LogicalType::integer(32, false))),
            Values::U16(_) => (Physical::INT32, Some(LogicalType::integer(16, false))),
            Values::U8(_) => (Physical::INT32, Some(LogicalType::integer(8, false))),
            Values::Bool(_) => (Physical::BOOLEAN, None),
            Values::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Values::Bytes(_) => (Physical::BYTE_ARRAY, None),
        };
        let repetition = match column.filled() {
            Some(_) => Repetition::OPTIONAL,
            None => Repetition::REQUIRED,
        };
        let field = Type::primitive_type_builder(name, physical)
            .with_logical_type(logical)
            .with_repetition(repetition)
            .build()?;
        Ok(Arc::new(field))
    });
    let fields = fields.chain(lists.map(Lists::schema));
    let fields = fields.collect::<Result<Vec<_>, ParquetError>>()?;
    Type::group_type_builder("table").with_fields(fields).build()
}

fn properties(table: &Table) -> WriterProperties {
    let entries = table.metadata_entries().iter();
    let entries = entries
        .map(|(k, v)| KeyValue::new(k.clone(), v.clone()))
        .collect();
    let mut properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_key_value_metadata(Some(entries));
    // Measured numbers hardly repeat: a dictionary of them would only cost time.
    for (name, column) in table.columns() {
        if !matches!(column.raw(), Values::Text(_) | Values::U8(_) | Values::U16(_)) {
            properties = properties.set_column_dictionary_enabled(vec![name.to_owned()].into(), false);
        }
    }
    properties.build()
}

fn write_column(
    out: &mut SerializedColumnWriter<'_>,
    column: &Column,
    rows: Range<usize>,
) -> Result<(), ParquetError> {
    let filled = column.filled().map(|f| &f[rows.clone()]);
    match column.raw() {
        Values::F64(v) => write_values::<DoubleType, _>(out, &v[rows], filled, |x| *x),
        Values::F32(v) => write_values::<FloatType, _>(out, &v[rows], filled, |x| *x),
        Values::I64(v) => write_values::<Int64Type, _>(out, &v[rows], filled, |x| *x),
        Values::U64(v) => write_values::<Int64Type, _>(out, &v[rows], filled, |x| x.cast_signed()),
        Values::U32(v) => write_values::<Int32Type, _>(out, &v[rows], filled, |x| x.cast_signed()),
        Values::U16(v) => write_values::<Int32Type, _>(out, &v[rows], filled, |x| i32::from(*x)),
        Values::U8(v) => write_values::<Int32Type, _>(out, &v[rows], filled, |x| i32::from(*x)),
        Values::Bool(v) => write_values::<BoolType, _>(out, &v[rows], filled, |x| *x),
        Values::Text(v) => write_values::<ByteArrayType, _>(out, &v[rows], filled, |x| x.as_str().into()),
        Values::Bytes(v) => write_values::<ByteArrayType, _>(out, &v[rows], filled, |x| x.clone().into()),
    }
}

fn write_values<D: DataType, T>(
    out: &mut SerializedColumnWriter<'_>,
    values: &[T],
    filled: Option<&[bool]>,
    convert: impl Fn(&T) -> D::T,
) -> Result<(), ParquetError> {
    let present = values.iter().enumerate();
    let present = present.filter(|(row, _)| filled.is_none_or(|f| f[*row]));
    let raw: Vec<D::T> = present.map(|(_, v)| convert(v)).collect();
    let levels: Option<Vec<i16>> = filled.map(|f| f.iter().map(|&b| i16::from(b)).collect());
    out.typed::<D>().write_batch(&raw, levels.as_deref(), None)?;
    Ok(())
}
