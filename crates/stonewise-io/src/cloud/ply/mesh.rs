//! Faces.

use std::path::Path;

use nalgebra::Point3;
use stonewise_core::change::TriangleMesh;

use super::header::{Element, Header, Kind};
use super::read::{Columns, Values};
use crate::cloud::CloudError;
use crate::cloud::lines::Lines;

/// Reads the surface mesh of a PLY file (ascii or binary) into memory.
///
/// Faces are lists named `vertex_indices` or `vertex_index`; polygons are cut into triangles that share their
/// first corner, which is right for convex ones. Corners run counterclockwise seen from outside.
///
/// # Errors
/// The file cannot be read, is damaged or cut off, or has no faces.
pub fn read_mesh(path: &Path) -> Result<TriangleMesh, CloudError> {
    let mut lines = Lines::open(path)?;
    let header = Header::read(&mut lines)?;
    let has_faces = header.elements.iter().any(|e| face_list(e).is_some());

    if !has_faces {
        let reason =
            "the ply header has no element face with a list vertex_indices: give a mesh, not a cloud";
        return Err(CloudError::malformed(path, reason));
    }

    header.check_room(header.elements.len(), lines.bytes_left()?, path)?;
    let mut values = Values::after_header(lines, header.encoding);
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    let (mut row, mut corners) = (Vec::new(), Vec::new());

    for element in &header.elements {
        let columns = Columns::find(element).filter(|_| element.name == "vertex");
        let list = face_list(element);
        for index in 0..element.count {
            corners.clear();
            let keep = &mut |place, corner: f64| {
                if Some(place) == list {
                    corners.push(corner);
                }
            };
            if !values.next_with_items(path, element, &mut row, keep)? {
                let reason = format!("it holds {index} of {} elements {}", element.count, element.name);
                return Err(CloudError::truncated(path, reason));
            }
            if let Some(columns) = &columns {
                vertices.push(Point3::from(columns.position.map(|place| row[place])));
            }
            for pair in corners.get(1..).unwrap_or_default().windows(2) {
                triangles.push([corners[0], pair[0], pair[1]].map(to_index));
            }
        }
    }

    TriangleMesh::new(vertices, triangles).map_err(|e| CloudError::malformed(path, e.to_string()))
}

/// Place of the list of corners among the properties of a face.
fn face_list(element: &Element) -> Option<usize> {
    let is_list = |name: &str| matches!(name, "vertex_indices" | "vertex_index");
    let properties = || element.properties.iter();
    properties()
        .position(|p| is_list(&p.name) && matches!(p.kind, Kind::List { .. }))
        .filter(|_| element.name == "face")
}

/// No mesh has a vertex of the number that stands for what is not an index.
fn to_index(corner: f64) -> u32 {
    if corner >= 0.0 { corner as u32 } else { u32::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(bytes: &[u8]) -> Result<TriangleMesh, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        read_mesh(file.path()).map_err(|e| e.to_string())
    }

    const HEADER: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        element face 2\nproperty uchar quality\nproperty list uchar int vertex_indices\nend_header\n";

    fn text(faces: &str) -> String {
        format!("ply\nformat ascii 1.0\n{HEADER}0 0 0\n1 0 0\n1 2 0\n0 2 0.5\n{faces}")
    }

    fn binary(big_endian: bool) -> Vec<u8> {
        let name = if big_endian { "big" } else { "little" };
        let mut bytes = format!("ply\nformat binary_{name}_endian 1.0\n{HEADER}").into_bytes();
        let mut number = |raw: [u8; 4]| {
            let mut raw = raw;
            if big_endian {
                raw.reverse();
            }
            bytes.extend(raw);
        };
        for c in [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 2.0, 0.5] {
            number(c.to_le_bytes());
        }
        for face in [&[0i32, 1, 2, 3][..], &[3, 1, 0]] {
            bytes.extend([9, face.len() as u8]);
            for c in face {
                let raw = if big_endian {
                    c.to_be_bytes()
                } else {
                    c.to_le_bytes()
                };
                bytes.extend(raw);
            }
        }
        bytes
    }

    #[test]
    fn polygons_become_triangles_in_every_encoding() {
        let ascii = read(text("9 4 0 1 2 3\n9 3 3 1 0\n").as_bytes()).unwrap();
        assert_eq!(ascii.triangles(), [[0, 1, 2], [0, 2, 3], [3, 1, 0]]);
        assert_eq!(ascii.vertices()[3], Point3::new(0.0, 2.0, 0.5));
        assert_eq!(read(&binary(false)).unwrap(), ascii);
        assert_eq!(read(&binary(true)).unwrap(), ascii);
    }

    #[test]
    fn damaged_meshes_and_clouds_are_refused_with_a_reason() {
        assert!(
            read(text("9 4 0 1 2 3\n").as_bytes())
                .unwrap_err()
                .contains("1 of 2 elements face")
        );
        assert!(
            read(text("9 3 0 1 7\n9 3 0 1 2\n").as_bytes())
                .unwrap_err()
                .contains("vertex 7")
        );
        assert!(read(text("9 3 0 1 -1\n9 3 0 1 2\n").as_bytes()).is_err());
        let cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0 0 0\n";
        assert!(read(cloud.as_bytes()).unwrap_err().contains("not a cloud"));
        let mut short = binary(false);
        short.truncate(short.len() - 3);
        assert!(read(&short).unwrap_err().contains("cut off"));
    }
}
