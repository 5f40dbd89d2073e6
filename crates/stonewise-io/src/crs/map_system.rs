//! Geographic, geocentric and projected systems with all that is needed to project into them.

use super::ellipsoid::Ellipsoid;
use super::epsg;
use super::projection::{MapOrigin, Projection};
use super::wkt::Node;
use std::f64::consts::FRAC_PI_2;

/// A system that is tied to the earth.
#[derive(Clone, Debug, PartialEq)]
pub struct MapSystem {
    /// Name, as the definition has it.
    pub name: String,
    /// Geodetic datum, in small letters and digits; WGS 84 and ETRS89 are one here.
    datum: String,
    /// Code of the geographic system under it, where that is given.
    geographic: Option<i32>,
    /// Ellipsoid of the datum.
    pub ellipsoid: Ellipsoid,
    /// What the coordinates are.
    pub coordinates: Coordinates,
    /// The vertical system whose heights are above a geoid, by its name; `None` for ellipsoidal heights.
    pub heights: Option<String>,
}

/// Kind of coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinates {
    /// Earth-centred x, y, z, metres.
    Geocentric,
    /// Latitude and longitude.
    Geographic,
    /// Easting and northing, metres.
    Projected(Projection),
}

impl MapSystem {
    /// The system that a WKT (1 or 2) or `EPSG:` and a code define; `None` for a local frame. Codes of a horizontal
    /// and a vertical system may stand together, as in `EPSG:25832+7837`.
    ///
    /// # Errors
    /// Why the system is not covered: another projection, units that are not metres, depths instead of heights, a
    /// code that is not known, a text that cannot be understood.
    pub fn parse(text: &str) -> Result<Option<Self>, String> {
        let text = text.trim();
        if let Some(code) = text.strip_prefix("EPSG:") {
            let wkt = epsg::definition(code)
                .ok_or_else(|| format!("{text} is not among the systems known by their number"))?;
            return Self::parse(&wkt);
        }
        let node = Node::parse(text).ok_or("the definition of the system cannot be understood")?;
        Self::of(&node)
    }

    /// Whether two systems are on one geodetic datum. WGS 84 and ETRS89, whose ellipsoids differ by 0.1 mm,
    /// count as one.
    pub fn shares_datum(&self, other: &Self) -> bool {
        let (a, b) = (&self.ellipsoid, &other.ellipsoid);
        let same_size = (a.semi_major_m - b.semi_major_m).abs() < 1e-3;
        let same_shape = (a.flattening() - b.flattening()).abs() < 1e-9;
        let same_code = self.geographic.is_some() && self.geographic == other.geographic;
        same_size && same_shape && (same_code || self.datum == other.datum)
    }

    fn of(node: &Node<'_>) -> Result<Option<Self>, String> {
        match node.keyword.to_ascii_uppercase().as_str() {
            "COMPD_CS" | "COMPOUNDCRS" => {
                let flat = node.children.iter().find(|c| c.is_crs());
                let Some(flat) = flat.map_or(Ok(None), Self::of)? else {
                    return Ok(None);
                };
                let vertical = node.child(&["VERT_CS", "VERTCRS", "VERTICALCRS"]);
                vertical.map_or(Ok(()), check_heights)?;
                let heights = vertical.filter(|vertical| is_geoid(vertical));
                let heights = heights.map(|heights| heights.name().unwrap_or_default());
                Ok(Some(Self { heights, ..flat }))
            }
            "BOUNDCRS" => {
                let source = node
                    .child(&["SOURCECRS"])
                    .and_then(|source| source.children.first());
                source.map_or(Ok(None), Self::of)
            }
            "GEOGCS" | "GEOGCRS" | "GEOGRAPHICCRS" => {
                Self::earthly(node, node, Coordinates::Geographic).map(Some)
            }
            "GEOCCS" => Self::earthly(node, node, Coordinates::Geocentric).map(Some),
            "GEODCRS" | "GEODETICCRS" => {
                let coordinates = if node.is_cartesian() {
                    Coordinates::Geocentric
                } else {
                    Coordinates::Geographic
                };
                Self::earthly(node, node, coordinates).map(Some)
            }
            "PROJCS" | "PROJCRS" | "PROJECTEDCRS" => {
                let base = node.child(&["GEOGCS", "BASEGEOGCRS", "BASEGEODCRS"]);
                let base = base.ok_or("the definition names no geographic system")?;
                let projection = projection(node, base)?;
                Self::earthly(node, base, Coordinates::Projected(projection)).map(Some)
            }
            "LOCAL_CS" | "ENGCRS" | "ENGINEERINGCRS" => Ok(None),
            other => Err(format!("{other:?} is no kind of system that is known")),
        }
    }

    fn earthly(node: &Node<'_>, base: &Node<'_>, coordinates: Coordinates) -> Result<Self, String> {
        let datum = base.child(&["DATUM", "GEODETICDATUM", "TRF", "ENSEMBLE"]);
        let datum = datum.ok_or("the definition names no datum")?;
        let spheroid = datum.child(&["SPHEROID", "ELLIPSOID"]);
        let number = |place: usize| spheroid.and_then(|s| s.values.get(place)?.parse::<f64>().ok());
        let (Some(semi_major_m), Some(inverse_flattening)) = (number(1), number(2)) else {
            return Err("the definition names no ellipsoid".to_owned());
        };
        if !(6e6..7e6).contains(&semi_major_m) || !(inverse_flattening == 0.0 || inverse_flattening > 100.0) {
            return Err("the definition has an impossible ellipsoid".to_owned());
        }
        Ok(Self {
            name: node.name().unwrap_or_default(),
            datum: datum_name(&datum.name().unwrap_or_default()),
            geographic: base.code(),
            ellipsoid: Ellipsoid {
                semi_major_m,
                inverse_flattening,
            },
            coordinates,
            heights: None,
        })
    }
}

/// Small letters and digits of a datum's name. Map programs take WGS 84 and ETRS89 for the same, and so do
/// the files they write.
fn datum_name(name: &str) -> String {
    let plain = plain(name);
    let bare = plain
        .strip_prefix('d')
        .filter(|_| name.starts_with("D_"))
        .unwrap_or(&plain);
    let same = [
        "wgs84",
        "wgs1984",
        "worldgeodeticsystem1984",
        "worldgeodeticsystem1984ensemble",
        "etrs89",
        "etrs1989",
        "europeanterrestrialreferencesystem1989",
        "europeanterrestrialreferencesystem1989ensemble",
    ];
    if same.contains(&bare) { "wgs84" } else { bare }.to_owned()
}

/// Whether a vertical system counts heights from anything but the ellipsoid.
fn is_geoid(vertical: &Node<'_>) -> bool {
    !vertical.text.to_lowercase().contains("ellipsoid")
}

/// Refuses heights that are not in metres or count downwards.
fn check_heights(vertical: &Node<'_>) -> Result<(), String> {
    if !is_in_metres(vertical) {
        return Err("the unit of its heights is not the metre".to_owned());
    }
    let direction = vertical.child(&["AXIS"]).and_then(|axis| axis.values.get(1));
    if direction.is_some_and(|direction| direction.eq_ignore_ascii_case("down")) {
        return Err("its heights count downwards".to_owned());
    }
    Ok(())
}

/// Whether the unit of a projected or vertical system is the metre; a missing unit counts as metres. In WKT 2, the unit
/// may stand in the axes.
fn is_in_metres(node: &Node<'_>) -> bool {
    const UNIT: [&str; 2] = ["UNIT", "LENGTHUNIT"];
    let of_axis = || node.child(&["AXIS"])?.child(&UNIT);
    let unit = node.child(&UNIT).or_else(of_axis);
    unit.is_none_or(|unit| unit.factor() == Some(1.0))
}

fn projection(node: &Node<'_>, base: &Node<'_>) -> Result<Projection, String> {
    let conversion = node.child(&["CONVERSION"]).unwrap_or(node);
    let method = conversion.child(&["PROJECTION", "METHOD"]).and_then(Node::name);
    let method = method.unwrap_or_default();
    if !is_in_metres(node) {
        return Err("its unit is not the metre".to_owned());
    }
    let parameters = Parameters {
        conversion,
        radians: base.child(&["UNIT", "ANGLEUNIT"]).and_then(Node::factor),
        meridian: base
            .child(&["PRIMEM"])
            .and_then(|m| m.values.get(1)?.parse().ok())
            .unwrap_or(0.0),
    };
    let scale = parameters
        .plain(&[
            "scalefactor",
            "scalefactoratnaturalorigin",
            "scalefactoratprojectioncentre",
            "scalefactoroninitialline",
            "scalefactoronpseudostandardparallel",
        ])
        .unwrap_or(1.0);
    let origin = parameters.origin();
    let possible = scale > 0.0 && origin.latitude.abs() < 1.6 && origin.longitude.abs() < 7.0;
    if !possible {
        return Err("its projection has impossible parameters".to_owned());
    }
    match plain(&method).as_str() {
        "transversemercator" | "gausskruger" | "gausskrueger" => {
            Ok(Projection::TransverseMercator { origin, scale })
        }
        "lambertconformalconic"
        | "lambertconformalconic1sp"
        | "lambertconicconformal1sp"
        | "lambertconformalconic2sp"
        | "lambertconicconformal2sp" => {
            let parallels = parameters.parallels(origin.latitude)?;
            if parallels.iter().any(|p| p.abs() < 1e-6) || parallels[0] * parallels[1] < 0.0 {
                return Err("its cone has impossible parallels".to_owned());
            }
            Ok(Projection::LambertConic {
                origin,
                parallels,
                scale,
            })
        }
        "mercator" | "mercator1sp" | "mercator2sp" | "mercatorvarianta" | "mercatorvariantb" => {
            let parallel = parameters.angle(&FIRST_PARALLEL).unwrap_or(0.0);
            if parallel.abs() > 1.5 || origin.latitude.abs() > 1e-9 {
                return Err("its cylinder has an impossible parallel".to_owned());
            }
            Ok(Projection::Mercator {
                origin,
                parallel,
                scale,
            })
        }
        "polarstereographic" | "polarstereographicvarianta" | "polarstereographicvariantb" => {
            let standard = parameters.angle(&["latitudeofstandardparallel"]);
            let parallel = standard.unwrap_or(origin.latitude);
            if !(0.5..1.571).contains(&parallel.abs()) {
                return Err("it is not stereographic about a pole".to_owned());
            }
            Ok(Projection::PolarStereographic {
                origin: MapOrigin {
                    latitude: FRAC_PI_2.copysign(parallel),
                    ..origin
                },
                parallel,
                scale,
            })
        }
        "obliquestereographic" | "doublestereographic" => {
            Ok(Projection::ObliqueStereographic { origin, scale })
        }
        "swissobliquemercator" | "swissobliquecylindrical" => {
            Ok(Projection::ObliqueCylinder { origin, scale })
        }
        "hotineobliquemercatorazimuthcenter" | "hotineobliquemercatorvariantb"
            if parameters.is_level_cylinder() =>
        {
            Ok(Projection::ObliqueCylinder { origin, scale })
        }
        "krovak" | "krovaknorthorientated" => {
            let from_pole = parameters.angle(&["azimuth", "colatitudeofconeaxis"]);
            let parallel = parameters.angle(&["pseudostandardparallel1", "latitudeofpseudostandardparallel"]);
            let (Some(from_pole), Some(parallel)) = (from_pole, parallel) else {
                return Err("its cone has no axis or no parallel".to_owned());
            };
            if !(0.0..1.57).contains(&from_pole) || !(0.1..1.57).contains(&parallel) {
                return Err("its cone has an impossible axis or parallel".to_owned());
            }
            Ok(Projection::Krovak {
                origin,
                from_pole,
                parallel,
                scale,
            })
        }
        "lambertazimuthalequalarea" => Ok(Projection::AzimuthalEqualArea { origin }),
        "albersconicequalarea" | "albersequalarea" => {
            let parallels = parameters.parallels(origin.latitude)?;
            Ok(Projection::AlbersConic { origin, parallels })
        }
        _ => Err(format!("its projection, {method:?}, is not covered")),
    }
}

const FIRST_PARALLEL: [&str; 2] = ["standardparallel1", "latitudeof1ststandardparallel"];
const SECOND_PARALLEL: [&str; 2] = ["standardparallel2", "latitudeof2ndstandardparallel"];

/// The parameters of a projection.
struct Parameters<'a> {
    conversion: &'a Node<'a>,
    /// Size of the unit of angles in WKT 1.
    radians: Option<f64>,
    /// Prime meridian, degrees from Greenwich.
    meridian: f64,
}

impl Parameters<'_> {
    fn origin(&self) -> MapOrigin {
        let latitude = [
            "latitudeoforigin",
            "latitudeofnaturalorigin",
            "latitudeoffalseorigin",
            "latitudeofcenter",
            "latitudeofprojectioncentre",
        ];
        let longitude = [
            "centralmeridian",
            "longitudeofnaturalorigin",
            "longitudeoffalseorigin",
            "longitudeoforigin",
            "longitudeofcenter",
            "longitudeofprojectioncentre",
        ];
        let east = self.length(&[
            "falseeasting",
            "eastingatfalseorigin",
            "eastingatprojectioncentre",
        ]);
        let north = self.length(&[
            "falsenorthing",
            "northingatfalseorigin",
            "northingatprojectioncentre",
        ]);
        let latitude = self.angle(&latitude).unwrap_or(0.0);
        // Definitions round the size of a degree, and a pole must not lie beyond itself.
        let is_pole = (latitude.abs() - FRAC_PI_2).abs() < 1e-9;
        MapOrigin {
            latitude: if is_pole {
                FRAC_PI_2.copysign(latitude)
            } else {
                latitude
            },
            longitude: self.angle(&longitude).unwrap_or(0.0) + self.meridian.to_radians(),
            false_m: [east.unwrap_or(0.0), north.unwrap_or(0.0)],
        }
    }

    /// The parallels of a cone; `only`: the one of a cone without any of its own.
    fn parallels(&self, only: f64) -> Result<[f64; 2], String> {
        let first = self.angle(&FIRST_PARALLEL).unwrap_or(only);
        let parallels = [first, self.angle(&SECOND_PARALLEL).unwrap_or(first)];
        let is_flat = (parallels[0] + parallels[1]).abs() < 1e-6;
        if is_flat || parallels.iter().any(|p| p.abs() > 1.57) {
            return Err("its cone has impossible parallels".to_owned());
        }
        Ok(parallels)
    }

    /// Whether an oblique cylinder touches the earth along the great circle that crosses the meridian of the
    /// centre at right angles, and north is up.
    fn is_level_cylinder(&self) -> bool {
        let is_right = |names: &[&str]| self.angle(names).is_some_and(|a| (a - FRAC_PI_2).abs() < 1e-9);
        is_right(&["azimuth", "azimuthofinitialline", "azimuthatprojectioncentre"])
            && is_right(&["rectifiedgridangle", "anglefromrectifiedtoskewgrid"])
    }

    fn node(&self, names: &[&str]) -> Option<&Node<'_>> {
        let is_named = |n: &&Node| {
            n.name()
                .is_some_and(|name| names.contains(&plain(&name).as_str()))
        };
        let parameters = self.conversion.children.iter();
        parameters
            .filter(|n| n.keyword.eq_ignore_ascii_case("PARAMETER"))
            .find(is_named)
    }

    fn plain(&self, names: &[&str]) -> Option<f64> {
        let value: f64 = self.node(names)?.values.get(1)?.parse().ok()?;
        Some(value).filter(|v| v.is_finite())
    }

    /// Metres: in WKT 2 a parameter may have a unit of its own.
    fn length(&self, names: &[&str]) -> Option<f64> {
        let own = self.node(names)?.child(&["LENGTHUNIT", "UNIT"]);
        Some(self.plain(names)? * own.and_then(Node::factor).unwrap_or(1.0))
    }

    fn angle(&self, names: &[&str]) -> Option<f64> {
        let own = self
            .node(names)?
            .child(&["ANGLEUNIT", "UNIT"])
            .and_then(Node::factor);
        let radians = own.or(self.radians).unwrap_or(std::f64::consts::PI / 180.0);
        Some(self.plain(names)? * radians)
    }
}

fn plain(name: &str) -> String {
    let letters = name.chars().filter(char::is_ascii_alphanumeric);
    letters.map(|c| c.to_ascii_lowercase()).collect()
}
