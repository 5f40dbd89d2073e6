//! Results as layers for the tools that engineers already use.

use super::column_notes::column_notes;
use super::draw::{Scale, component_limit_m, component_limit_of, nice_scale_m};
use super::joints::{Joint, JointMotion, joints};
use super::layer_style::{arrow_style, line_style, stone_style};
use super::stone_table::stone_table;
use super::summary::Summary;
use super::{ReportError, ResultSet, RowMotion, StoneOutline, StoneRow};
use nalgebra::{Point2, Point3};
use serde_json::Value;
use std::path::Path;
use stonewise_core::geometry::{FaceFrame, triangulate};
use stonewise_io::atomic::write_atomically;
use stonewise_io::layers::{
    Crs, Geometry, Layer, LayerStyle, PolyData, write_geojson, write_geopackage, write_vtp,
};
use stonewise_io::mesh_ply::{ColouredMesh, write_coloured_mesh};
use stonewise_io::table::{Table, TableError};

/// Colour of what was not measured.
const UNKNOWN: [u8; 3] = [150; 3];

/// Makes `stones.gpkg`, `stones.geojson`, `stones.vtp`, `displacements.vtp`, `stones.ply` and `stones.csv-metadata.json` from
/// the result files in `dir`.
///
/// The GeoPackage has the stones in the world frame (`stones`), unrolled (`stones_facade`), their displacements as
/// exaggerated lines in both (`displacements`, `displacements_facade`), and the joints between them (`joints`,
/// `joints_facade`), each with styles for QGIS. The VTK files hold the stones as polygons and their centroids with the
/// displacements as vectors, for ParaView. The PLY is a mesh
/// of the stones' faces, coloured by the out-of-plane displacement, with all components as scalars. The sidecar names
/// the unit and meaning of every column of stones.csv (W3C CSV on the Web). With more than two epochs, the GeoPackage
/// has the layers of the third against the first as `stones_2` and so on; the other files are of the second epoch.
///
/// # Errors
/// `dir` has no stone table, a result file is damaged, or a file cannot be written.
pub fn write_layers(dir: &Path) -> Result<(), ReportError> {
    let results = ResultSet::read(dir)?;
    let facts = Summary::new(&results);
    let mut layers = layers(&results, &facts)?;
    for pair in 2..=results.pairs {
        let later = ResultSet::read_pair(dir, pair)?;
        layers.extend(self::layers(&later, &Summary::new(&later))?);
    }
    let stamp = results
        .run
        .get("finished")
        .and_then(Value::as_str)
        .unwrap_or("1970-01-01T00:00:00.000Z");
    write_geopackage(&dir.join("stones.gpkg"), &layers, stamp)?;
    if let Some(world) = layers.first() {
        write_geojson(&dir.join("stones.geojson"), world)?;
    }
    for (name, data) in [
        ("stones.vtp", face_polygons(&results)),
        ("displacements.vtp", centroids(&results, &facts)),
    ] {
        let path = dir.join(name);
        write_vtp(&path, &data).map_err(ReportError::io("writing polygons", &path))?;
    }
    let mesh = dir.join("stones.ply");
    write_coloured_mesh(&mesh, &face_mesh(&results)).map_err(ReportError::io("writing the mesh", &mesh))?;
    let notes = dir.join("stones.csv-metadata.json");
    write_atomically(&notes, |partial| std::fs::write(partial, column_notes()))
        .map_err(ReportError::io("writing the notes on columns", &notes))
}

/// The layers of the GeoPackage; the first is that of the world frame.
fn layers(results: &ResultSet, facts: &Summary) -> Result<Vec<Layer>, TableError> {
    let rows: Vec<StoneRow> = results.stones.clone();
    let styles = styles(facts);
    let crs = crs(&results.run);
    let world = |s: &StoneRow| {
        results
            .outlines
            .get(&s.stone_id)
            .map_or(Vec::new(), StoneOutline::seen_from_above)
    };
    let flat = |p: Point2<f64>| Point3::new(p.x, p.y, 0.0);
    let facade = |s: &StoneRow| results.unrolled(s).into_iter().map(flat).collect();
    let numbered = |name: &str| {
        if results.pair == 1 {
            name.to_owned()
        } else {
            format!("{name}_{}", results.pair)
        }
    };
    let titled = |title: &str| {
        if results.pair == 1 {
            title.to_owned()
        } else {
            format!("{title}, epoch {}", results.pair + 1)
        }
    };
    let polygons = |name: &str, title: &str, geometry, crs, vertices| {
        Ok::<_, TableError>(Layer {
            name: numbered(name),
            title: titled(title),
            description: "one feature per stone of the first epoch; columns as in stones.csv, metres".into(),
            geometry,
            crs,
            attributes: stone_table(&rows)?,
            vertices,
            styles: styles.clone(),
        })
    };
    let factor = exaggeration(results, facts);
    let all_joints = joints(results);
    let moved: Vec<(&StoneRow, &RowMotion)> = facts
        .measured
        .iter()
        .copied()
        .filter(|(s, m)| {
            s.centroid
                .iter()
                .chain(m.displacement.iter())
                .all(|v| v.is_finite())
        })
        .collect();
    let arrow = |(s, m): &(&StoneRow, &RowMotion)| vec![s.centroid, s.centroid + m.displacement * factor];
    let unrolled_arrow = |(s, m): &(&StoneRow, &RowMotion)| {
        let from = results.facade.place(&s.centroid);
        vec![flat(from), flat(from + m.face.xy() * factor)]
    };
    let lines = |name: &str, title: &str, geometry, crs, vertices| {
        Ok::<_, TableError>(Layer {
            name: numbered(name),
            title: titled(title),
            description: format!("displacements of the measured stones, {factor} times exaggerated"),
            geometry,
            crs,
            attributes: motion_table(&moved, factor)?,
            vertices,
            styles: vec![arrow_style()],
        })
    };
    Ok(vec![
        polygons(
            "stones",
            "Stones",
            Geometry::PolygonZ,
            crs.clone(),
            results.stones.iter().map(world).collect(),
        )?,
        polygons(
            "stones_facade",
            "Stones, unrolled (along, up)",
            Geometry::Polygon,
            None,
            results.stones.iter().map(facade).collect(),
        )?,
        lines(
            "displacements",
            "Displacements",
            Geometry::LineStringZ,
            crs.clone(),
            moved.iter().map(arrow).collect(),
        )?,
        lines(
            "displacements_facade",
            "Displacements, unrolled",
            Geometry::LineString,
            None,
            moved.iter().map(unrolled_arrow).collect(),
        )?,
        joint_layer(
            &numbered("joints"),
            &titled("Joints"),
            Geometry::LineStringZ,
            crs,
            &all_joints,
            results,
            |j| j.world.to_vec(),
        )?,
        joint_layer(
            &numbered("joints_facade"),
            &titled("Joints, unrolled"),
            Geometry::LineString,
            None,
            &all_joints,
            results,
            |j| j.line.map(flat).to_vec(),
        )?,
    ])
}

/// The joints as lines; their motions are empty where a stone was not measured.
fn joint_layer(
    name: &str,
    title: &str,
    geometry: Geometry,
    crs: Option<Crs>,
    joints: &[Joint],
    results: &ResultSet,
    line: impl Fn(&Joint) -> Vec<Point3<f64>>,
) -> Result<Layer, TableError> {
    let mut table = Table::new();
    for (k, column) in ["stone_1", "stone_2"].into_iter().enumerate() {
        let id = |j: &Joint| results.stones[j.stones[k]].stone_id;
        table.push(column, joints.iter().map(id).collect::<Vec<u32>>())?;
    }
    table.push("width", joints.iter().map(|j| j.width_m).collect::<Vec<f64>>())?;
    let of = |pick: fn(&JointMotion) -> f64| -> Vec<Option<f64>> {
        joints.iter().map(|j| j.motion.as_ref().map(pick)).collect()
    };
    table.push("opening", of(|m| m.opening_m))?;
    table.push("sliding", of(|m| m.sliding_m))?;
    table.push("step_out", of(|m| m.step_m))?;
    table.push("sigma_opening", of(|m| m.opening_sigma_m))?;
    let significant = joints
        .iter()
        .map(|j| j.motion.as_ref().map(|m| u8::from(m.is_significant())));
    table.push("significant", significant.collect::<Vec<Option<u8>>>())?;
    let openings = joints.iter().filter_map(|j| j.motion).map(|m| m.opening_m.abs());
    Ok(Layer {
        name: name.to_owned(),
        title: title.to_owned(),
        description:
            "joints between neighbouring stones; opening across, sliding along, step out of the face, metres"
                .into(),
        geometry,
        crs,
        attributes: table,
        vertices: joints.iter().map(line).collect(),
        styles: vec![line_style(
            "Joint opening",
            "opening",
            Scale::Diverging(nice_scale_m(openings)),
        )],
    })
}

fn styles(facts: &Summary) -> Vec<LayerStyle> {
    let shared = Scale::Diverging(component_limit_m(facts));
    let limit = Scale::Sequential(nice_scale_m(facts.limits.values().iter().copied()));
    vec![
        stone_style("Out of the wall", "d_out", shared, true),
        stone_style("Along the wall", "d_along", shared, true),
        stone_style("Up the face", "d_up", shared, true),
        stone_style("Detection limit", "lod95", limit, false),
    ]
}

fn motion_table(moved: &[(&StoneRow, &RowMotion)], factor: f64) -> Result<Table, TableError> {
    let mut table = Table::new();
    let real = |of: fn(&RowMotion) -> f64| moved.iter().map(|(_, m)| of(m)).collect::<Vec<f64>>();
    table.push(
        "stone_id",
        moved.iter().map(|(s, _)| s.stone_id).collect::<Vec<u32>>(),
    )?;
    table.push("d_along", real(|m| m.face.x))?;
    table.push("d_up", real(|m| m.face.y))?;
    table.push("d_out", real(|m| m.face.z))?;
    table.push("norm", real(|m| m.displacement.norm()))?;
    table.push("lod95", real(|m| m.detection_limit_m))?;
    table.push(
        "significant",
        moved
            .iter()
            .map(|(_, m)| u8::from(m.significant))
            .collect::<Vec<u8>>(),
    )?;
    table.push("exaggeration", vec![factor; moved.len()])?;
    Ok(table)
}

/// How much longer lines are drawn: large motions reach about two stones far; 1, 2 or 5 times a power of ten.
fn exaggeration(results: &ResultSet, facts: &Summary) -> f64 {
    let sorted = |values: &mut dyn Iterator<Item = f64>| super::statistics::Sorted::new(values);
    let size = sorted(&mut results.stones.iter().map(|s| s.area_m2.max(0.0).sqrt()))
        .median()
        .unwrap_or(0.0);
    let motion = sorted(&mut facts.measured.iter().map(|(_, m)| m.displacement.norm()))
        .quantile(0.98)
        .unwrap_or(0.0);
    let wanted = 2.0 * size / motion;
    if !wanted.is_finite() || wanted <= 1.0 {
        return 1.0;
    }
    let power = 10f64.powf(wanted.log10().floor());
    [5.0, 2.0, 1.0]
        .into_iter()
        .map(|s| s * power)
        .find(|v| *v <= wanted)
        .unwrap_or(1.0)
}

/// The reference system that run.json names as `crs: {epsg, name, wkt}`; `None` for a local frame.
fn crs(run: &Value) -> Option<Crs> {
    let crs = run.get("crs")?;
    let text = |key: &str| crs.get(key).and_then(Value::as_str).map(str::to_owned);
    let epsg = i32::try_from(crs.get("epsg")?.as_i64()?).ok()?;
    Some(Crs {
        epsg,
        name: text("name")?,
        wkt: text("wkt")?,
    })
}

/// The colours of the out-of-plane displacement, on the scale of the report.
pub struct FaceColours(Scale);

impl FaceColours {
    /// The scale of these rows.
    pub fn new(rows: &[StoneRow]) -> Self {
        let motions = rows.iter().filter_map(|r| r.motion.as_ref());
        Self(Scale::Diverging(component_limit_of(motions)))
    }

    /// Colour of a stone; grey where its motion is not known.
    pub fn of(&self, row: Option<&StoneRow>) -> [u8; 3] {
        let motion = row.and_then(|r| r.motion.as_ref());
        motion.map_or(UNKNOWN, |m| self.0.colour(self.0.step(m.face.z)).0)
    }
}

/// One of the vectors of a motion.
type VectorOf = fn(&RowMotion) -> nalgebra::Vector3<f64>;

/// Numbers and vectors of all stones, as the VTK files have them.
fn attributes(data: &mut PolyData, stones: &[&StoneRow]) {
    let mut scalar = |name: &str, of: &dyn Fn(&StoneRow) -> f64| {
        data.scalars
            .push((name.to_owned(), stones.iter().map(|s| of(s)).collect()));
    };
    let motion = |of: fn(&RowMotion) -> f64| move |s: &StoneRow| s.motion.as_ref().map_or(f64::NAN, of);
    scalar("stone_id", &|s| f64::from(s.stone_id));
    scalar("area_m2", &|s| s.area_m2);
    scalar("confidence", &|s| s.confidence);
    scalar("status", &|s| f64::from(s.status as u8));
    scalar("d_along", &motion(|m| m.face.x));
    scalar("d_up", &motion(|m| m.face.y));
    scalar("d_out", &motion(|m| m.face.z));
    scalar("norm", &motion(|m| m.displacement.norm()));
    scalar("lod95", &motion(|m| m.detection_limit_m));
    scalar("significant", &motion(|m| f64::from(u8::from(m.significant))));
    scalar("loose", &motion(|m| f64::from(u8::from(m.loose))));
    let vectors: [(&str, VectorOf); 3] = [
        ("displacement", |m| m.displacement),
        ("rotation", |m| m.rotation),
        ("against_neighbours", |m| m.relative),
    ];
    for (name, of) in vectors {
        let vector = |s: &&StoneRow| s.motion.as_ref().map_or([f64::NAN; 3], |m| of(m).into());
        data.vectors
            .push((name.to_owned(), stones.iter().map(vector).collect()));
    }
}

/// The stones' outlines as polygons.
fn face_polygons(results: &ResultSet) -> PolyData {
    let mut data = PolyData::default();
    let mut drawn = Vec::new();
    for stone in &results.stones {
        if let Some(outline) = results.outlines.get(&stone.stone_id) {
            let first = data.points.len() as u32;
            data.polygons
                .push((first..first + outline.ring.len() as u32).collect());
            data.points.extend(&outline.ring);
            drawn.push(stone);
        }
    }
    attributes(&mut data, &drawn);
    data
}

/// The centroids of the measured stones, for arrows.
fn centroids(results: &ResultSet, facts: &Summary) -> PolyData {
    let finite = |s: &&StoneRow| s.centroid.iter().all(|v| v.is_finite());
    let stones: Vec<&StoneRow> = facts.measured.iter().map(|(s, _)| *s).filter(finite).collect();
    let mut data = PolyData {
        points: stones.iter().map(|s| s.centroid).collect(),
        ..PolyData::default()
    };
    // A file without stones has no arrays at all.
    if !results.stones.is_empty() {
        attributes(&mut data, &stones);
    }
    data
}

/// Faces of all stones as triangles, coloured by the out-of-plane displacement; grey where it was not measured.
fn face_mesh(results: &ResultSet) -> ColouredMesh {
    let colours = FaceColours::new(&results.stones);
    let names = ["stone_id", "d_along", "d_up", "d_out", "norm", "lod95"];
    let mut mesh = ColouredMesh {
        scalars: names.map(|n| (n.to_owned(), Vec::new())).to_vec(),
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
        let motion = stone.motion.as_ref();
        let colour = colours.of(Some(stone));
        mesh.colours.extend(outline.ring.iter().map(|_| colour));
        let of = |pick: fn(&RowMotion) -> f64| motion.map_or(f64::NAN, pick) as f32;
        let values = [
            stone.stone_id as f32,
            of(|m| m.face.x),
            of(|m| m.face.y),
            of(|m| m.face.z),
            of(|m| m.displacement.norm()),
            of(|m| m.detection_limit_m),
        ];
        for ((_, column), value) in mesh.scalars.iter_mut().zip(values) {
            column.extend(outline.ring.iter().map(|_| value));
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::testing::{outlines, rows};
    use crate::report::{write_outlines, write_stones};

    fn folder(rows: &[StoneRow]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        write_stones(folder.path(), rows).unwrap();
        write_outlines(folder.path(), &outlines()).unwrap();
        folder
    }

    #[test]
    fn all_layers_are_written_again_with_the_same_bytes() {
        let folder = folder(&rows());
        let names = [
            "stones.gpkg",
            "stones.geojson",
            "stones.ply",
            "stones.csv-metadata.json",
            "stones.vtp",
            "displacements.vtp",
        ];
        let bytes = || {
            write_layers(folder.path()).unwrap();
            names.map(|n| std::fs::read(folder.path().join(n)).unwrap())
        };
        let first = bytes();
        assert!(first == bytes(), "bytes differ");
        let json: Value = serde_json::from_slice(&first[1]).unwrap();
        assert_eq!(json["features"].as_array().unwrap().len(), 24);
        assert_eq!(json["features"][2]["properties"]["status"], "unmatched_lost");
        assert_eq!(json["features"][2]["properties"]["d_out"], Value::Null);
        let notes: Value = serde_json::from_slice(&first[3]).unwrap();
        assert_eq!(notes["tableSchema"]["columns"].as_array().unwrap().len(), 33);
    }

    #[test]
    fn lines_point_along_the_exaggerated_displacement() {
        let folder = folder(&rows());
        let results = ResultSet::read(folder.path()).unwrap();
        let facts = Summary::new(&results);
        let layers = layers(&results, &facts).unwrap();
        assert_eq!(
            layers.iter().map(|l| l.vertices.len()).collect::<Vec<_>>(),
            [24, 24, 20, 20, 38, 38]
        );
        let factor = exaggeration(&results, &facts);
        assert!(factor >= 10.0);
        // Stone 8 is the sixth measured one; it moved by (3, 20, -1) mm on a face that looks along x.
        let line = &layers[2].vertices[5];
        let d = (line[1] - line[0]) / factor;
        assert!((d - nalgebra::Vector3::new(0.003, 0.02, -0.001)).norm() < 1e-9);
        let flat = &layers[3].vertices[5];
        assert!(((flat[1] - flat[0]) / factor - nalgebra::Vector3::new(0.02, -0.001, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn further_epochs_are_further_layers() {
        let folder = folder(&rows());
        crate::report::write_stones_named(folder.path(), "stones_2", &rows()).unwrap();
        let later = ResultSet::read_pair(folder.path(), 2).unwrap();
        let names: Vec<String> = layers(&later, &Summary::new(&later))
            .unwrap()
            .into_iter()
            .map(|l| l.name)
            .collect();
        assert_eq!(
            names,
            [
                "stones_2",
                "stones_facade_2",
                "displacements_2",
                "displacements_facade_2",
                "joints_2",
                "joints_facade_2"
            ]
        );
        write_layers(folder.path()).unwrap();
    }

    #[test]
    fn a_run_without_stones_or_motions_has_layers_too() {
        write_layers(folder(&[]).path()).unwrap();
        let mut unmatched = rows();
        unmatched.iter_mut().for_each(|r| r.motion = None);
        write_layers(folder(&unmatched).path()).unwrap();
    }
}
