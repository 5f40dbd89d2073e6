//! Results written back onto the points.

use std::path::Path;

use nalgebra::Vector3;
use stonewise_core::id::StoneId;

use super::export::export_labelled;
use super::las::{DESCRIPTOR_BYTES, ExtraType, copy_labelled, describe};
use super::whole::write_whole;
use super::{CloudError, CloudFormat, PointChunk, ReadSummary};

/// What is known about one point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PointLabel {
    /// The stone that the point lies on.
    pub stone: Option<StoneId>,
    /// How the stone moved at this point, where that is known.
    pub motion: Option<PointMotion>,
    /// The point is left out of the copy.
    pub dropped: bool,
}

/// Movement of a point from the first epoch to the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointMotion {
    /// Metres, world frame.
    pub displacement_m: Vector3<f32>,
    /// Whether it is larger than its uncertainty.
    pub significant: bool,
}

/// Dimensions that are added to each point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LabelColumns {
    /// None: a plain copy.
    Nothing,
    /// `stone_id` (u32, 0 for no stone).
    Stone,
    /// `stone_id`; `dx`, `dy`, `dz` (f32, metres, NaN where no motion is known) and `significant` (u16, 0 or 1).
    StoneAndMotion,
}

/// Copies a cloud to a LAZ file and adds what is known about each point.
///
/// The points keep their order. A LAS, LAZ or COPC file keeps every record with all its attributes, its
/// scale, offset and coordinate system, and its own extra dimensions (but one of a name that is added is
/// replaced); it becomes LAS 1.4 of the same point format, without the index of COPC. Other formats become
/// LAS 1.4 with a step of 0.1 mm, colour and intensity where present and the number of the E57 scan (from 1)
/// as the point source; records without a position are left out there.
///
/// `label` gives one label per point of a chunk. An unknown motion is NaN, not zero: it must not look like rest.
///
/// # Errors
/// As [`read_cloud`](super::read_cloud), or what `label` returns, or the file cannot be written; `output` then stays as it was.
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

/// Copies the points that `keep` wants, by the index of their record, to a LAZ file; see [`write_labelled`].
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

/// Gives the labels of a chunk.
pub(super) type Fill<'a, E> = &'a mut dyn FnMut(&PointChunk) -> Result<Vec<PointLabel>, E>;

impl LabelColumns {
    fn dimensions(self) -> &'static [(&'static str, ExtraType, &'static str)] {
        const ALL: [(&str, ExtraType, &str); 5] = [
            ("stone_id", ExtraType::U32, "stone, 0 for none"),
            ("dx", ExtraType::F32, "displacement x, m"),
            ("dy", ExtraType::F32, "displacement y, m"),
            ("dz", ExtraType::F32, "displacement z, m"),
            ("significant", ExtraType::U16, "1: beyond the detection limit"),
        ];
        match self {
            Self::Nothing => &[],
            Self::Stone => &ALL[..1],
            Self::StoneAndMotion => &ALL,
        }
    }

    pub(super) fn names(self) -> impl Iterator<Item = &'static str> {
        self.dimensions().iter().map(|(name, _, _)| *name)
    }

    /// Bytes per point.
    pub(super) fn size(self) -> u16 {
        self.dimensions().iter().map(|(_, kind, _)| kind.size()).sum()
    }

    pub(super) fn descriptors(self) -> Vec<u8> {
        let all = self.dimensions().iter();
        let all = all.filter_map(|(name, kind, text)| describe(name, *kind, text));
        all.flat_map(<[u8; DESCRIPTOR_BYTES]>::into_iter).collect()
    }

    pub(super) fn append(self, label: &PointLabel, out: &mut Vec<u8>) {
        if self == Self::Nothing {
            return;
        }
        out.extend(label.stone.map_or(0, |s| s.0).to_le_bytes());
        if self == Self::Stone {
            return;
        }
        let unknown = Vector3::repeat(f32::NAN);
        let displacement = label.motion.map_or(unknown, |m| m.displacement_m);
        for component in displacement.iter() {
            out.extend(component.to_le_bytes());
        }
        let significant = label.motion.is_some_and(|m| m.significant);
        out.extend(u16::from(significant).to_le_bytes());
    }

    pub(super) fn check(
        self,
        name: &Path,
        chunk: &PointChunk,
        labels: &[PointLabel],
    ) -> Result<(), CloudError> {
        if labels.len() == chunk.len() {
            return Ok(());
        }
        let reason = format!("{} labels for {} points", labels.len(), chunk.len());
        Err(CloudError::unwritable(name, reason))
    }
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
