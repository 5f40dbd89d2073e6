//! The layers of the GeoPackage.

use super::joint_layer::joint_layer;
use super::layer_style::{arrow_style, stone_style};
use super::zone_layers::zone_layers;
use crate::names::numbered;
use crate::{
    ResultSet, RowMotion, Sorted, StoneOutline, StoneRow, column, component_limit_m, joints, nice_scale_m,
    stone_table,
};
use nalgebra::{Point2, Point3};
use stonewise_figure::Scale;
use stonewise_io::crs::Crs;
use stonewise_io::layers::{Geometry, Layer, LayerStyle};
use stonewise_io::table::{Column, Table, TableError};

/// The layers of the GeoPackage; the first is that of the world frame.
pub(super) fn layers(results: &ResultSet) -> Result<Vec<Layer>, TableError> {
    let rows: Vec<StoneRow> = results.stones.clone();
    let measured = results.measured();
    let styles = styles(results, &measured);
    let crs = crs(results);

    let world = |s: &StoneRow| {
        results
            .outlines
            .get(&s.stone_id)
            .map_or(Vec::new(), StoneOutline::seen_from_above)
    };

    let flat = |p: Point2<f64>| Point3::new(p.x, p.y, 0.0);
    let facade = |s: &StoneRow| results.unrolled(s).into_iter().map(flat).collect();
    let numbered = |name: &str| numbered(name, results.pair);

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

    let factor = exaggeration(results, &measured);
    let all_joints = joints(results);
    let moved: Vec<(&StoneRow, &RowMotion)> = measured
        .into_iter()
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

    let mut layers = vec![
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
            [&numbered("joints"), &titled("Joints")],
            Geometry::LineStringZ,
            crs.clone(),
            &all_joints,
            results,
            |j| j.world.to_vec(),
        )?,
        joint_layer(
            [&numbered("joints_facade"), &titled("Joints, unrolled")],
            Geometry::LineString,
            None,
            &all_joints,
            results,
            |j| j.line.map(flat).to_vec(),
        )?,
    ];

    layers.extend(zone_layers(results, &numbered, &titled, crs)?);
    Ok(layers)
}

fn styles(results: &ResultSet, measured: &[(&StoneRow, &RowMotion)]) -> Vec<LayerStyle> {
    let motions = measured.iter().map(|(_, m)| *m);
    let shared = Scale::Diverging(component_limit_m(motions, &results.thresholds()));
    let limit = Scale::Sequential(nice_scale_m(measured.iter().map(|(_, m)| m.detection_limit_m)));
    vec![
        stone_style("Out of the wall", "d_out", shared, true),
        stone_style("Along the wall", "d_along", shared, true),
        stone_style("Up the face", "d_up", shared, true),
        stone_style("Detection limit", "lod95", limit, false),
    ]
}

fn motion_table(moved: &[(&StoneRow, &RowMotion)], factor: f64) -> Result<Table, TableError> {
    let mut table = Table::new();
    let as_in_stones = |table: &mut Table, name: &str, values: Column| {
        let (unit, meaning) = column(name).map_or(("", ""), |c| (c.unit, c.meaning));
        table.push(name, unit, meaning, values)
    };
    let real = |of: fn(&RowMotion) -> f64| moved.iter().map(|(_, m)| of(m)).collect::<Vec<f64>>();
    let stones: Vec<u32> = moved.iter().map(|(s, _)| s.stone_id).collect();
    as_in_stones(&mut table, "stone_id", stones.into())?;
    as_in_stones(&mut table, "d_along", real(|m| m.face.x).into())?;
    as_in_stones(&mut table, "d_up", real(|m| m.face.y).into())?;
    as_in_stones(&mut table, "d_out", real(|m| m.face.z).into())?;
    let lengths = real(|m| m.displacement.norm());
    table.push("norm", "m", "length of the displacement", lengths)?;
    as_in_stones(&mut table, "lod95", real(|m| m.detection_limit_m).into())?;
    let significant: Vec<u8> = moved.iter().map(|(_, m)| u8::from(m.significant)).collect();
    as_in_stones(&mut table, "significant", significant.into())?;
    table.push(
        "exaggeration",
        "",
        "how many times longer than the displacement the line is",
        vec![factor; moved.len()],
    )?;
    Ok(table)
}

/// How much longer lines are drawn: large motions reach about two stones far; 1, 2 or 5 times a power of ten.
pub(super) fn exaggeration(results: &ResultSet, measured: &[(&StoneRow, &RowMotion)]) -> f64 {
    let sizes = Sorted::new(results.stones.iter().map(|s| s.area_m2.max(0.0).sqrt()));
    let motions = Sorted::new(measured.iter().map(|(_, m)| m.displacement.norm()));
    let (size, motion) = (
        sizes.median().unwrap_or(0.0),
        motions.quantile(0.98).unwrap_or(0.0),
    );
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

/// The reference system that run.json names; `None` for a local frame.
fn crs(results: &ResultSet) -> Option<Crs> {
    let crs = results.run.as_ref()?.crs.clone()?;
    Some(Crs {
        epsg: crs.epsg,
        name: crs.name,
        wkt: crs.wkt,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{folder, rows};
    use crate::write_stones;
    use nalgebra::Vector3;

    #[test]
    fn lines_point_along_the_exaggerated_displacement() {
        let folder = folder(&rows());
        let results = ResultSet::read(folder.path()).unwrap();
        let layers = layers(&results).unwrap();
        assert_eq!(
            layers.iter().map(|l| l.vertices.len()).collect::<Vec<_>>(),
            [24, 24, 20, 20, 38, 38]
        );
        let factor = exaggeration(&results, &results.measured());
        assert!(factor >= 10.0);
        // Stone 8 is the sixth measured one; it moved by (3, 20, -1) mm on a face that looks along x.
        let line = &layers[2].vertices[5];
        let d = (line[1] - line[0]) / factor;
        assert!((d - Vector3::new(0.003, 0.02, -0.001)).norm() < 1e-9);
        let flat = &layers[3].vertices[5];
        assert!(((flat[1] - flat[0]) / factor - Vector3::new(0.02, -0.001, 0.0)).norm() < 1e-9);
    }

    #[test]
    fn further_epochs_are_further_layers() {
        let folder = folder(&rows());
        write_stones(folder.path(), 2, &rows()).unwrap();
        let later = ResultSet::read_pair(folder.path(), 2).unwrap();
        let names: Vec<String> = layers(&later).unwrap().into_iter().map(|l| l.name).collect();
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
    }
}
