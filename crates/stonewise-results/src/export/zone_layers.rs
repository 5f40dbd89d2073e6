//! The zones of deformation as layers of polygons.

use super::layer_style::zone_style;
use crate::{ResultSet, StoneOutline, ZonePlace};
use nalgebra::{Point2, Point3, Vector3};
use stonewise_core::geometry::convex_hull;
use stonewise_core::registration::DeformationZone;
use stonewise_io::crs::Crs;
use stonewise_io::layers::{Geometry, Layer};
use stonewise_io::table::{Table, TableError};

/// A zone and the convex hull of its stones' outlines.
struct Outlined<'a> {
    zone: &'a DeformationZone,
    place: ZonePlace,
    /// Corners in the unrolled facade, counter-clockwise.
    facade: Vec<Point2<f64>>,
    /// Corners in the world frame, metres, in the order of `facade`.
    world: Vec<Point3<f64>>,
}

/// The zones in the world frame and unrolled; no layers where nothing deformed. `numbered`, `titled`: name and
/// title of a layer of this pair of epochs.
pub(super) fn zone_layers(
    results: &ResultSet,
    numbered: &dyn Fn(&str) -> String,
    titled: &dyn Fn(&str) -> String,
    crs: Option<Crs>,
) -> Result<Vec<Layer>, TableError> {
    let record = results.registration.as_ref().and_then(|r| r.deformation.as_ref());
    let zones: Vec<Outlined> = record
        .iter()
        .flat_map(|record| &record.zones)
        .filter_map(|zone| outlined(results, zone))
        .collect();
    if zones.is_empty() {
        return Ok(Vec::new());
    }
    let flat = |zone: &Outlined| zone.facade.iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect();

    let layer = |name: &str, title: &str, geometry, crs, vertices| {
        Ok::<_, TableError>(Layer {
            name: numbered(name),
            title: titled(title),
            description:
                "zones of deformation, of the part above half of the peak: convex hulls of the outlines of \
                          its stones; metres"
                    .into(),
            geometry,
            crs,
            attributes: attributes(&zones)?,
            vertices,
            styles: vec![zone_style()],
        })
    };

    Ok(vec![
        layer(
            "zones",
            "Zones of deformation",
            Geometry::PolygonZ,
            crs,
            zones.iter().map(|z| z.world.clone()).collect(),
        )?,
        layer(
            "zones_facade",
            "Zones of deformation, unrolled",
            Geometry::Polygon,
            None,
            zones.iter().map(flat).collect(),
        )?,
    ])
}

/// The hull of a zone's stones; `None` where no stone has an outline.
fn outlined<'a>(results: &ResultSet, zone: &'a DeformationZone) -> Option<Outlined<'a>> {
    let mut corners: Vec<(Point2<f64>, Point3<f64>)> = Vec::new();
    let mut normal = Vector3::zeros();
    for stone in ZonePlace::stones(zone, &results.stones) {
        if let Some(outline) = results.outlines.get(&stone.stone_id) {
            corners.extend(
                results
                    .unrolled(stone)
                    .into_iter()
                    .zip(outline.ring.iter().copied()),
            );
            normal += outline.normal * stone.area_m2;
        }
    }
    let facade = convex_hull(&corners.iter().map(|(p, _)| *p).collect::<Vec<_>>());
    let in_world = |corner: &Point2<f64>| corners.iter().find(|(p, _)| p == corner).map(|(_, q)| *q);
    let hull = StoneOutline {
        stone_id: zone.number,
        normal: normal.try_normalize(0.0)?,
        ring: facade.iter().filter_map(in_world).collect(),
    };
    Some(Outlined {
        zone,
        place: ZonePlace::of(zone, &results.stones),
        world: hull.seen_from_above(),
        facade,
    })
}

fn attributes(zones: &[Outlined]) -> Result<Table, TableError> {
    let mut table = Table::new();
    let numbers = |of: fn(&Outlined) -> u32| zones.iter().map(of).collect::<Vec<u32>>();
    let reals = |of: fn(&Outlined) -> f64| zones.iter().map(of).collect::<Vec<f64>>();
    let kinds: Vec<String> = zones.iter().map(|z| z.zone.kind.word().to_owned()).collect();
    table.push(
        "zone_id",
        "",
        "zone, as in the stone table",
        numbers(|z| z.zone.number),
    )?;
    table.push("kind", "", "what the deformation resembles", kinds)?;
    let against: Vec<String> = zones.iter().map(|z| z.zone.against.word().to_owned()).collect();
    table.push("against", "", "what its motion counts from", against)?;
    table.push("stones", "", "number of stones", numbers(|z| z.place.stones))?;
    table.push(
        "area_m2",
        "m2",
        "area of the faces of its stones",
        reals(|z| z.place.area_m2),
    )?;

    let diameters: Vec<Option<f64>> = zones.iter().map(|z| z.zone.diameter_m).collect();
    table.push("diameter_m", "m", "diameter of a round zone", diameters)?;
    table.push("length_m", "m", "length", reals(|z| z.zone.length_m))?;
    table.push("width_m", "m", "width", reals(|z| z.zone.width_m))?;
    table.push(
        "largest_m",
        "m",
        "largest deformation of a stone",
        reals(|z| z.zone.largest_m),
    )?;
    table.push(
        "lower_m",
        "m",
        "lower end of its 95 % interval",
        reals(|z| z.zone.interval_m[0]),
    )?;
    table.push(
        "upper_m",
        "m",
        "upper end of its 95 % interval",
        reals(|z| z.zone.interval_m[1]),
    )?;

    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::records::DeformationRecord;
    use crate::testing::{folder, registration_record, rows};
    use stonewise_core::id::StoneId;
    use stonewise_core::registration::{Against, ZoneKind};

    #[test]
    fn a_zone_is_outlined_around_all_outlines_of_its_stones() {
        let stones = rows();
        let folder = folder(&stones);
        let mut results = ResultSet::read(folder.path()).unwrap();
        let named = |name: &str| name.to_owned();
        assert!(zone_layers(&results, &named, &named, None).unwrap().is_empty());

        let mut record = registration_record();
        record.deformation = Some(DeformationRecord {
            p: Some(0.001),
            detection_limits_m: [None; 3],
            limits_in_face_m: [None; 3],
            zones: vec![DeformationZone {
                number: 1,
                largest_m: 0.02,
                interval_m: [0.018, 0.022],
                mean_m: Vector3::x() * 0.01,
                stones: (1..10).map(StoneId).collect(),
                diameter_m: None,
                length_m: 2.0,
                width_m: 1.0,
                kind: ZoneKind::Bulge,
                against: Against::RestOfWall,
            }],
        });
        results.registration = Some(record);
        let layers = zone_layers(&results, &named, &named, None).unwrap();
        let names: Vec<&str> = layers.iter().map(|l| l.name.as_str()).collect();
        assert_eq!(names, ["zones", "zones_facade"]);
        // Stones show through.
        assert!(
            layers
                .iter()
                .all(|l| l.styles[0].qml.contains(r#"name="style" value="no""#))
        );
        let hull = &layers[1].vertices[0];
        // By brute force: every corner of the zone's outlines lies to the left of every edge.
        for stone in results.stones.iter().filter(|s| s.stone_id < 10) {
            for p in results.unrolled(stone) {
                for (k, a) in hull.iter().enumerate() {
                    let b = hull[(k + 1) % hull.len()];
                    assert!((b - a).xy().perp(&(p - a.xy())) > -1e-9, "{p}");
                }
            }
        }
        // The corners in the world are those of outlines, but for the lean of a vertical plane.
        let rings = || results.outlines.values().flat_map(|o| &o.ring);
        for corner in &layers[0].vertices[0] {
            let nearest = rings().map(|p| (p - corner).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 0.02, "{corner}");
        }
    }
}
