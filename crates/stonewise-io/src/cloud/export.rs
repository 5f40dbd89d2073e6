//! Clouds that were not LAS before, written as LAS with labels.

use std::path::Path;

use las::{Transform, Vector};
use nalgebra::Point3;
use stonewise_core::geometry::Bounds;

use super::label::{Fill, LabelColumns, PointLabel};
use super::las::{Export, LazWriter, crs_record, export_header, transforms_for};
use super::{CloudError, CloudFormat, PointChunk, ReadSummary, e57_file, read_cloud};

/// Step of the coordinates, metres.
const SCALE_M: f64 = 1e-4;
const CHUNK_POINTS: usize = 400_000;

/// Writes the points of a file with labels, in two passes over it: LAS needs the box around all points first.
pub(super) fn export_labelled<E: From<CloudError>>(
    input: &Path,
    partial: &Path,
    name: &Path,
    columns: LabelColumns,
    fill: Fill<'_, E>,
) -> Result<ReadSummary, E> {
    let survey = Survey::of(input)?;
    let transforms = transforms_for(&survey.bounds, SCALE_M)
        .ok_or_else(|| CloudError::unwritable(name, format!("too large for LAS: {:?}", survey.bounds)))?;
    let mut header = export_header(
        survey.has_color,
        transforms,
        columns.size(),
        columns.descriptors(name)?,
    );
    header.vlrs.extend(survey.crs.as_deref().and_then(crs_record));
    let mut writer = LazWriter::create(partial, name, header)?;
    let summary = read_cloud(input, CHUNK_POINTS, |chunk| {
        let labels = fill(chunk)?;
        columns.check(name, chunk, &labels)?;
        writer.write(survey.records(chunk, &labels, columns, &transforms))?;
        Ok::<(), E>(())
    })?;
    writer.finish()?;
    Ok(summary)
}

/// What must be known of a cloud before its first point is written.
struct Survey {
    bounds: Bounds,
    has_color: bool,
    /// Smallest, if below 0, and largest.
    intensity: [f32; 2],
    /// WKT, or a code.
    crs: Option<String>,
}

impl Survey {
    fn of(input: &Path) -> Result<Self, CloudError> {
        let mut bounds: Option<Bounds> = None;
        let (mut has_color, mut intensity) = (false, [0f32; 2]);
        read_cloud(input, CHUNK_POINTS, |chunk| {
            if let Some(new) = Bounds::of(chunk.positions.iter().copied()) {
                bounds = Some(bounds.map_or(new, |b| b.union(&new)));
            }
            has_color |= chunk.colors.is_some();
            let intensities = chunk.intensities.iter().flatten();
            intensity = intensities.fold(intensity, |[low, high], i| [low.min(*i), high.max(*i)]);
            Ok::<(), CloudError>(())
        })?;
        let crs = match CloudFormat::of(input)? {
            CloudFormat::E57 => e57_file::scans(input)?.1,
            _ => None,
        };
        let origin = Point3::origin();
        Ok(Self {
            bounds: bounds.unwrap_or(Bounds {
                min: origin,
                max: origin,
            }),
            has_color,
            intensity,
            crs,
        })
    }

    /// Intensities from 0 to 1 are stretched to 16 bits, those that begin below 0 are shifted to 0; what is
    /// beyond 16 bits is cut.
    fn intensity(&self, value: f32) -> u16 {
        let [low, high] = self.intensity;
        let factor = if low == 0.0 && high <= 1.0 { 65535.0 } else { 1.0 };
        ((value - low) * factor).round() as u16
    }

    fn records(
        &self,
        chunk: &PointChunk,
        labels: &[PointLabel],
        columns: LabelColumns,
        transforms: &Vector<Transform>,
    ) -> Vec<u8> {
        let mut out = Vec::new();
        for (i, label) in labels.iter().enumerate().filter(|(_, l)| !l.dropped) {
            let intensity = chunk.intensities.as_ref().map(|all| self.intensity(all[i]));
            let color = chunk.colors.as_ref().map(|all| all[i]);
            let record = Export {
                position: chunk.positions[i],
                intensity: intensity.unwrap_or(0),
                color: self.has_color.then_some(color.unwrap_or_default()),
                source: chunk.scan.map_or(0, |scan| (scan + 1) as u16),
                gps_time: 0.0,
            };
            record.append(transforms, &mut out);
            columns.append(label, &mut out);
        }
        out
    }
}
