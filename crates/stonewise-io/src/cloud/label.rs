//! What is known about points, and the dimensions that hold it.

use std::path::Path;

use nalgebra::Vector3;
use stonewise_core::id::StoneId;

use super::extra_bytes::{Dimension, ExtraType, describe_all};
use super::{CloudError, PointChunk};

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
    /// `stone_id`; `dx`, `dy`, `dz` (f32, metres, NaN where no motion is known) and `significant` (u16, 0 or
    /// 1).
    StoneAndMotion,
}

/// Gives the labels of a chunk.
pub(super) type Fill<'a, E> = &'a mut dyn FnMut(&PointChunk) -> Result<Vec<PointLabel>, E>;

impl LabelColumns {
    fn dimensions(self) -> &'static [(Dimension<'static>, ExtraType)] {
        const ALL: [(Dimension, ExtraType); 5] = [
            (
                Dimension::new("stone_id", "", "stone, 0 for none"),
                ExtraType::U32,
            ),
            (Dimension::new("dx", "m", "displacement x"), ExtraType::F32),
            (Dimension::new("dy", "m", "displacement y"), ExtraType::F32),
            (Dimension::new("dz", "m", "displacement z"), ExtraType::F32),
            (
                Dimension::new("significant", "", "1: beyond the detection limit"),
                ExtraType::U16,
            ),
        ];
        match self {
            Self::Nothing => &[],
            Self::Stone => &ALL[..1],
            Self::StoneAndMotion => &ALL,
        }
    }

    pub(super) fn names(self) -> impl Iterator<Item = &'static str> {
        self.dimensions().iter().map(|(d, _)| d.name)
    }

    /// Bytes per point.
    pub(super) fn size(self) -> u16 {
        self.dimensions().iter().map(|(_, kind)| kind.size()).sum()
    }

    pub(super) fn descriptors(self, file: &Path) -> Result<Vec<u8>, CloudError> {
        describe_all(file, self.dimensions().iter().copied())
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
