//! Tables of named columns with units and meanings: written as Parquet or CSV, read back from Parquet; and CSV files
//! that others wrote.

mod column;
mod csv_metadata;
mod csv_read;
mod csv_write;
mod error;
mod lists;
mod parquet_read;
mod parquet_write;
mod table_type;

pub use column::{Cell, Column};
pub use csv_metadata::write_csv_metadata;
pub use csv_read::{CsvError, CsvFile, CsvRow};
pub use csv_write::{write_csv, write_csv_described_in};
pub use error::TableError;
pub use lists::{Lists, read_lists};
pub use parquet_read::{read_columns, read_metadata, read_parquet};
pub use parquet_write::{write_parquet, write_parquet_with};
pub use table_type::Table;
