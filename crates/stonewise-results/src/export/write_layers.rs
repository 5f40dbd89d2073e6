//! Writes every layer from result files.

use super::drawing::draw;
use super::face_mesh::face_mesh;
use super::layers::layers;
use super::polygons::{centroids, face_polygons};
use crate::ResultSet;
use crate::names::{DISPLACEMENTS_VTP, DRAWING, FACES_PLY, FACES_VTP, GEOPACKAGE, GEOPARQUET};
use crate::records::Timestamp;
use std::path::Path;
use stonewise_base::error::Error;
use stonewise_io::dxf::{Drawing, write_dxf};
use stonewise_io::layers::{write_geopackage, write_geoparquet, write_vtp};
use stonewise_io::mesh_ply::write_coloured_mesh;

/// Makes `stones.gpkg`, and in `data` `stones.geo.parquet`, `stones.vtp`, `displacements.vtp`, `stones.ply`
/// and `stones.dxf`, from the result files in `dir`.
///
/// The GeoPackage has the stones in the world frame (`stones`), unrolled (`stones_facade`), their
/// displacements as exaggerated lines in both (`displacements`, `displacements_facade`), and the joints
/// between them (`joints`, `joints_facade`), each with styles for QGIS, and, where the wall deformed, the
/// outlines of the zones (`zones`, `zones_facade`). The VTK files hold the stones as
/// polygons and their centroids with the displacements as vectors, for ParaView. The PLY is a mesh of the
/// stones' faces, coloured by the out-of-plane displacement, with all components as scalars. The DXF is
/// the unrolled wall for CAD, with layers for each epoch and state. With more than two epochs, the GeoPackage has the
/// layers of the third against the first as `stones_2` and so on, and the DXF has all; the other files are of the second
/// epoch. Its time stamps are the date of the latest survey, else the day on
/// which the latest cloud was written, so that the same inputs give the same bytes; 1 January 1970 where
/// neither is known.
///
/// # Errors
/// `dir` has no stone table, a result file is damaged, or a file cannot be written.
pub fn write_layers(dir: &Path) -> Result<(), Error> {
    let results = ResultSet::read(dir)?;
    let mut layers = layers(&results)?;
    let mut drawing = Drawing::default();
    draw(&mut drawing, &results);
    for pair in 2..=results.pairs {
        let later = ResultSet::read_pair(dir, pair)?;
        layers.extend(self::layers(&later)?);
        draw(&mut drawing, &later);
    }
    write_geopackage(&dir.join(GEOPACKAGE), &layers, &surveyed(&results).to_string())?;
    if let Some(world) = layers.first() {
        write_geoparquet(&dir.join(GEOPARQUET), world)?;
    }
    for (name, data) in [
        (FACES_VTP, face_polygons(&results)),
        (DISPLACEMENTS_VTP, centroids(&results)),
    ] {
        let path = dir.join(name);
        write_vtp(&path, &data).map_err(Error::io("writing polygons", &path))?;
    }
    let mesh = dir.join(FACES_PLY);
    write_coloured_mesh(&mesh, &face_mesh(&results)).map_err(Error::io("writing the mesh", &mesh))?;
    let path = dir.join(DRAWING);
    write_dxf(&path, &drawing).map_err(Error::io("writing the drawing", &path))?;
    Ok(())
}

/// Midnight of the latest date that the project states, else of the latest that a cloud carries.
fn surveyed(results: &ResultSet) -> Timestamp {
    let epochs = || results.run.iter().flat_map(|run| &run.epochs);
    let stated = epochs().filter_map(|epoch| epoch.date.as_deref()).max();
    let clouds = epochs().flat_map(|epoch| &epoch.clouds);
    let latest = stated.or_else(|| clouds.filter_map(|cloud| cloud.written.as_deref()).max());
    let midnight = latest.and_then(|day| format!("{day}T00:00:00.000Z").parse().ok());
    midnight.unwrap_or(Timestamp::EPOCH)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{folder, rows};
    use crate::{STONE_COLUMNS, StoneRow, write_stones};
    use serde_json::Value;
    use stonewise_io::layers::read_polygons;
    use stonewise_io::table::read_parquet;

    #[test]
    fn all_layers_are_written_again_with_the_same_bytes() {
        let folder = folder(&rows());
        let names = [
            "stones.gpkg",
            "data/stones.geo.parquet",
            "data/stones.ply",
            "data/stones.csv-metadata.json",
            "data/stones.vtp",
            "data/displacements.vtp",
            "data/stones.dxf",
        ];
        let bytes = || {
            write_layers(folder.path()).unwrap();
            names.map(|n| std::fs::read(folder.path().join(n)).unwrap())
        };
        let first = bytes();
        assert!(first == bytes(), "bytes differ");
        let table = read_parquet(&folder.path().join(GEOPARQUET)).unwrap();
        let states = table.required::<String>("status").unwrap();
        assert_eq!((states.len(), states[2].as_str()), (24, "unmatched_lost"));
        assert_eq!(table.optional::<f64>("d_out").unwrap()[2], None);
        let notes: Value = serde_json::from_slice(&first[3]).unwrap();
        assert_eq!(
            notes["tableSchema"]["columns"].as_array().unwrap().len(),
            STONE_COLUMNS.len()
        );
    }

    #[test]
    fn a_run_without_stones_or_motions_has_layers_too() {
        let stones = |rows: &[StoneRow]| {
            let folder = folder(rows);
            write_layers(folder.path()).unwrap();
            let table = read_parquet(&folder.path().join(GEOPARQUET)).unwrap();
            let polygons = read_polygons(&folder.path().join(GEOPACKAGE), "stones").unwrap();
            assert_eq!(polygons.len(), rows.len());
            let vtp = std::fs::read_to_string(folder.path().join(DISPLACEMENTS_VTP)).unwrap();
            assert!(vtp.contains("NumberOfPoints=\"0\""), "no stone was measured");
            table.optional::<f64>("d_out").unwrap()
        };
        assert_eq!(stones(&[]), []);
        let mut unmatched = rows();
        unmatched.iter_mut().for_each(|r| r.motion = None);
        assert_eq!(stones(&unmatched), [None; 24]);
    }

    #[test]
    fn further_epochs_are_written_too() {
        let folder = folder(&rows());
        write_stones(folder.path(), 2, &rows()[..5]).unwrap();
        write_layers(folder.path()).unwrap();
        let package = folder.path().join(GEOPACKAGE);
        let stones = |layer: &str| read_polygons(&package, layer).unwrap().len();
        assert_eq!((stones("stones"), stones("stones_2")), (24, 5));
    }
}
