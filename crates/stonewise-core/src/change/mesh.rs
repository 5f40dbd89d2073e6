//! Triangle meshes.

use crate::geometry::Bounds;
use nalgebra::Point3;

/// A mesh of triangles whose corners run counterclockwise seen from outside.
#[derive(Clone, Debug, PartialEq)]
pub struct TriangleMesh {
    vertices: Vec<Point3<f64>>,
    triangles: Vec<[u32; 3]>,
}

/// Why a mesh cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MeshError {
    /// A corner names a vertex that does not exist.
    #[error("face {face} uses vertex {vertex}, the mesh has {vertices} vertices")]
    NoSuchVertex {
        /// Which face, from 0.
        face: usize,
        /// The vertex it names.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// Nothing to measure a distance to.
    #[error("the mesh has no face with an area: give a surface mesh, not a cloud")]
    NoFaces,
}

impl TriangleMesh {
    /// A mesh from vertices, metres, world frame, and triangles of vertex indices.
    ///
    /// Triangles without a finite area are left out. Larger polygons must be cut into triangles before.
    ///
    /// # Errors
    /// A triangle names a vertex that does not exist, or no triangle has an area.
    pub fn new(vertices: Vec<Point3<f64>>, triangles: Vec<[u32; 3]>) -> Result<Self, MeshError> {
        for (face, corners) in triangles.iter().enumerate() {
            if let Some(&vertex) = corners.iter().find(|&&v| v as usize >= vertices.len()) {
                return Err(MeshError::NoSuchVertex {
                    face,
                    vertex,
                    vertices: vertices.len(),
                });
            }
        }
        let has_area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| vertices[v as usize]);
            let area = (b - a).cross(&(c - a)).norm();
            area > 0.0 && area.is_finite()
        };
        let triangles: Vec<_> = triangles.into_iter().filter(has_area).collect();
        if triangles.is_empty() {
            return Err(MeshError::NoFaces);
        }
        Ok(Self { vertices, triangles })
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: usize) -> [Point3<f64>; 3] {
        self.triangles[triangle].map(|v| self.vertices[v as usize])
    }

    /// Box around all triangles.
    pub fn bounds(&self) -> Bounds {
        let corners = (0..self.triangles.len()).flat_map(|t| self.corners(t));
        Bounds::of(corners).unwrap_or(Bounds {
            min: Point3::origin(),
            max: Point3::origin(),
        })
    }

    /// All vertices.
    pub fn vertices(&self) -> &[Point3<f64>] {
        &self.vertices
    }

    /// All triangles with an area, as vertex indices.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }
}
