//! Map projections and earth-centred cameras against PROJ (testdata/crs).

use nalgebra::Point3;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use stonewise_core::geometry::View;
use stonewise_io::cameras::{CameraError, MapFrame, read_cameras_on_map};
use stonewise_io::crs::{Coordinates, Crs, Geodetic, Geoid, MapSystem, Units};

fn expected() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/crs/expected.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect()
}

fn system(text: &str) -> MapSystem {
    MapSystem::parse(text).unwrap().unwrap()
}

#[test]
fn systems_in_feet_are_those_of_proj() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/crs/units.json");
    let units: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    for (kind, in_feet) in [("feet", true), ("other", false)] {
        let codes = numbers(&units[kind]);
        assert!(codes.len() > 500);
        for code in codes {
            // One whose unit is not known is refused.
            let units = Units::of(&format!("EPSG:{code}"));
            let found = units.map_or(in_feet, |units| (units.plane_m - 0.3048).abs() < 1e-5);
            assert_eq!(found, in_feet, "EPSG:{code}");
        }
    }
}

fn compound() -> Value {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/crs/compound.json");
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn compound_systems_are_made_of_the_parts_that_proj_names() {
    let compound = compound();
    let systems = compound["systems"].as_array().unwrap();
    let (mut usable, mut refused) = (0, 0);
    for row in systems {
        let text = format!("EPSG:{}", row["code"]);
        let name = row["name"].as_str().unwrap();
        let crs = Crs::parse(&text).unwrap();
        assert_eq!(
            (crs.epsg.unwrap().to_string(), crs.name.as_str()),
            (row["code"].to_string(), name)
        );
        let flat = MapSystem::parse(&format!("EPSG:{}", row["horizontal"])).map(Option::unwrap);
        let expected = match (flat, row["metres"].as_f64(), row["direction"].as_str()) {
            (Err(reason), ..) => Err(reason),
            (Ok(_), Some(1.0), Some("down")) => Err("its heights count downwards".to_owned()),
            (Ok(mut flat), Some(1.0), _) => {
                flat.heights = Some(row["vertical"].as_str().unwrap().to_owned());
                Ok(flat)
            }
            (Ok(_), ..) => Err("the unit of its heights is not the metre".to_owned()),
        };
        if expected.is_ok() {
            usable += 1;
        } else {
            refused += 1;
        }
        assert_eq!(MapSystem::parse(&text).map(Option::unwrap), expected, "{text}");
        let parts = format!("EPSG:{}+{}", row["horizontal"], row["vertical_code"]);
        assert_eq!(MapSystem::parse(&parts).map(Option::unwrap), expected, "{parts}");
        let part = Crs::parse(&parts).unwrap();
        assert_eq!(part.epsg.unwrap().to_string(), row["horizontal"].to_string());
    }
    // Nearly all that are refused have heights or map coordinates in feet.
    assert_eq!((usable, refused), (329, 119));
    for row in compound["wkt"].as_array().unwrap() {
        let by_code = MapSystem::parse(&format!("EPSG:{}", row["code"]));
        for text in [&row["wkt1"], &row["wkt2"]] {
            let given = MapSystem::parse(text.as_str().unwrap());
            match (&given, &by_code) {
                (Ok(Some(given)), Ok(Some(by_code))) => {
                    assert_eq!(given.heights, by_code.heights);
                    assert!(given.shares_datum(by_code));
                }
                _ => assert_eq!(given, by_code),
            }
        }
    }
    let unknown = MapSystem::parse("EPSG:25832+25832").unwrap_err();
    assert!(unknown.contains("EPSG:25832+25832 is not among the systems"));
    assert_eq!(Crs::parse("EPSG:25832+1"), None);
}

#[test]
fn map_coordinates_are_those_of_proj() {
    let expected = expected();
    for row in expected["systems"].as_array().unwrap() {
        let by_code = format!("EPSG:{}", row["epsg"]);
        let texts = [
            row["wkt1"].as_str().unwrap(),
            row["wkt2"].as_str().unwrap(),
            &by_code,
        ];
        for text in texts {
            let found = system(text);
            assert!(found.shares_datum(&system(&by_code)), "{text}");
            let Coordinates::Projected(projection) = found.coordinates else {
                panic!("not projected: {text}");
            };
            for point in row["points"].as_array().unwrap() {
                let point = numbers(point);
                let at = Geodetic {
                    latitude: point[0].to_radians(),
                    longitude: point[1].to_radians(),
                    height_m: 0.0,
                };
                let [east, north] = projection.forward(&found.ellipsoid, &at);
                let error = (east - point[2]).hypot(north - point[3]);
                assert!(error < 1e-4, "{by_code}: {error} m at {point:?}");
            }
            let crs = Crs::parse(text).unwrap();
            assert_eq!(format!("EPSG:{}", crs.epsg.unwrap()), by_code);
        }
    }
}

fn metashape(folder: &Path, crs: &str, poses: &[&Value]) -> PathBuf {
    let mut cameras = String::new();
    for (id, pose) in poses.iter().enumerate() {
        let pose: Vec<String> = numbers(pose).iter().map(|v| format!("{v:.17e}")).collect();
        let _ = write!(
            cameras,
            "<camera id=\"{id}\" sensor_id=\"0\" label=\"{id}.jpg\"><transform>{}</transform></camera>",
            pose.join(" ")
        );
    }
    let crs = crs.replace('"', "&quot;");
    let text = format!(
        "<document version=\"2.0.0\"><chunk label=\"wall\"><sensors><sensor id=\"0\" type=\"frame\">\
         <resolution width=\"4000\" height=\"3000\"/><calibration type=\"frame\" class=\"adjusted\"><f>3000</f></calibration>\
         </sensor></sensors><cameras>{cameras}</cameras><reference>{crs}</reference></chunk></document>"
    );
    let path = folder.join("cameras.xml");
    std::fs::write(&path, text).unwrap();
    path
}

fn check_view(view: &View, row: &Value, shift: [f64; 3]) -> f64 {
    let shift = Point3::from(shift).coords;
    let centre = Point3::from_slice(&numbers(&row["centre"]));
    let error = (view.centre() + shift - centre).norm();
    assert!(error < 1e-4, "centre {error} m away: {row}");
    let points = row["points"].as_array().unwrap().iter().map(numbers);
    points
        .map(|p| {
            let seen = view
                .project(&(Point3::new(p[0], p[1], p[2]) - shift))
                .unwrap()
                .pixel;
            (seen[0] - p[3]).hypot(seen[1] - p[4])
        })
        .fold(0.0, f64::max)
}

#[test]
fn earth_centred_cameras_see_the_clouds_where_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let expected = expected();
    let rows = expected["cameras"].as_array().unwrap();
    for code in [25832, 31467, 32733, 2154] {
        let rows: Vec<&Value> = rows.iter().filter(|r| r["epsg"] == code).collect();
        let poses: Vec<&Value> = rows.iter().map(|r| &r["pose"]).collect();
        assert_eq!(rows.len(), 4);
        let named = format!("EPSG:{code}");
        let chunk = Crs::parse(&named).unwrap().wkt;
        let false_origin = [400_000.0, 5_000_000.0, -2.5];
        let shifted = MapFrame {
            crs: Some(named),
            false_origin,
            geoid: None,
        };
        for (map, shift) in [(MapFrame::default(), [0.0; 3]), (shifted, false_origin)] {
            let file = read_cameras_on_map(&metashape(folder.path(), &chunk, &poses), None, &map).unwrap();
            for (view, row) in file.views.iter().zip(&rows) {
                // The curvature of the earth over 100 m, at 3000 px per radian.
                let worst = check_view(view, row, shift);
                assert!(worst < 0.05, "EPSG:{code}: {worst} px");
            }
        }
    }
}

#[test]
fn a_chunk_in_feet_is_refused_where_its_poses_may_be_in_metres() {
    let folder = tempfile::tempdir().unwrap();
    let expected = expected();
    let pose = &expected["cameras"][0]["pose"];
    let local = r#"LOCAL_CS["Local Coordinates (ft)",LOCAL_DATUM["Local Datum",0],UNIT["foot",0.3048]]"#;
    let utm = Crs::parse("EPSG:25832")
        .unwrap()
        .wkt
        .replace("[\"metre\",1]", "[\"anything\",0.3048]");
    for (crs, fix) in [
        (local, "local coordinates in metres"),
        (&utm, "give theirs as crs"),
    ] {
        let path = metashape(folder.path(), crs, &[pose]);
        let error = read_cameras_on_map(&path, None, &MapFrame::default())
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("feet (0.3048 m)") && error.contains(fix),
            "{error}"
        );
    }
    // Metashape's poses on the earth are in metres.
    let path = metashape(folder.path(), &utm, &[pose]);
    let map = MapFrame {
        crs: Some("EPSG:25832".to_owned()),
        ..MapFrame::default()
    };
    assert!(read_cameras_on_map(&path, None, &map).is_ok());
}

#[test]
fn a_chunk_in_degrees_comes_to_the_system_of_the_clouds() {
    let folder = tempfile::tempdir().unwrap();
    let expected = expected();
    let row = expected["cameras"]
        .as_array()
        .unwrap()
        .iter()
        .find(|r| r["epsg"] == 25832);
    let row = row.unwrap();
    // WGS 84 stands for ETRS89, as map programs have it.
    let path = metashape(
        folder.path(),
        &Crs::parse("EPSG:4326").unwrap().wkt,
        &[&row["pose"]],
    );
    let map = |crs: &str| MapFrame {
        crs: Some(crs.to_owned()),
        ..MapFrame::default()
    };
    let file = read_cameras_on_map(&path, None, &map("EPSG:25832")).unwrap();
    assert!(check_view(&file.views[0], row, [0.0; 3]) < 0.05);
    assert_eq!(file.crs.as_deref(), Some("EPSG:25832"));
    let refused = |map: &MapFrame| match read_cameras_on_map(&path, None, map).unwrap_err() {
        CameraError::UnsupportedCrs { reason, .. } => reason,
        other => panic!("{other}"),
    };
    assert_eq!(
        refused(&MapFrame::default()),
        "the clouds name no system: give theirs as crs under [project]"
    );
    assert!(refused(&map("EPSG:31467")).contains("another geodetic datum"));
    assert!(refused(&map("EPSG:2056")).contains("another geodetic datum"));
    assert!(refused(&map("EPSG:5513")).contains("EPSG:5513 is not among the systems known by their number"));
    assert!(refused(&map("EPSG:4326")).contains("the clouds are in degrees (WGS 84)"));
    let swiss = "PROJCS[\"CH1903+ / LV95\",GEOGCS[\"CH1903+\",DATUM[\"CH1903+\",SPHEROID[\"Bessel 1841\",6377397.155,299.1528128]]],\
                 PROJECTION[\"Hotine_Oblique_Mercator_Azimuth_Center\"],UNIT[\"metre\",1]]";
    assert!(
        refused(&map(swiss))
            .contains("its projection, \"Hotine_Oblique_Mercator_Azimuth_Center\", is not covered")
    );
    let feet = Crs::parse("EPSG:32632")
        .unwrap()
        .wkt
        .replace("[\"metre\",1]", "[\"US survey foot\",0.3048006]");
    // Clouds in feet are read as metres; of the place on the map only the false easting has another value.
    let centre = |map: &MapFrame| read_cameras_on_map(&path, None, map).unwrap().views[0].centre();
    let shift = centre(&map(&feet)) - centre(&map("EPSG:32632"));
    assert!(
        (shift.x + 500_000.0 * (1.0 - 0.304_800_6)).abs() < 1e-6 && shift.yz().norm() < 1e-6,
        "{shift}"
    );
    let utm = Crs::parse("EPSG:25832").unwrap().wkt;
    let above_geoid =
        format!("COMPD_CS[\"both\",{utm},VERT_CS[\"DHHN2016 height\",VERT_DATUM[\"DHHN2016\",2005]]]");
    for above_geoid in [&above_geoid, "EPSG:25832+7837"] {
        let error = refused(&map(above_geoid));
        assert!(error.contains("above a geoid (DHHN2016 height): give its grid (GTX or GeoTIFF) as geoid"));
    }
    assert!(refused(&map("EPSG:5555")).contains("above a geoid (DHHN92 height)"));
}

fn geoid_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../testdata/crs")
        .join(name)
}

#[test]
fn heights_of_a_geoid_are_those_of_proj() {
    let expected: Value =
        serde_json::from_str(&std::fs::read_to_string(geoid_file("geoid.json")).unwrap()).unwrap();
    let points: Vec<Vec<f64>> = expected["points"]
        .as_array()
        .unwrap()
        .iter()
        .map(numbers)
        .collect();
    assert_eq!(points.len(), 40);
    for (name, tolerance_m) in [
        ("geoid.gtx", 1e-5),
        ("geoid_area.tif", 1e-5),
        ("geoid_strips.tif", 1e-5),
        // Whole millimetres.
        ("geoid_point.tif", 5.1e-4),
    ] {
        let geoid = Geoid::read(&geoid_file(name)).unwrap();
        for p in &points {
            for turn in [0.0, 360.0] {
                let height = geoid.height_m(&at(p[0], p[1] + turn)).unwrap();
                assert!(
                    (height - p[2]).abs() < tolerance_m,
                    "{name}: {height} is not {}",
                    p[2]
                );
            }
        }
        // The corners of the grid; then places off it, and one beside the node without a height.
        let inwards = if name == "geoid_point.tif" { 1e-9 } else { 0.0 };
        for latitude in [46.0 + inwards, 52.0 - inwards] {
            assert!(geoid.height_m(&at(latitude, 4.5 + inwards)).is_some(), "{name}");
        }
        for (latitude, longitude) in [
            (45.99, 5.0),
            (52.01, 5.0),
            (47.0, 4.49),
            (47.0, 10.76),
            (51.9, 10.7),
        ] {
            assert_eq!(geoid.height_m(&at(latitude, longitude)), None, "{name}");
        }
    }
}

fn at(latitude: f64, longitude: f64) -> Geodetic {
    Geodetic {
        latitude: latitude.to_radians(),
        longitude: longitude.to_radians(),
        height_m: 100.0,
    }
}

#[test]
fn cameras_come_to_clouds_whose_heights_are_above_a_geoid() {
    let folder = tempfile::tempdir().unwrap();
    let expected = expected();
    let rows = expected["cameras"].as_array().unwrap().iter();
    let rows: Vec<&Value> = rows.filter(|r| r["epsg"] == 25832).collect();
    let poses: Vec<&Value> = rows.iter().map(|r| &r["pose"]).collect();
    let heights: Value =
        serde_json::from_str(&std::fs::read_to_string(geoid_file("geoid.json")).unwrap()).unwrap();
    let utm = Crs::parse("EPSG:25832").unwrap().wkt;
    let compound =
        format!("COMPD_CS[\"both\",{utm},VERT_CS[\"DHHN2016 height\",VERT_DATUM[\"DHHN2016\",2005]]]");
    let path = metashape(folder.path(), &compound, &poses);
    for crs in [None, Some(compound), Some("EPSG:25832".to_owned())] {
        let map = MapFrame {
            crs,
            geoid: Some(geoid_file("geoid.gtx")),
            ..MapFrame::default()
        };
        let file = read_cameras_on_map(&path, None, &map).unwrap();
        for ((view, row), height) in file
            .views
            .iter()
            .zip(&rows)
            .zip(heights["cameras"].as_array().unwrap())
        {
            let centre = numbers(&row["centre"]);
            let error = view.centre() - Point3::new(centre[0], centre[1], centre[2] - numbers(height)[2]);
            assert!(error.norm() < 1e-4, "{error}");
        }
    }
    // Off the grid.
    let south = rows_of(&expected, 32733);
    let path = metashape(
        folder.path(),
        &Crs::parse("EPSG:32733").unwrap().wkt,
        &[&south["pose"]],
    );
    let map = MapFrame {
        geoid: Some(geoid_file("geoid.gtx")),
        ..MapFrame::default()
    };
    let error = read_cameras_on_map(&path, None, &map).unwrap_err().to_string();
    assert!(error.contains("off the grid of the geoid"), "{error}");
}

fn rows_of(expected: &Value, code: u32) -> Value {
    let rows = expected["cameras"].as_array().unwrap();
    rows.iter().find(|r| r["epsg"] == code).unwrap().clone()
}

#[test]
fn grids_that_are_cut_or_impossible_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let good = std::fs::read(geoid_file("geoid.gtx")).unwrap();
    let path = folder.path().join("bad.gtx");
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        let error = Geoid::read(&path).unwrap_err().to_string();
        assert!(
            error.contains("give a GTX file") && error.contains("bad.gtx"),
            "{error}"
        );
    };
    (0..good.len()).for_each(|end| refused(&good[..end]));
    // Rows and columns whose product overflows or fits the length, steps and corners off the earth.
    for (place, bytes) in [
        (32, [0x7f; 8].as_slice()),
        (32, &[0xff; 4]),
        (32, &[0, 0, 0, 1, 0, 0, 0, 54]),
        (16, &0f64.to_be_bytes()),
        (24, &f64::NAN.to_be_bytes()),
        (0, &91f64.to_be_bytes()),
        (8, &f64::INFINITY.to_be_bytes()),
    ] {
        let mut bad = good.clone();
        bad[place..place + bytes.len()].copy_from_slice(bytes);
        refused(&bad);
    }
    assert!(
        Geoid::read(&folder.path().join("none.gtx"))
            .unwrap_err()
            .to_string()
            .contains("cannot read the geoid")
    );
}

#[test]
fn geotiff_grids_that_are_cut_or_impossible_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bad.tif");
    let read = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        Geoid::read(&path).map_err(|error| error.to_string())
    };
    for name in ["geoid_area.tif", "geoid_point.tif", "geoid_strips.tif"] {
        let good = std::fs::read(geoid_file(name)).unwrap();
        let place = at(48.0, 7.0);
        let height = read(&good).unwrap().height_m(&place).unwrap();
        for end in (0..good.len()).step_by(3) {
            // The part cut off may lie after the first band.
            match read(&good[..end]) {
                Ok(geoid) => assert_eq!(geoid.height_m(&place), Some(height), "{name}: {end}"),
                Err(error) => assert!(error.contains("give a GTX file, a GeoTIFF"), "{error}"),
            }
        }
        for place in 0..good.len() {
            let mut bad = good.clone();
            bad[place] = 0xff;
            let _ = read(&bad).map(|geoid| geoid.height_m(&at(48.0, 7.0)));
        }
    }
    // Sides of the grid and of its only tile (tags 256, 257, 322 and 323).
    let side = |tag: u16, pixels: u16| {
        let words = [tag, 3, 1, 0, pixels];
        words.into_iter().flat_map(u16::to_le_bytes).collect::<Vec<u8>>()
    };
    let sides = [(256, 6), (257, 9), (322, 16), (323, 16)];
    let huge: Vec<_> = sides.map(|(tag, p)| (side(tag, p), side(tag, 65_520))).into();
    let text = |old: &str, new: &str| vec![(old.as_bytes().to_owned(), new.as_bytes().to_owned())];
    let key = |kind: u8| vec![0, 4, 0, 0, 1, 0, kind, 0];
    for (name, changes, reason) in [
        ("geoid_area.tif", huge, "limits exceeded"),
        (
            "geoid_area.tif",
            vec![(key(2), key(1))],
            "not latitudes and longitudes",
        ),
        (
            "geoid_point.tif",
            text("geoid_undulation", "longitude_offset"),
            "its first band is a longitude_offset",
        ),
        (
            "geoid_point.tif",
            text(">0.001<", ">0,001<"),
            "its scale is not a number",
        ),
        (
            "geoid_point.tif",
            text("</Item>", "</Itex>"),
            "its metadata are broken",
        ),
    ] {
        let mut bad = std::fs::read(geoid_file(name)).unwrap();
        for (old, new) in changes {
            // GDAL rewrites metadata and leaves the old copy in the file.
            let places: Vec<usize> = (0..bad.len()).filter(|p| bad[*p..].starts_with(&old)).collect();
            assert!(!places.is_empty(), "{name}: {reason}");
            for place in places {
                bad[place..place + new.len()].copy_from_slice(&new);
            }
        }
        let error = read(&bad).unwrap_err();
        assert!(error.contains(reason), "{error}");
    }
}

#[test]
fn poses_that_are_not_earth_centred_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let local = serde_json::json!([1, 0, 0, 4.0, 0, 1, 0, 5.0, 0, 0, 1, 6.0, 0, 0, 0, 1]);
    let path = metashape(folder.path(), &Crs::parse("EPSG:25832").unwrap().wkt, &[&local]);
    let error = read_cameras_on_map(&path, None, &MapFrame::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("photo 0.jpg would be -63"), "{error}");
    assert!(error.contains("not earth-centred"), "{error}");
}

/// A geoid that is linear between the nodes of any grid, so that its heights are known everywhere: metres at degrees,
/// with longitudes from 0 to 360. It is continuous at Greenwich.
fn invented_height(latitude: f64, longitude: f64) -> f64 {
    10.0 + 0.25 * latitude - 0.125 * (longitude - 180.0).abs()
}

fn assert_invented(path: &Path, tolerance_m: f64) {
    let geoid = Geoid::read(path).unwrap();
    for (latitude, longitude) in [
        (89.99, 0.0),
        (-89.99, 359.9),
        (51.07, 7.53),
        (-33.3, 250.01),
        (12.34, 359.99),
        (0.01, 180.0),
    ] {
        let expected = invented_height(latitude, longitude);
        for turn in [0.0, -360.0] {
            let height = geoid.height_m(&at(latitude, longitude + turn)).unwrap();
            assert!(
                (height - expected).abs() < tolerance_m,
                "{latitude} {longitude}: {height} {expected}"
            );
        }
    }
}

/// Heights in rows from north to south, each from Greenwich to the east.
fn invented_rows(per_degree: usize, columns: usize) -> impl Iterator<Item = Vec<f64>> {
    let step = 1.0 / per_degree as f64;
    let row = move |row: usize| {
        let latitude = 90.0 - row as f64 * step;
        let height = |column: usize| invented_height(latitude, column as f64 * step);
        (0..columns).map(height).collect()
    };
    (0..180 * per_degree + 1).map(row)
}

#[test]
fn the_binary_grid_of_egm96_has_the_heights_of_its_layout() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("WW15MGH.DAC");
    let centimetres = |height: f64| ((100.0 * height).round() as i16).to_be_bytes();
    let bytes: Vec<u8> = invented_rows(4, 1440).flatten().flat_map(centimetres).collect();
    assert_eq!(bytes.len(), 2_076_480);
    std::fs::write(&path, &bytes).unwrap();
    assert_invented(&path, 0.0051);
    std::fs::write(&path, &bytes[2..]).unwrap();
    let error = Geoid::read(&path).unwrap_err().to_string();
    assert!(error.contains("convert it with gdal_translate"), "{error}");
}

#[test]
fn grids_of_gravsoft_have_the_heights_of_their_layout() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("WW15MGH.GRD");
    let mut text = "   -90.000000   90.000000     .000000  360.000000    1.000000    1.000000\n\n".to_owned();
    for row in invented_rows(1, 361) {
        for line in row.chunks(8) {
            text.extend(line.iter().map(|height| format!("{height:9.3}")));
            text.push('\n');
        }
    }
    std::fs::write(&path, &text).unwrap();
    assert_invented(&path, 5.1e-4);
    for (from, to, part) in [
        (
            "    1.000000\n",
            "    0.999000\n",
            "not whole numbers of steps apart",
        ),
        (
            "    1.000000\n",
            "    0.000000\n",
            "not whole numbers of steps apart",
        ),
        (
            "    1.000000\n",
            "    0.500000\n",
            "it has 65341 heights instead of 181 x 721",
        ),
        ("   10.000", "   1O.000", "a height is not a number"),
        ("   90.000000", "   NaN", "not whole numbers of steps apart"),
        (
            "   -90.000000   90.000000",
            "   -91.000000   89.000000",
            "its size or place is impossible",
        ),
    ] {
        assert!(text.contains(from), "{from}");
        std::fs::write(&path, text.replacen(from, to, 1)).unwrap();
        let error = Geoid::read(&path).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("WW15MGH.GRD"), "{error}");
    }
}
