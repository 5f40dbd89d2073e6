//! Features as ISO well-known binary, little-endian, and as GeoPackage geometry blobs, which put a header with the
//! envelope before it.

use super::Geometry;
use nalgebra::Point3;

impl Geometry {
    /// Name in `gpkg_geometry_columns`.
    pub(super) fn type_name(self) -> &'static str {
        match self {
            Self::PolygonZ | Self::Polygon => "POLYGON",
            Self::LineStringZ | Self::LineString => "LINESTRING",
        }
    }

    /// Whether z is kept.
    pub(super) fn has_z(self) -> bool {
        matches!(self, Self::PolygonZ | Self::LineStringZ)
    }

    fn is_ring(self) -> bool {
        matches!(self, Self::PolygonZ | Self::Polygon)
    }

    /// Fewest vertices of a feature.
    fn least(self) -> usize {
        if self.is_ring() { 3 } else { 2 }
    }

    /// ISO WKB code.
    fn code(self) -> u32 {
        let flat = if self.is_ring() { 3 } else { 2 };
        if self.has_z() { 1000 + flat } else { flat }
    }
}

/// A feature's blob and its envelope (min x, max x, min y, max y); `None` where it has too few finite
/// vertices.
pub(super) fn encode(kind: Geometry, srs: i32, vertices: &[Point3<f64>]) -> Option<(Vec<u8>, [f64; 4])> {
    let binary = well_known_binary(kind, vertices)?;
    let fold = |of: fn(f64, f64) -> f64, axis: usize| vertices.iter().map(|p| p[axis]).reduce(of);
    let envelope = [
        fold(f64::min, 0)?,
        fold(f64::max, 0)?,
        fold(f64::min, 1)?,
        fold(f64::max, 1)?,
    ];
    // Magic, version 0, flags: little-endian, envelope in x and y.
    let mut blob = vec![b'G', b'P', 0, 0b0000_0011];
    blob.extend(srs.to_le_bytes());
    blob.extend(envelope.iter().flat_map(|v| v.to_le_bytes()));
    blob.extend(binary);
    Some((blob, envelope))
}

/// A feature as ISO well-known binary; `None` where it has too few finite vertices.
pub(super) fn well_known_binary(kind: Geometry, vertices: &[Point3<f64>]) -> Option<Vec<u8>> {
    let finite = vertices.iter().all(|p| p.iter().all(|v| v.is_finite()));
    if vertices.len() < kind.least() || !finite {
        return None;
    }
    let mut binary = vec![1];
    binary.extend(kind.code().to_le_bytes());
    let closing = kind.is_ring().then(|| vertices[0]);
    if kind.is_ring() {
        binary.extend(1u32.to_le_bytes());
    }
    let count = vertices.len() + usize::from(closing.is_some());
    binary.extend(u32::try_from(count).ok()?.to_le_bytes());
    for p in vertices.iter().chain(&closing) {
        let axes = if kind.has_z() { 3 } else { 2 };
        binary.extend(p.iter().take(axes).flat_map(|v| v.to_le_bytes()));
    }
    Some(binary)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_is_laid_out_as_the_standard_says() {
        let p = Point3::new;
        let (blob, envelope) = encode(
            Geometry::PolygonZ,
            -1,
            &[p(1.0, 2.0, 3.0), p(4.0, 2.0, 3.0), p(4.0, 6.0, 5.0)],
        )
        .unwrap();
        assert_eq!(envelope, [1.0, 4.0, 2.0, 6.0]);
        assert_eq!(&blob[..8], [b'G', b'P', 0, 3, 255, 255, 255, 255]);
        assert_eq!(&blob[40..53], [1, 235, 3, 0, 0, 1, 0, 0, 0, 4, 0, 0, 0]);
        assert_eq!(blob.len(), 53 + 4 * 24);
        assert_eq!(&blob[53..61], 1f64.to_le_bytes());
        assert_eq!(&blob[blob.len() - 24..], &blob[53..77]);
        let (line, _) = encode(Geometry::LineString, 7, &[p(1.0, 2.0, 3.0), p(4.0, 2.0, 3.0)]).unwrap();
        assert_eq!(&line[40..49], [1, 2, 0, 0, 0, 2, 0, 0, 0]);
        assert_eq!(line.len(), 49 + 2 * 16);
    }

    #[test]
    fn too_few_or_infinite_vertices_are_no_feature() {
        let p = Point3::new(1.0, 2.0, 3.0);
        assert!(encode(Geometry::Polygon, -1, &[p, p]).is_none());
        assert!(encode(Geometry::LineStringZ, -1, &[p, p * f64::NAN]).is_none());
    }
}
