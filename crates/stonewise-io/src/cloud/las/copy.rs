//! A LAS file copied with more dimensions.

use std::ops::Range;
use std::path::Path;

use las::{Builder, PointData, Vlr};

use super::read::{LasSource, fill_chunk};
use super::{Layout, LazWriter};
use crate::cloud::extra_bytes;
use crate::cloud::label::{Fill, LabelColumns, PointLabel};
use crate::cloud::{CloudError, PointChunk, ReadSummary};

/// Points per step: enough 50,000-point chunks for several threads.
const STEP_POINTS: usize = 400_000;

/// Copies all records of a LAS file in their order and appends the label dimensions to each.
pub fn copy_labelled<E: From<CloudError>>(
    input: &Path,
    partial: &Path,
    name: &Path,
    columns: LabelColumns,
    fill: Fill<'_, E>,
) -> Result<ReadSummary, E> {
    let mut source = LasSource::open(input)?;
    let record = RecordCopy::new(input, &source.layout, columns)?;
    let mut writer = LazWriter::create(partial, name, builder(&source.layout, &record))?;
    let units = source.layout.system.units;
    let mut chunk = PointChunk::default();
    let mut summary = ReadSummary::default();
    while let Some((first, data)) = source.next(STEP_POINTS)? {
        summary += fill_chunk(&mut chunk, first, data, units);
        let labels = fill(&chunk)?;
        columns.check(name, &chunk, &labels)?;
        writer.write(record.copy(first, data, &chunk, &labels))?;
    }
    writer.finish()?;
    Ok(summary)
}

/// How a record of the input becomes one of the output.
struct RecordCopy {
    columns: LabelColumns,
    /// Bytes of the record that are copied, without gaps where possible.
    copied: Vec<Range<usize>>,
    extra_bytes: u16,
    /// Descriptors of all extra dimensions of the output.
    descriptors: Vec<u8>,
}

impl RecordCopy {
    fn new(input: &Path, layout: &Layout, columns: LabelColumns) -> Result<Self, CloudError> {
        let format = layout.header.point_format();
        let records = layout.header.vlrs().iter().chain(&layout.extended);
        // All dimensions of the input except those that are written anew.
        let mut kept = extra_bytes::existing(records, format.extra_bytes);
        kept.retain(|dimension| !columns.names().any(|n| n.as_bytes() == dimension.name()));
        let base = usize::from(format.len() - format.extra_bytes);
        let mut copied: Vec<Range<usize>> = std::iter::once(0..base).collect();

        for dimension in &kept {
            let bytes = base + dimension.bytes.start..base + dimension.bytes.end;
            match copied.last_mut() {
                Some(last) if last.end == bytes.start => last.end = bytes.end,
                _ => copied.push(bytes),
            }
        }

        let old: usize = kept.iter().map(|d| d.bytes.len()).sum();
        let extra_bytes = old + usize::from(columns.size());
        let record_bytes = u16::try_from(base + extra_bytes).map_err(|_| {
            let reason = format!(
                "its points take {} bytes, and a LAS point has at most {}: no room is left for the label columns",
                format.len(),
                u16::MAX
            );
            CloudError::malformed(input, reason)
        })?;
        let mut descriptors: Vec<u8> = kept.iter().flat_map(|d| d.descriptor).collect();
        descriptors.extend(columns.descriptors(input)?);

        Ok(Self {
            columns,
            copied,
            extra_bytes: record_bytes - base as u16,
            descriptors,
        })
    }

    fn copy(&self, first: u64, data: &PointData, chunk: &PointChunk, labels: &[PointLabel]) -> Vec<u8> {
        let length = data.record_len();
        let copied: usize = self.copied.iter().map(Range::len).sum();
        let mut out = Vec::with_capacity(data.len() * (copied + usize::from(self.columns.size())));
        let mut next = chunk.indices.iter().zip(labels).peekable();
        for (index, record) in (first..).zip(data.raw_bytes().chunks_exact(length)) {
            let own = next.next_if(|(i, _)| **i == index);
            let label = own.map_or(PointLabel::default(), |(_, label)| *label);
            if label.dropped {
                continue;
            }
            for bytes in &self.copied {
                out.extend_from_slice(&record[bytes.clone()]);
            }
            self.columns.append(&label, &mut out);
        }
        out
    }
}

/// The header of the copy: as the input's, as LAS 1.4, which has extra dimensions and any number of points.
fn builder(layout: &Layout, record: &RecordCopy) -> Builder {
    let mut builder = Builder::from(layout.header.clone());
    builder.version = las::Version::new(1, 4);
    builder.point_format.extra_bytes = record.extra_bytes;
    builder.padding.clear();
    builder.vlr_padding.clear();
    builder.point_padding.clear();
    builder.system_identifier = plain(&builder.system_identifier, 32);
    builder.generating_software = plain(&builder.generating_software, 32);
    builder.vlrs.retain(|r| !is_replaced(r));
    builder.evlrs.clone_from(&layout.extended);
    builder.evlrs.retain(|r| !is_replaced(r));
    for record in builder.vlrs.iter_mut().chain(&mut builder.evlrs) {
        record.user_id = plain(&record.user_id, 16);
        record.description = plain(&record.description, 32);
    }
    if !record.descriptors.is_empty() {
        let descriptors = record.descriptors.clone();
        builder.vlrs.push(extra_bytes::description_record(descriptors));
    }
    builder
}

/// Records that describe the old layout: compression, the COPC octree, extra bytes, packets of waveforms.
fn is_replaced(record: &Vlr) -> bool {
    matches!(
        (record.user_id.as_str(), record.record_id),
        ("laszip encoded", _) | ("copc", _) | ("LASF_Spec", 65535)
    ) || extra_bytes::is_description(record)
}

fn plain(text: &str, longest: usize) -> String {
    text.chars().filter(char::is_ascii).take(longest).collect()
}
