//! The stones' faces as a coloured mesh for CloudCompare.

use super::face_colours::FaceColours;
use crate::{ResultSet, StoneColumn, column};
use nalgebra::Point2;
use stonewise_core::geometry::{FaceFrame, triangulate};
use stonewise_io::mesh_ply::ColouredMesh;

/// Columns of the stone table that the mesh carries.
const COLUMNS: [&str; 6] = ["stone_id", "d_along", "d_up", "d_out", "length_m", "lod95"];

/// Faces of all stones as triangles, coloured by the out-of-plane displacement; grey where it was not
/// measured.
pub(super) fn face_mesh(results: &ResultSet) -> ColouredMesh {
    let colours = FaceColours::new(&results.stones, &results.thresholds());
    let columns: Vec<&StoneColumn> = COLUMNS.iter().filter_map(|name| column(name)).collect();
    let mut mesh = ColouredMesh {
        scalars: columns.iter().map(|c| (c.name.to_owned(), Vec::new())).collect(),
        ..ColouredMesh::default()
    };

    for stone in &results.stones {
        let Some(outline) = results.outlines.get(&stone.stone_id) else {
            continue;
        };
        let frame = FaceFrame::from_normal(&outline.normal);
        let flat: Vec<Point2<f64>> = outline
            .ring
            .iter()
            .map(|p| p - outline.ring[0])
            .map(|d| Point2::new(d.dot(&frame.along), d.dot(&frame.up)))
            .collect();
        let first = mesh.vertices.len() as u32;
        mesh.triangles
            .extend(triangulate(&flat).iter().map(|t| t.map(|i| first + i as u32)));
        mesh.vertices.extend(&outline.ring);
        let colour = colours.of(Some(stone));
        mesh.colours.extend(outline.ring.iter().map(|_| colour));
        for ((_, values), column) in mesh.scalars.iter_mut().zip(&columns) {
            let value = column.number(stone).unwrap_or(f64::NAN) as f32;
            values.extend(outline.ring.iter().map(|_| value));
        }
    }

    mesh
}
