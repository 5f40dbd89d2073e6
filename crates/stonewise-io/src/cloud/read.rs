//! One way into every format.

use std::ops::ControlFlow;
use std::path::Path;

use super::chunk::Visit;
use super::{CloudError, CloudFormat, PointChunk, ReadSummary, e57_file, las, ply, ptx, text};

/// Passes the points of a file to `visit`, at most `chunk_points` at a time, in the order of the file.
///
/// Reads LAS 1.0 to 1.4, LAZ, COPC, E57, PTX, PLY and text (see [`CloudFormat`]); memory is bounded by the
/// chunk (LAZ unpacks faster with several times 50,000 points). An error of `visit` stops the pass and is returned.
///
/// ```
/// use stonewise_io::cloud::{CloudError, read_cloud};
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("wall.xyz");
/// std::fs::write(&path, "1.0 2.0 3.0\n1.0 2.5 3.0\n")?;
/// let mut highest = f64::NEG_INFINITY;
/// let summary = read_cloud(&path, 100_000, |chunk| {
///     highest = chunk.positions.iter().map(|p| p.y).fold(highest, f64::max);
///     Ok::<(), CloudError>(())
/// })?;
/// assert_eq!((summary.records, highest), (2, 2.5));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The file cannot be read, is of an unknown format, damaged or cut off; then some chunks may have been
/// visited already.
pub fn read_cloud<E: From<CloudError>>(
    path: &Path,
    chunk_points: usize,
    mut visit: impl FnMut(&PointChunk) -> Result<(), E>,
) -> Result<ReadSummary, E> {
    let visit: Visit<'_, E> = &mut visit;
    match CloudFormat::of(path)? {
        CloudFormat::Las => las::read(path, chunk_points, visit),
        CloudFormat::E57 => e57_file::read(path, chunk_points, visit),
        CloudFormat::Ptx => ptx::read(path, chunk_points, visit),
        CloudFormat::Ply => ply::read(path, chunk_points, visit),
        CloudFormat::Text => text::read(path, chunk_points, visit),
    }
}

/// As [`read_cloud`], until `visit` breaks off; `None` where it did.
///
/// # Errors
/// As [`read_cloud`].
pub fn read_first(
    path: &Path,
    chunk_points: usize,
    mut visit: impl FnMut(&PointChunk) -> ControlFlow<()>,
) -> Result<Option<ReadSummary>, CloudError> {
    let read = read_cloud(path, chunk_points, |chunk| match visit(chunk) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(Stop::Enough),
    });
    match read {
        Ok(summary) => Ok(Some(summary)),
        Err(Stop::Enough) => Ok(None),
        Err(Stop::Failed(error)) => Err(error),
    }
}

/// Why reading ends before the end of the file.
enum Stop {
    Enough,
    Failed(CloudError),
}

impl From<CloudError> for Stop {
    fn from(error: CloudError) -> Self {
        Self::Failed(error)
    }
}
