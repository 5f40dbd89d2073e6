//! Definitions of the systems that clouds often name by their number alone.

use std::fmt::Write as _;

/// An ellipsoid: name, semi-major axis in metres, inverse flattening.
type Spheroid = (&'static str, &'static str, &'static str);

const WGS_84_SPHEROID: Spheroid = ("WGS 84", "6378137", "298.257223563");
const GRS_1980: Spheroid = ("GRS 1980", "6378137", "298.257222101");
const BESSEL_1841: Spheroid = ("Bessel 1841", "6377397.155", "299.1528128");
const AIRY_1830: Spheroid = ("Airy 1830", "6377563.396", "299.3249646");

/// A geodetic system: its number in the EPSG register, names of the system and of its datum, ellipsoid.
struct Base(u32, &'static str, &'static str, Spheroid);

const WGS84: Base = Base(4326, "WGS 84", "WGS_1984", WGS_84_SPHEROID);
const ETRS89: Base = Base(
    4258,
    "ETRS89",
    "European_Terrestrial_Reference_System_1989",
    GRS_1980,
);
const DHDN: Base = Base(4314, "DHDN", "Deutsches_Hauptdreiecksnetz", BESSEL_1841);
const MGI: Base = Base(4312, "MGI", "Militar-Geographische_Institut", BESSEL_1841);
const RGF93: Base = Base(4171, "RGF93", "Reseau_Geodesique_Francais_1993", GRS_1980);
const OSGB36: Base = Base(4277, "OSGB 1936", "OSGB_1936", AIRY_1830);
const SWEREF99: Base = Base(4619, "SWEREF99", "SWEREF99", GRS_1980);

/// Parameters of a transverse Mercator grid: origin in degrees, scale, false easting and northing in metres.
struct Grid {
    latitude: f64,
    meridian: f64,
    scale: f64,
    false_m: [f64; 2],
}

/// The definition of a system as WKT 1; `None` where this table does not have it.
///
/// Source: EPSG Geodetic Parameter Dataset; checked against PROJ (testdata/crs).
pub fn definition(code: u32) -> Option<String> {
    let utm = |zone: u32, false_north: f64| Grid {
        latitude: 0.0,
        meridian: f64::from(zone) * 6.0 - 183.0,
        scale: 0.9996,
        false_m: [500_000.0, false_north],
    };
    let gauss_krueger = |meridian: f64, false_m| Grid {
        latitude: 0.0,
        meridian,
        scale: 1.0,
        false_m,
    };
    let (name, base, grid) = match code {
        4326 => return Some(geographic(&WGS84)),
        4258 => return Some(geographic(&ETRS89)),
        4314 => return Some(geographic(&DHDN)),
        2154 => return Some(lambert_93()),
        32_601..=32_660 => {
            let zone = code - 32_600;
            (format!("WGS 84 / UTM zone {zone}N"), &WGS84, utm(zone, 0.0))
        }
        32_701..=32_760 => {
            let zone = code - 32_700;
            (
                format!("WGS 84 / UTM zone {zone}S"),
                &WGS84,
                utm(zone, 10_000_000.0),
            )
        }
        25_828..=25_838 => {
            let zone = code - 25_800;
            (format!("ETRS89 / UTM zone {zone}N"), &ETRS89, utm(zone, 0.0))
        }
        31_466..=31_469 => {
            let zone = code - 31_464;
            let east = f64::from(zone) * 1e6 + 500_000.0;
            let grid = gauss_krueger(f64::from(zone) * 3.0, [east, 0.0]);
            (format!("DHDN / 3-degree Gauss-Kruger zone {zone}"), &DHDN, grid)
        }
        31_254..=31_256 => {
            let number = code - 31_254;
            let meridian = [10.0, 13.0, 16.0][number as usize] + 1.0 / 3.0;
            let grid = gauss_krueger(meridian, [0.0, -5_000_000.0]);
            let zone = ["West", "Central", "East"][number as usize];
            (format!("MGI / Austria GK {zone}"), &MGI, grid)
        }
        27_700 => {
            let grid = Grid {
                latitude: 49.0,
                meridian: -2.0,
                scale: 0.999_601_271_7,
                false_m: [400_000.0, -100_000.0],
            };
            ("OSGB 1936 / British National Grid".to_owned(), &OSGB36, grid)
        }
        3006 => ("SWEREF99 TM".to_owned(), &SWEREF99, utm(33, 0.0)),
        _ => return None,
    };
    Some(transverse_mercator(code, &name, base, &grid))
}

fn geographic(base: &Base) -> String {
    let Base(epsg, name, datum, (spheroid, semi_major, inverse)) = base;
    format!(
        "GEOGCS[\"{name}\",DATUM[\"{datum}\",SPHEROID[\"{spheroid}\",{semi_major},{inverse}]],PRIMEM[\"Greenwich\",0],\
         UNIT[\"degree\",0.0174532925199433],AUTHORITY[\"EPSG\",\"{epsg}\"]]"
    )
}

fn transverse_mercator(code: u32, name: &str, base: &Base, grid: &Grid) -> String {
    let parameters = [
        ("latitude_of_origin", grid.latitude),
        ("central_meridian", grid.meridian),
        ("scale_factor", grid.scale),
        ("false_easting", grid.false_m[0]),
        ("false_northing", grid.false_m[1]),
    ];
    projected(code, name, base, "Transverse_Mercator", &parameters)
}

fn lambert_93() -> String {
    let parameters = [
        ("latitude_of_origin", 46.5),
        ("central_meridian", 3.0),
        ("standard_parallel_1", 49.0),
        ("standard_parallel_2", 44.0),
        ("false_easting", 700_000.0),
        ("false_northing", 6_600_000.0),
    ];
    projected(
        2154,
        "RGF93 / Lambert-93",
        &RGF93,
        "Lambert_Conformal_Conic_2SP",
        &parameters,
    )
}

fn projected(code: u32, name: &str, base: &Base, method: &str, parameters: &[(&str, f64)]) -> String {
    let mut text = format!("PROJCS[\"{name}\",{},PROJECTION[\"{method}\"]", geographic(base));
    for (name, value) in parameters {
        let _ = write!(text, ",PARAMETER[\"{name}\",{value}]");
    }
    let _ = write!(
        text,
        ",UNIT[\"metre\",1],AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]"
    );
    let _ = write!(text, ",AUTHORITY[\"EPSG\",\"{code}\"]]");
    text
}
