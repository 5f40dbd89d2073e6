//! Units of coordinates: how large they are, and the same system with coordinates in metres.

use super::epsg::definition;
use super::wkt::Node;
use nalgebra::{Point3, Vector3};
use std::fmt;

/// Sizes of the units of a system's coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Units {
    /// Of eastings and northings, metres; 1 where they are degrees.
    pub plane_m: f64,
    /// Of heights, metres.
    pub height_m: f64,
    /// Whether the first two coordinates are latitude and longitude.
    pub is_geographic: bool,
}

/// Codes of systems in other units than metres that the table does not have, because WKT 1 cannot express them (EPSG
/// Geodetic Parameter Dataset 11.022): Vanua Levu, Michigan's cone, Tunisia's mines, Namibia.
const UNDEFINED: [u32; 14] = [
    3139, 6200, 6201, 6202, 6966, 22300, 29371, 29373, 29375, 29377, 29379, 29381, 29383, 29385,
];
/// Units that differ from the metre by a smaller share are metres: 0.6 mm in a northing of 6,000 km.
const SAME: f64 = 1e-10;

impl Units {
    /// Metres in every direction.
    pub const METRES: Self = Self {
        plane_m: 1.0,
        height_m: 1.0,
        is_geographic: false,
    };

    /// The units of the system that a text names: WKT 1 or 2, or `EPSG:` and a code. Without a vertical system, heights
    /// are in the unit of the plane. Metres where the text states no unit.
    ///
    /// # Errors
    /// Why the size of a unit is not known.
    pub fn of(text: &str) -> Result<Self, String> {
        let text = text.trim();
        if let Some(code) = text.strip_prefix("EPSG:") {
            let Some(wkt) = definition(code) else {
                return match code.trim().parse().is_ok_and(|code| UNDEFINED.contains(&code)) {
                    true => Err(format!(
                        "{text} is not in metres, and its definition is not known"
                    )),
                    false => Ok(Self::METRES),
                };
            };
            return Self::of(&wkt);
        }
        Node::parse(text).map_or(Ok(Self::METRES), |node| Self::of_node(&node))
    }

    fn of_node(node: &Node<'_>) -> Result<Self, String> {
        match kind(node) {
            Kind::Compound => {
                let plane = node.children.iter().find(|c| c.is_crs());
                let plane = plane.map_or(Ok(Self::METRES), Self::of_node)?;
                let vertical = node.children.iter().find(|c| kind(c) == Kind::Vertical);
                let height_m = vertical.and_then(|v| size(v, false).transpose()).transpose()?;
                Ok(Self {
                    height_m: height_m.unwrap_or(plane.height_m),
                    ..plane
                })
            }
            Kind::Bound => {
                let source = node.child(&["SOURCECRS"]).and_then(|s| s.children.first());
                source.map_or(Ok(Self::METRES), Self::of_node)
            }
            Kind::Geographic => Ok(Self {
                is_geographic: true,
                ..Self::METRES
            }),
            Kind::Lengths => {
                let plane_m = size(node, false)?.unwrap_or(1.0);
                Ok(Self {
                    plane_m,
                    height_m: size(node, true)?.unwrap_or(plane_m),
                    is_geographic: false,
                })
            }
            Kind::Vertical | Kind::Other => Ok(Self::METRES),
        }
    }

    /// Whether both units are the metre.
    pub fn are_metres(&self) -> bool {
        is_metre(self.plane_m) && is_metre(self.height_m)
    }

    /// Metres in a step of one unit along x, y and z.
    pub fn step_m(&self) -> Vector3<f64> {
        Vector3::new(self.plane_m, self.plane_m, self.height_m)
    }

    /// A position in metres.
    pub fn to_metres(&self, p: Point3<f64>) -> Point3<f64> {
        Point3::from(p.coords.component_mul(&self.step_m()))
    }
}

/// Whether a unit of this size is a foot: the international one, that of the US survey, or one of older maps.
pub fn is_foot(size_m: f64) -> bool {
    (size_m - 0.3048).abs() < 1e-5
}

/// As `feet (0.3048 m)`; units without a name here by their size alone.
pub struct UnitName(pub f64);

impl fmt::Display for UnitName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match is_foot(self.0) {
            true => write!(f, "feet ({} m)", self.0),
            false => write!(f, "units of {} m", self.0),
        }
    }
}

/// Sizes of units of length by their code, metres (EPSG Geodetic Parameter Dataset 11.022).
pub fn unit_of_code(code: u16) -> Option<f64> {
    Some(match code {
        1025 => 1e-3,
        1033 => 1e-2,
        9001 => 1.0,
        9002 => 0.3048,
        9003 => 1200.0 / 3937.0,
        9005 => 0.3047972654,
        9014 => 1.8288,
        9030 => 1852.0,
        9031 => 1.0000135965,
        9036 => 1000.0,
        9041 => 0.304799471538676,
        9070 => 0.304800833333333,
        9080 => 0.304799510248147,
        9084 => 0.914398530744441,
        9094 => 0.304799710181509,
        9095 => 0.3048007491,
        9096 => 0.9144,
        9098 => 0.201168,
        _ => return None,
    })
}

/// The same system with eastings, northings and heights in metres, as WKT: that which [`Units::to_metres`] gives
/// positions in. A text in metres stays as it is; what changes loses its code, and its name says so.
pub fn in_metres(text: &str) -> String {
    let text = text.trim();
    let is_known = |units: &Units| !units.are_metres();
    if Units::of(text).ok().filter(is_known).is_none() {
        return text.to_owned();
    }
    let by_code = text.strip_prefix("EPSG:").and_then(definition);
    let text = by_code.as_deref().unwrap_or(text);
    Node::parse(text).map_or_else(|| text.to_owned(), |node| restated(&node))
}

/// A system, or a compound of some, in metres.
fn restated(node: &Node<'_>) -> String {
    let own = |c: &Node<'_>| matches!(c.keyword.to_ascii_uppercase().as_str(), "AUTHORITY" | "ID");
    match kind(node) {
        Kind::Compound | Kind::Bound => {
            let changed = node.edited(&|child| match child.keyword.eq_ignore_ascii_case("SOURCECRS") {
                true => Some(child.edited(&|system| Some(restated(system)))),
                false if own(child) => Some(String::new()),
                false => Some(restated(child)),
            });
            match Units::of_node(node).is_ok_and(|units| units.are_metres()) {
                true => node.text.to_owned(),
                false => changed,
            }
        }
        Kind::Lengths | Kind::Vertical => {
            let [plane_m, up_m] = [false, true].map(|up| size(node, up).ok().flatten().unwrap_or(1.0));
            if is_metre(plane_m) && is_metre(up_m) {
                return node.text.to_owned();
            }
            let changed = node.edited(&|child| match child.keyword.to_ascii_uppercase().as_str() {
                // A code, and a definition for one program alone.
                "AUTHORITY" | "ID" | "EXTENSION" => Some(String::new()),
                "PARAMETER" => parameter_in_metres(child, plane_m),
                "CONVERSION" => Some(child.edited(&|part| parameter_in_metres(part, plane_m))),
                "AXIS" => Some(child.edited(&|part| is_length_unit(part).then(|| metre(part)))),
                _ => is_length_unit(child).then(|| metre(child)),
            });
            let name = node.name().unwrap_or_default();
            changed.replacen(&format!("\"{name}\""), &format!("\"{name} in metres\""), 1)
        }
        Kind::Geographic | Kind::Other => node.text.to_owned(),
    }
}

/// A false easting or northing in the unit of its system; those with a unit of their own stay as they are.
fn parameter_in_metres(node: &Node<'_>, unit_m: f64) -> Option<String> {
    let name = node.name()?.to_ascii_lowercase();
    let is_length = name.contains("easting") || name.contains("northing");
    let has_unit = is_metre(unit_m) || node.child(&["UNIT", "LENGTHUNIT"]).is_some();
    if !node.keyword.eq_ignore_ascii_case("PARAMETER") || !is_length || has_unit {
        return None;
    }
    let value = node.values.get(1)?;
    let metres = value.parse::<f64>().ok()? * unit_m;
    let (head, tail) = node.text.rsplit_once(value)?;
    Some(format!("{head}{metres}{tail}"))
}

fn metre(unit: &Node<'_>) -> String {
    format!("{}[\"metre\",1]", unit.keyword)
}

fn is_length_unit(node: &Node<'_>) -> bool {
    ["UNIT", "LENGTHUNIT"]
        .iter()
        .any(|k| node.keyword.eq_ignore_ascii_case(k))
}

/// The unit of the axis that points up (or down), or of the others: in WKT 2 each axis may have its own.
fn size(node: &Node<'_>, up: bool) -> Result<Option<f64>, String> {
    let is_up = |axis: &Node<'_>| {
        let direction = axis.values.get(1).copied().unwrap_or_default();
        ["up", "down"].iter().any(|d| direction.eq_ignore_ascii_case(d))
    };
    let is_vertical = kind(node) == Kind::Vertical;
    let axes = node
        .children
        .iter()
        .filter(|c| c.keyword.eq_ignore_ascii_case("AXIS"));
    let axis = axes.into_iter().find(|axis| is_vertical || is_up(axis) == up);
    let unit = axis.and_then(|axis| axis.children.iter().find(|c| is_length_unit(c)));
    let unit = unit.or_else(|| node.children.iter().find(|c| is_length_unit(c)));
    let unsized_unit = |unit: &Node<'_>| {
        format!(
            "the size of its unit {:?} is not stated",
            unit.name().unwrap_or_default()
        )
    };
    unit.map(|unit| unit.factor().ok_or_else(|| unsized_unit(unit)))
        .transpose()
}

fn is_metre(size_m: f64) -> bool {
    (size_m - 1.0).abs() < SAME
}

/// What the coordinates of a system are.
#[derive(PartialEq)]
enum Kind {
    Compound,
    Bound,
    Geographic,
    /// Eastings and northings, or x, y and z.
    Lengths,
    Vertical,
    Other,
}

fn kind(node: &Node<'_>) -> Kind {
    match node.keyword.to_ascii_uppercase().as_str() {
        "COMPD_CS" | "COMPOUNDCRS" => Kind::Compound,
        "BOUNDCRS" => Kind::Bound,
        "GEOGCS" | "GEOGCRS" | "GEOGRAPHICCRS" => Kind::Geographic,
        "GEODCRS" | "GEODETICCRS" if !node.is_cartesian() => Kind::Geographic,
        "PROJCS" | "PROJCRS" | "PROJECTEDCRS" | "GEOCCS" | "GEODCRS" | "GEODETICCRS" | "LOCAL_CS"
        | "ENGCRS" | "ENGINEERINGCRS" => Kind::Lengths,
        "VERT_CS" | "VERTCRS" | "VERTICALCRS" => Kind::Vertical,
        _ => Kind::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Coordinates, Crs, Geodetic, MapSystem};
    use super::*;

    const FOOT: f64 = 0.3048;
    const US_FOOT: f64 = 1200.0 / 3937.0;

    fn units(plane_m: f64, height_m: f64) -> Units {
        Units {
            plane_m,
            height_m,
            is_geographic: false,
        }
    }

    fn projected(unit: &str) -> String {
        format!(
            r#"PROJCS["site",GEOGCS["g",DATUM["D",SPHEROID["GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0],
            UNIT["degree",0.0174532925199433]],PROJECTION["Transverse_Mercator"],PARAMETER["central_meridian",9],
            PARAMETER["false_easting",1640416.66666667],{unit},AUTHORITY["EPSG","1"]]"#
        )
    }

    #[test]
    fn the_factor_counts_and_not_the_name() {
        for (unit, size) in [
            (r#"UNIT["US_survey_foot",0.3048006096012192]"#, US_FOOT),
            (r#"UNIT["ft",0.3048]"#, FOOT),
            (r#"UNIT["foot",1]"#, 1.0),
            (r#"UNIT["kilometre",1000]"#, 1000.0),
            (r#"LENGTHUNIT["anything",0.9144,ID["EPSG",9096]]"#, 0.9144),
        ] {
            let found = Units::of(&projected(unit)).unwrap();
            assert!(
                (found.plane_m - size).abs() < 1e-15 && found.plane_m == found.height_m,
                "{unit}"
            );
        }
        assert!(
            Units::of(&projected("UNIT[\"foot\"]"))
                .unwrap_err()
                .contains("\"foot\"")
        );
        let local = Units::of(r#"LOCAL_CS["dam",UNIT["foot",0.3048]]"#);
        assert_eq!(local, Ok(units(FOOT, FOOT)));
        let axes = r#"PROJCRS["a",CS[Cartesian,3],AXIS["E",east,LENGTHUNIT["ft",0.3048]],AXIS["N",north,LENGTHUNIT["ft",0.3048]],
            AXIS["h",up,LENGTHUNIT["metre",1]]]"#;
        assert_eq!(Units::of(axes), Ok(units(FOOT, 1.0)));
    }

    #[test]
    fn heights_have_a_unit_of_their_own() {
        let compound = |plane: &str, heights: &str| {
            let plane = projected(plane);
            Units::of(&format!(
                r#"COMPD_CS["both",{plane},VERT_CS["h",VERT_DATUM["d",2005],{heights}]]"#
            ))
        };
        let (metre, foot) = (r#"UNIT["metre",1]"#, r#"UNIT["ft",0.3048]"#);
        assert_eq!(compound(metre, foot), Ok(units(1.0, FOOT)));
        assert_eq!(compound(foot, metre), Ok(units(FOOT, 1.0)));
        assert_eq!(Units::of("EPSG:2277+5703").unwrap().height_m, 1.0);
        assert!((Units::of("EPSG:25832+6360").unwrap().height_m - US_FOOT).abs() < 1e-14);
    }

    #[test]
    fn degrees_are_told_from_lengths_by_the_kind_of_system() {
        let geodetic = |axes: &str| {
            format!(
                r#"GEODCRS["WGS 84",DATUM["d",ELLIPSOID["e",6378137,298.25]],CS[{axes}],LENGTHUNIT["metre",1]]"#
            )
        };
        assert!(!Units::of(&geodetic("Cartesian,3")).unwrap().is_geographic);
        assert!(Units::of(&geodetic("ellipsoidal,3")).unwrap().is_geographic);
        assert!(Units::of("EPSG:4326").unwrap().is_geographic);
        assert!(!Units::of(&projected(r#"UNIT["metre",1]"#)).unwrap().is_geographic);
        assert!(Units::of("EPSG:6201").unwrap_err().contains("EPSG:6201"));
    }

    /// The projection in metres puts a place where that in its own unit does, times the unit.
    #[test]
    fn a_system_in_metres_is_the_same_projection() {
        let wkt2 = r#"PROJCRS["NAD83 / Texas Central (ftUS)",BASEGEOGCRS["NAD83",DATUM["North American Datum 1983",
            ELLIPSOID["GRS 1980",6378137,298.257222101]],PRIMEM["Greenwich",0]],CONVERSION["c",
            METHOD["Lambert Conic Conformal (2SP)"],PARAMETER["Latitude of false origin",29.6666666666667,ANGLEUNIT["degree",0.0174532925199433]],
            PARAMETER["Longitude of false origin",-100.333333333333,ANGLEUNIT["degree",0.0174532925199433]],
            PARAMETER["Latitude of 1st standard parallel",31.8833333333333,ANGLEUNIT["degree",0.0174532925199433]],
            PARAMETER["Latitude of 2nd standard parallel",30.1166666666667,ANGLEUNIT["degree",0.0174532925199433]],
            PARAMETER["Easting at false origin",2296583.333,LENGTHUNIT["US survey foot",0.304800609601219]],
            PARAMETER["Northing at false origin",9842500.0,LENGTHUNIT["US survey foot",0.304800609601219]]],CS[Cartesian,2],
            AXIS["x",east,ORDER[1],LENGTHUNIT["US survey foot",0.304800609601219]],
            AXIS["y",north,ORDER[2],LENGTHUNIT["US survey foot",0.304800609601219]],ID["EPSG",2277]]"#;
        // EPSG:32139 is Texas Central in metres, with its origin at 700 km and 3000 km.
        let at = Geodetic {
            latitude: 30.4f64.to_radians(),
            longitude: -97.7f64.to_radians(),
            height_m: 0.0,
        };
        let place = |text: &str| {
            let system = MapSystem::parse(text).unwrap().unwrap();
            let Coordinates::Projected(projection) = system.coordinates else {
                panic!("not projected: {text}");
            };
            projection.forward(&system.ellipsoid, &at)
        };
        let expected = place("EPSG:32139");
        for text in ["EPSG:2277", wkt2] {
            let metres = in_metres(text);
            assert_eq!(Units::of(&metres), Ok(Units::METRES));
            let found = place(&metres);
            assert!(
                (found[0] - expected[0]).hypot(found[1] - expected[1]) < 1e-3,
                "{text}: {found:?}"
            );
            let named = Crs::parse(&metres).unwrap();
            assert_eq!(
                (named.epsg, named.name.as_str()),
                (None, "NAD83 / Texas Central (ftUS) in metres")
            );
        }
        let own = in_metres(&projected(r#"UNIT["US survey foot",0.304800609601219]"#));
        assert!(
            (place(&own)[0]
                - place(&projected(r#"UNIT["metre",1]"#).replace("1640416.66666667", "500000"))[0])
                .abs()
                < 1e-3
        );
    }

    #[test]
    fn what_is_in_metres_stays_as_it_is() {
        let utm = definition("25832").unwrap();
        for text in ["EPSG:25832", utm.as_str(), "the dam", "EPSG:5513"] {
            assert_eq!(in_metres(text), text);
        }
        let feet =
            r#"VERT_CS["h",VERT_DATUM["d",2005],UNIT["ft",0.3048],AXIS["h",UP],AUTHORITY["EPSG","9"]]"#;
        let both = in_metres(&format!(r#"COMPD_CS["both",{utm},{feet},AUTHORITY["EPSG","8"]]"#));
        let metres = r#"VERT_CS["h in metres",VERT_DATUM["d",2005],UNIT["metre",1],AXIS["h",UP]]"#;
        assert_eq!(both, format!(r#"COMPD_CS["both",{utm},{metres}]"#));
        assert_eq!(Crs::parse(&both).unwrap().epsg, Some(25832));
    }
}
