//! Results written back onto the points.

use std::path::Path;

use super::export::export_labelled;
use super::label::{LabelColumns, PointLabel};
use super::las::copy_labelled;
use super::whole::write_whole;
use super::{CloudError, CloudFormat, PointChunk, ReadSummary};

/// Copies a cloud to a LAZ file and adds what is known about each point.
///
/// The points keep their order. A LAS, LAZ or COPC file keeps every record with all its attributes, its
/// scale, offset and coordinate system, and its own extra dimensions (but one of a name that is added is
/// replaced); it becomes LAS 1.4 of the same point format, without the index of COPC. Other formats become
/// LAS 1.4 with a step of 0.1 mm, colour and intensity where present and the number of the E57 scan (from 1)
/// as the point source; records without a position are left out there.
///
/// `label` gives one label per point of a chunk. An unknown motion is NaN, not zero: it must not look like
/// rest.
///
/// # Errors
/// As [`read_cloud`](super::read_cloud), or what `label` returns, or the file cannot be written; `output`
/// then stays as it was.
pub fn write_labelled<E: From<CloudError>>(
    input: &Path,
    output: &Path,
    columns: LabelColumns,
    mut label: impl FnMut(&PointChunk) -> Result<Vec<PointLabel>, E>,
) -> Result<ReadSummary, E> {
    let format = CloudFormat::of(input)?;
    write_whole(output, |partial| match format {
        CloudFormat::Las => copy_labelled(input, partial, output, columns, &mut label),
        _ => export_labelled(input, partial, output, columns, &mut label),
    })
}

/// Copies the points that `keep` accepts, by the index of their record, to a LAZ file; see
/// [`write_labelled`].
///
/// # Errors
/// As [`write_labelled`], or what `keep` returns.
pub fn select_points<E: From<CloudError>>(
    input: &Path,
    output: &Path,
    mut keep: impl FnMut(u64) -> Result<bool, E>,
) -> Result<ReadSummary, E> {
    write_labelled(input, output, LabelColumns::Nothing, |chunk| {
        let label = |&index: &u64| {
            let dropped = !keep(index)?;
            Ok(PointLabel {
                dropped,
                ..PointLabel::default()
            })
        };
        chunk.indices.iter().map(label).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::read_cloud;

    #[test]
    fn two_selections_share_out_all_points_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let text = (0..1000)
            .map(|i| format!("{i}.25 {} 7\n", i % 13))
            .collect::<String>();
        let input = folder.path().join("all.xyz");
        std::fs::write(&input, text).unwrap();
        let halves = [0, 1].map(|half| {
            let output = folder.path().join(format!("{half}.laz"));
            select_points(&input, &output, |index| {
                Ok::<_, CloudError>(index % 3 % 2 == half)
            })
            .unwrap();
            let mut x = Vec::new();
            read_cloud(&output, 100, |c| {
                x.extend(c.positions.iter().map(|p| p.x.round() as u64));
                Ok::<(), CloudError>(())
            })
            .unwrap();
            x
        });
        let expected = [0u64, 1].map(|half| (0..1000u64).filter(|i| i % 3 % 2 == half).collect::<Vec<_>>());
        assert_eq!(halves, expected);
    }
}
