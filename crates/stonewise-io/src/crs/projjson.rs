//! Projected and compound systems as PROJJSON (version 0.7), which GeoParquet takes.

use super::epsg::{Projected, Vertical, compound, projected};
use serde_json::{Value, json};

/// The definition of a projected system in metres, feet or other units, or of a compound of one with a vertical
/// system; `None` where the table lacks it or its method has no place here.
pub fn projjson(code: u32) -> Option<Value> {
    let mut definition = match compound(code) {
        Some(system) => json!({
            "type": "CompoundCRS",
            "name": system.name,
            "components": [of_projected(system.horizontal)?, of_vertical(&system.vertical)?],
            "id": { "authority": "EPSG", "code": code },
        }),
        None => of_projected(code)?,
    };
    definition["$schema"] = json!("https://proj.org/schemas/v0.7/projjson.schema.json");
    Some(definition)
}

fn of_vertical(system: &Vertical) -> Option<Value> {
    let unit = unit("LinearUnit", "metre", system.unit, system.metres)?;
    let (name, abbreviation, direction) = system.axis();
    Some(json!({
        "type": "VerticalCRS",
        "name": system.name,
        "datum": { "type": "VerticalReferenceFrame", "name": system.datum },
        "coordinate_system": { "subtype": "vertical", "axis": [axis(name, abbreviation, direction, &unit)] },
        "id": { "authority": "EPSG", "code": system.code },
    }))
}

fn axis(name: &str, abbreviation: &str, direction: &str, unit: &Value) -> Value {
    json!({ "name": name, "abbreviation": abbreviation, "direction": direction, "unit": unit })
}

fn of_projected(code: u32) -> Option<Value> {
    let system = projected(code)?;
    let (method, names) = method(system.method)?;
    // WKT 1 says this in the name.
    let name = system.name.trim_end_matches(" (deprecated)");
    let base = &system.base;
    let angle = unit("AngularUnit", "degree", base.unit, base.radians)?;
    let length = unit("LinearUnit", "metre", system.unit, system.metres)?;
    let mut parameters = Vec::new();
    for (parameter, (_, value)) in names.iter().zip(&system.parameters) {
        let unit = match parameter {
            _ if parameter.starts_with("Scale") => &json!("unity"),
            _ if parameter.contains("asting") || parameter.contains("orthing") => &length,
            _ => &angle,
        };
        parameters.push(json!({ "name": parameter, "value": number(value)?, "unit": unit }));
    }
    let mut axes = [
        axis("Easting", "E", "east", &length),
        axis("Northing", "N", "north", &length),
    ];
    match system.axes {
        "EN" => {}
        "NE" => axes.reverse(),
        _ => return None,
    }
    Some(json!({
        "type": "ProjectedCRS",
        "name": name,
        "base_crs": {
            "name": base.name,
            "datum": datum(&system)?,
            "coordinate_system": {
                "subtype": "ellipsoidal",
                "axis": [
                    axis("Geodetic latitude", "Lat", "north", &angle),
                    axis("Geodetic longitude", "Lon", "east", &angle),
                ],
            },
            "id": { "authority": "EPSG", "code": base.code },
        },
        "conversion": { "name": name, "method": { "name": method }, "parameters": parameters },
        "coordinate_system": { "subtype": "Cartesian", "axis": axes },
        "id": { "authority": "EPSG", "code": code },
    }))
}

fn datum(system: &Projected) -> Option<Value> {
    let base = &system.base;
    let mut ellipsoid = json!({ "name": base.spheroid, "semi_major_axis": number(base.semi_major_m)? });
    let inverse = number(base.inverse_flattening)?;
    if inverse == 0.0 {
        ellipsoid["semi_minor_axis"] = ellipsoid["semi_major_axis"].clone();
    } else {
        ellipsoid["inverse_flattening"] = json!(inverse);
    }
    let name = base.datum.replace('_', " ");
    let mut datum = json!({ "type": "GeodeticReferenceFrame", "name": name, "ellipsoid": ellipsoid });
    if base.meridian != "Greenwich" {
        datum["prime_meridian"] =
            json!({ "name": base.meridian, "longitude": number(base.meridian_degrees)? });
    }
    Some(datum)
}

/// A unit by its name where the format has one, else with its size.
fn unit(kind: &str, known: &str, name: &str, size: &str) -> Option<Value> {
    if name == known {
        return Some(json!(name));
    }
    Some(json!({ "type": kind, "name": name, "conversion_factor": number(size)? }))
}

fn number(text: &str) -> Option<f64> {
    text.parse().ok()
}

const NATURAL: [&str; 5] = [
    "Latitude of natural origin",
    "Longitude of natural origin",
    "Scale factor at natural origin",
    "False easting",
    "False northing",
];
const PLAIN: [&str; 4] = [NATURAL[0], NATURAL[1], NATURAL[3], NATURAL[4]];
const CONE: [&str; 6] = [
    "Latitude of false origin",
    "Longitude of false origin",
    "Latitude of 1st standard parallel",
    "Latitude of 2nd standard parallel",
    "Easting at false origin",
    "Northing at false origin",
];
const OBLIQUE: [&str; 7] = [
    "Latitude of projection centre",
    "Longitude of projection centre",
    "Azimuth at projection centre",
    "Angle from Rectified to Skew Grid",
    "Scale factor at projection centre",
    "Easting at projection centre",
    "Northing at projection centre",
];
const OBLIQUE_AT_EQUATOR: [&str; 7] = [
    OBLIQUE[0], OBLIQUE[1], OBLIQUE[2], OBLIQUE[3], OBLIQUE[4], NATURAL[3], NATURAL[4],
];
const KROVAK: [&str; 7] = [
    "Latitude of projection centre",
    "Longitude of origin",
    "Co-latitude of cone axis",
    "Latitude of pseudo standard parallel",
    "Scale factor on pseudo standard parallel",
    "False easting",
    "False northing",
];

/// The register's names of a method of WKT 1 and of its parameters, which the table has in this order. Methods that the
/// register divides, such as those of the sphere, are left out.
fn method(wkt: &str) -> Option<(&'static str, &'static [&'static str])> {
    Some(match wkt {
        "Transverse_Mercator" => ("Transverse Mercator", &NATURAL),
        "Lambert_Conformal_Conic_1SP" => ("Lambert Conic Conformal (1SP)", &NATURAL),
        "Lambert_Conformal_Conic_2SP" => ("Lambert Conic Conformal (2SP)", &CONE),
        "Oblique_Stereographic" => ("Oblique Stereographic", &NATURAL),
        "Hotine_Oblique_Mercator_Azimuth_Center" => ("Hotine Oblique Mercator (variant B)", &OBLIQUE),
        "Hotine_Oblique_Mercator" => ("Hotine Oblique Mercator (variant A)", &OBLIQUE_AT_EQUATOR),
        "Krovak" => ("Krovak (North Orientated)", &KROVAK),
        "Lambert_Azimuthal_Equal_Area" => ("Lambert Azimuthal Equal Area", &PLAIN),
        "Albers_Conic_Equal_Area" => ("Albers Equal Area", &CONE),
        "Cassini_Soldner" => ("Cassini-Soldner", &PLAIN),
        "Mercator_1SP" => ("Mercator (variant A)", NATURAL.get(1..)?),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Systems of every method as PROJ writes them (`testdata/crs/projjson.py`).
    #[test]
    fn definitions_have_the_numbers_and_names_of_proj() {
        let text = include_str!("../../../../testdata/crs/projjson.json");
        let expected: Value = serde_json::from_str(text).unwrap();
        let systems = expected.as_array().unwrap();
        assert!(systems.len() > 20);
        for system in systems {
            let code = system["id"]["code"].as_u64().unwrap() as u32;
            let found = projjson(code).unwrap();
            for key in ["type", "name", "id"] {
                assert_eq!(found[key], system[key], "EPSG:{code}");
            }
            assert_eq!(found["base_crs"]["id"], system["base_crs"]["id"]);
            let method = found["conversion"]["method"]["name"].as_str().unwrap();
            assert_eq!(method, system["conversion"]["method"]["name"], "EPSG:{code}");
            let directions = |of: &Value| {
                let axes = of["coordinate_system"]["axis"].as_array().unwrap().iter();
                axes.map(|axis| axis["direction"].clone()).collect::<Vec<_>>()
            };
            assert_eq!(directions(&found), directions(system), "EPSG:{code}");
            for expected in system["conversion"]["parameters"].as_array().unwrap() {
                let own = found["conversion"]["parameters"].as_array().unwrap().iter();
                let Some(own) = own.clone().find(|p| p["name"] == expected["name"]) else {
                    // The table leaves out the equator, about which every Mercator projection is.
                    assert_eq!(
                        (method, expected["value"].as_f64()),
                        ("Mercator (variant A)", Some(0.0))
                    );
                    continue;
                };
                let value = |of: &Value| of["value"].as_f64().unwrap();
                assert!(
                    (value(own) - value(expected)).abs() < 1e-9,
                    "EPSG:{code}: {own} {expected}"
                );
                assert!(
                    is_same_unit(&own["unit"], &expected["unit"]),
                    "EPSG:{code}: {own} {expected}"
                );
            }
            let datum = system["base_crs"].get("datum_ensemble");
            let datum = datum.unwrap_or(&system["base_crs"]["datum"]);
            let [own, expected] = [&found["base_crs"]["datum"], datum].map(|datum| &datum["ellipsoid"]);
            let [major, expected_major] = [own, expected].map(|e| metres(&e["semi_major_axis"]));
            assert!((major / expected_major - 1.0).abs() < 1e-12, "EPSG:{code}");
            let [own, expected] = [own, expected].map(inverse_flattening);
            assert!(
                (own - expected).abs() < 1e-9 * expected,
                "EPSG:{code}: {own} {expected}"
            );
        }
    }

    /// Compound systems as PROJ writes them (`testdata/crs/compound.py`).
    #[test]
    fn heights_of_compound_systems_are_defined_as_by_proj() {
        let text = include_str!("../../../../testdata/crs/compound.json");
        let expected: Value = serde_json::from_str(text).unwrap();
        for system in expected["projjson"].as_array().unwrap() {
            let code = system["id"]["code"].as_u64().unwrap();
            let found = projjson(code as u32).unwrap();
            for key in ["$schema", "type", "name", "id"] {
                assert_eq!(found[key], system[key], "EPSG:{code}");
            }
            assert_eq!(found["components"][0]["name"], system["components"][0]["name"]);
            for key in ["type", "name", "datum", "coordinate_system"] {
                assert_eq!(
                    found["components"][1][key], system["components"][1][key],
                    "EPSG:{code}"
                );
            }
        }
        // In degrees.
        assert_eq!(projjson(9518), None);
    }

    /// A length, in metres or with a unit of its own.
    fn metres(length: &Value) -> f64 {
        let in_unit = || Some(length["value"].as_f64()? * length["unit"]["conversion_factor"].as_f64()?);
        length.as_f64().or_else(in_unit).unwrap()
    }

    /// Some ellipsoids are given by both axes.
    fn inverse_flattening(ellipsoid: &Value) -> f64 {
        let by_axes = || {
            let [major, minor] = ["semi_major_axis", "semi_minor_axis"].map(|key| metres(&ellipsoid[key]));
            major / (major - minor)
        };
        ellipsoid["inverse_flattening"].as_f64().unwrap_or_else(by_axes)
    }

    /// Both by name, or of one size.
    fn is_same_unit(a: &Value, b: &Value) -> bool {
        let size = |unit: &Value| unit.get("conversion_factor").and_then(Value::as_f64);
        match (size(a), size(b)) {
            (Some(a), Some(b)) => (a / b - 1.0).abs() < 1e-12,
            _ => a == b,
        }
    }

    #[test]
    fn systems_about_a_pole_and_rare_methods_have_none() {
        // Polar stereographic, azimuthal about the pole, American polyconic, and a code that nobody gave.
        for code in [3031, 3571, 5880, 999_999] {
            assert_eq!(projjson(code), None, "EPSG:{code}");
        }
    }
}
