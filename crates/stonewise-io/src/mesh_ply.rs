//! Coloured triangle meshes as binary PLY.

use crate::atomic::write_atomically;
use nalgebra::Point3;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// A mesh whose vertices carry a colour and numbers; all columns have the length of `vertices`.
#[derive(Clone, Debug, Default)]
pub struct ColouredMesh {
    /// World coordinates.
    pub vertices: Vec<Point3<f64>>,
    /// sRGB colour of each vertex.
    pub colours: Vec<[u8; 3]>,
    /// Further numbers of each vertex with their names.
    pub scalars: Vec<(String, Vec<f32>)>,
    /// Corners of each triangle, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
}

/// Writes a mesh as binary little-endian PLY, coordinates as doubles.
///
/// Scalars are named `scalar_NAME`, which CloudCompare shows as scalar fields.
///
/// # Errors
/// Columns differ in length, a triangle names a vertex that is not there, or the file cannot be written; an
/// earlier file is kept then.
pub fn write_coloured_mesh(path: &Path, mesh: &ColouredMesh) -> io::Result<()> {
    let n = mesh.vertices.len();
    let even = mesh.colours.len() == n && mesh.scalars.iter().all(|(_, v)| v.len() == n);
    let inside = mesh.triangles.iter().flatten().all(|&i| (i as usize) < n);
    if !even || !inside {
        let message = format!("the columns of a mesh do not fit together: {}", path.display());
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    }
    write_atomically(path, |partial| {
        let mut out = BufWriter::new(File::create(partial)?);
        write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {n}\n")?;
        write!(out, "property double x\nproperty double y\nproperty double z\n")?;
        write!(
            out,
            "property uchar red\nproperty uchar green\nproperty uchar blue\n"
        )?;
        for (name, _) in &mesh.scalars {
            writeln!(out, "property float scalar_{name}")?;
        }
        write!(
            out,
            "element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
            mesh.triangles.len()
        )?;
        for i in 0..n {
            for v in mesh.vertices[i].iter() {
                out.write_all(&v.to_le_bytes())?;
            }
            out.write_all(&mesh.colours[i])?;
            for (_, values) in &mesh.scalars {
                out.write_all(&values[i].to_le_bytes())?;
            }
        }
        for triangle in &mesh.triangles {
            out.write_all(&[3])?;
            for corner in triangle {
                out.write_all(&corner.to_le_bytes())?;
            }
        }
        out.flush()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_says_what_follows() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ply");
        let p = Point3::new;
        let mut mesh = ColouredMesh {
            vertices: vec![p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.0, 1.0, 0.0)],
            colours: vec![[1, 2, 3]; 3],
            scalars: vec![("d_out".into(), vec![0.5; 3])],
            triangles: vec![[0, 1, 2]],
        };
        write_coloured_mesh(&path, &mesh).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        assert_eq!(bytes.len() - end, 3 * (24 + 3 + 4) + 13);
        assert_eq!(&bytes[end + 24..end + 27], [1, 2, 3]);
        // What the header says of it, in the words of the format (Turk 1994).
        let header: Vec<&str> = std::str::from_utf8(&bytes[..end]).unwrap().lines().collect();
        let vertex = [
            "double x",
            "double y",
            "double z",
            "uchar red",
            "uchar green",
            "uchar blue",
            "float scalar_d_out",
        ];
        let mut expected = vec![
            "ply".to_owned(),
            "format binary_little_endian 1.0".into(),
            "element vertex 3".into(),
        ];
        expected.extend(vertex.map(|property| format!("property {property}")));
        expected.push("element face 1".into());
        expected.push("property list uchar uint vertex_indices".into());
        expected.push("end_header".into());
        assert_eq!(header, expected);
        let read = crate::cloud::read_mesh(&path).unwrap();
        assert_eq!(
            (read.vertices(), read.triangles()),
            (&mesh.vertices[..], &mesh.triangles[..])
        );
        mesh.triangles.push([0, 1, 3]);
        assert!(write_coloured_mesh(&path, &mesh).is_err());
    }
}
