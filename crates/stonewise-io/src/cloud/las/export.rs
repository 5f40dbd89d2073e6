//! Points of other formats as LAS 1.4 records.

use las::{Builder, Transform, Vector, point::Format};
use nalgebra::Point3;
use stonewise_core::geometry::Bounds;

use crate::cloud::extra_bytes::description_record;

/// Steps of coordinates that are tried, metres: decimal, so that coordinates print short.
const SCALES_M: [f64; 8] = [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0];

/// Scale and offset that fit a box: the finest step from `finest_m` on, about the middle in whole metres.
///
/// `None` where even 10 m are too fine.
pub fn transforms_for(bounds: &Bounds, finest_m: f64) -> Option<Vector<Transform>> {
    let offset = bounds.centre().map(f64::round);
    let reach = (bounds.max - offset).amax().max((bounds.min - offset).amax());
    let fits = |scale: &&f64| **scale >= finest_m * 0.5 && reach / **scale < f64::from(i32::MAX);
    let scale = *SCALES_M.iter().find(fits)?;
    let axis = |offset| Transform { scale, offset };
    Some(Vector {
        x: axis(offset.x),
        y: axis(offset.y),
        z: axis(offset.z),
    })
}

/// Header of a new file: LAS 1.4, without a date, so that the same points give the same bytes.
pub fn export_header(
    has_color: bool,
    transforms: Vector<Transform>,
    extra_bytes: u16,
    descriptors: Vec<u8>,
) -> Builder {
    let mut builder = Builder::from((1, 4));
    builder.point_format = Format {
        has_gps_time: true,
        is_extended: true,
        has_color,
        extra_bytes,
        ..Format::default()
    };
    builder.transforms = transforms;
    builder.date = None;
    builder.system_identifier = "OTHER".to_owned();
    builder.generating_software = "stonewise".to_owned();
    if !descriptors.is_empty() {
        builder.vlrs.push(description_record(descriptors));
    }
    builder
}

/// The standard part of a point record.
pub struct Export {
    pub position: Point3<f64>,
    pub intensity: u16,
    pub color: Option<[u16; 3]>,
    pub source: u16,
    /// Seconds, of the kind that the header states.
    pub gps_time: f64,
}

impl Export {
    /// Appends the record in point format 7, or 6 without colour; the position must lie in the transform's
    /// box.
    pub fn append(&self, transforms: &Vector<Transform>, out: &mut Vec<u8>) {
        let axes = [&transforms.x, &transforms.y, &transforms.z];
        for (value, axis) in self.position.iter().zip(axes) {
            let steps = ((value - axis.offset) / axis.scale).round() as i32;
            out.extend(steps.to_le_bytes());
        }
        out.extend(self.intensity.to_le_bytes());
        // First of one return; no flags; class, user data and scan angle zero.
        out.extend([0x11, 0, 0, 0, 0, 0]);
        out.extend(self.source.to_le_bytes());
        out.extend(self.gps_time.to_le_bytes());
        for channel in self.color.into_iter().flatten() {
            out.extend(channel.to_le_bytes());
        }
    }
}
