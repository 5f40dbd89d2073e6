//! VTK XML polygonal data (`.vtp`), for ParaView.
//!
//! Format: "VTK XML file formats", version 1.0, arrays inline as base64 of an unsigned 64-bit byte count and
//! the data, little-endian, uncompressed.

use crate::atomic::write_atomically;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::Point3;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Polygons, or single points where there are none, with numbers.
#[derive(Clone, Debug, Default)]
pub struct PolyData {
    /// World coordinates.
    pub points: Vec<Point3<f64>>,
    /// Corners of each polygon, counter-clockwise; empty: every point is a cell of its own.
    pub polygons: Vec<Vec<u32>>,
    /// One value for each polygon (or point).
    pub scalars: Vec<(String, Vec<f64>)>,
    /// One vector for each polygon (or point).
    pub vectors: Vec<(String, Vec<[f64; 3]>)>,
}

/// Writes a `.vtp` file; values that are not known are NaN, which ParaView shows in a colour of its own.
///
/// # Errors
/// Columns differ in length, a polygon names a point that is not there, or the file cannot be written; an
/// earlier file is kept then.
pub fn write_vtp(path: &Path, data: &PolyData) -> io::Result<()> {
    let points = data.points.len();
    let cells = if data.polygons.is_empty() {
        points
    } else {
        data.polygons.len()
    };
    let even = data.scalars.iter().all(|(_, v)| v.len() == cells)
        && data.vectors.iter().all(|(_, v)| v.len() == cells);

    if !even || data.polygons.iter().flatten().any(|&i| i as usize >= points) {
        let message = format!(
            "the columns of polygonal data do not fit together: {}",
            path.display()
        );
        return Err(io::Error::new(io::ErrorKind::InvalidInput, message));
    }

    let corners: Vec<Vec<u32>> = if data.polygons.is_empty() {
        (0..points as u32).map(|i| vec![i]).collect()
    } else {
        data.polygons.clone()
    };
    let (verts, polys) = if data.polygons.is_empty() {
        (cells, 0)
    } else {
        (0, cells)
    };

    write_atomically(path, |partial| {
        let mut out = BufWriter::new(File::create(partial)?);
        writeln!(out, "<?xml version=\"1.0\"?>")?;
        writeln!(
            out,
            "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>"
        )?;
        writeln!(
            out,
            "<Piece NumberOfPoints=\"{points}\" NumberOfVerts=\"{verts}\" NumberOfLines=\"0\" NumberOfStrips=\"0\" \
             NumberOfPolys=\"{polys}\">\n<Points>"
        )?;
        floats(
            &mut out,
            "Points",
            3,
            data.points.iter().flat_map(|p| p.iter().copied()),
        )?;
        let kind = if polys > 0 { "Polys" } else { "Verts" };
        writeln!(out, "</Points>\n<{kind}>")?;
        let ends = corners.iter().scan(0i64, |end, c| {
            *end += c.len() as i64;
            Some(*end)
        });
        integers(
            &mut out,
            "connectivity",
            corners.iter().flatten().map(|&i| i64::from(i)),
        )?;
        integers(&mut out, "offsets", ends)?;
        writeln!(out, "</{kind}>\n<CellData>")?;
        for (name, values) in &data.scalars {
            floats(&mut out, name, 1, values.iter().copied())?;
        }
        for (name, values) in &data.vectors {
            floats(&mut out, name, 3, values.iter().flatten().copied())?;
        }
        writeln!(out, "</CellData>\n</Piece>\n</PolyData>\n</VTKFile>")?;
        out.flush()
    })
}

fn floats(
    out: &mut impl Write,
    name: &str,
    components: usize,
    values: impl Iterator<Item = f64>,
) -> io::Result<()> {
    array(
        out,
        "Float64",
        name,
        components,
        values.flat_map(f64::to_le_bytes).collect(),
    )
}

fn integers(out: &mut impl Write, name: &str, values: impl Iterator<Item = i64>) -> io::Result<()> {
    array(out, "Int64", name, 1, values.flat_map(i64::to_le_bytes).collect())
}

/// `name`: letters, digits and underscores only.
fn array(out: &mut impl Write, kind: &str, name: &str, components: usize, bytes: Vec<u8>) -> io::Result<()> {
    let mut all = (bytes.len() as u64).to_le_bytes().to_vec();
    all.extend(bytes);
    writeln!(
        out,
        "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"binary\">{}</DataArray>",
        STANDARD.encode(all)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes of a named array, without their count.
    fn bytes(text: &str, name: &str) -> Vec<u8> {
        let rest = &text[text.find(&format!("Name=\"{name}\"")).unwrap()..];
        let body = &rest[rest.find('>').unwrap() + 1..rest.find("</DataArray>").unwrap()];
        let all = STANDARD.decode(body).unwrap();
        let count = u64::from_le_bytes(all[..8].try_into().unwrap());
        assert_eq!(count as usize, all.len() - 8);
        all[8..].to_vec()
    }

    fn whole(bytes: &[u8]) -> Vec<i64> {
        let numbers = bytes.chunks(8);
        numbers
            .map(|c| i64::from_le_bytes(c.try_into().unwrap()))
            .collect()
    }

    #[test]
    fn a_triangle_and_a_square_are_two_cells() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vtp");
        let p = Point3::new;
        let mut data = PolyData {
            points: vec![
                p(0.0, 0.0, 0.0),
                p(1.0, 0.0, 0.0),
                p(1.0, 1.0, 0.0),
                p(0.0, 1.0, 5.5),
            ],
            polygons: vec![vec![0, 1, 2], vec![0, 1, 2, 3]],
            scalars: vec![("d_out".into(), vec![0.5, f64::NAN])],
            vectors: vec![("displacement".into(), vec![[1.0, 2.0, 3.0], [0.0; 3]])],
        };
        write_vtp(&path, &data).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.contains("NumberOfPoints=\"4\" NumberOfVerts=\"0\"") && text.contains("NumberOfPolys=\"2\"")
        );
        // Every element that opens is closed, as an XML reader sees it.
        assert!(crate::xml::parse(&text).is_ok());
        assert_eq!(whole(&bytes(&text, "connectivity")), [0, 1, 2, 0, 1, 2, 3]);
        assert_eq!(whole(&bytes(&text, "offsets")), [3, 7]);
        assert_eq!(bytes(&text, "Points")[88..], 5.5f64.to_le_bytes());
        assert_eq!(bytes(&text, "d_out").len(), 16);
        assert_eq!(bytes(&text, "displacement")[16..24], 3f64.to_le_bytes());
        data.polygons.push(vec![9]);
        assert!(write_vtp(&path, &data).is_err());
    }

    #[test]
    fn points_alone_are_cells() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.vtp");
        let points = (0..3).map(|i| Point3::new(f64::from(i), 0.0, 0.0)).collect();
        write_vtp(
            &path,
            &PolyData {
                points,
                ..PolyData::default()
            },
        )
        .unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("NumberOfVerts=\"3\"") && text.contains("<Verts>"));
        assert_eq!(whole(&bytes(&text, "connectivity")), [0, 1, 2]);
        assert_eq!(whole(&bytes(&text, "offsets")), [1, 2, 3]);
    }
}
