//! Definitions of the systems that clouds often name by their number alone.
//!
//! Source: EPSG Geodetic Parameter Dataset 11.022 as in PROJ 9.5.1, packed by `testdata/crs/epsg.py`, which says
//! what the lines hold.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Read as _;
use std::sync::LazyLock;

use flate2::read::ZlibDecoder;

static PACKED: &[u8] = include_bytes!("epsg.tsv.zz");

static TEXT: LazyLock<String> = LazyLock::new(|| {
    let mut text = String::new();
    // A test counts the systems: what is built in is whole.
    let _ = ZlibDecoder::new(PACKED).read_to_string(&mut text);
    text
});

static REGISTER: LazyLock<Register> = LazyLock::new(|| Register::of(&TEXT));

/// The definition of a system as WKT 1; `None` where the table does not have it. `codes`: its code, or those of a
/// horizontal and a vertical system with a plus between them (`25832+7837`).
pub fn definition(codes: &str) -> Option<String> {
    let code = |text: &str| text.trim().parse().ok();
    if let Some((horizontal, vertical)) = codes.split_once('+') {
        return Some(REGISTER.joined(code(horizontal)?, code(vertical)?)?.wkt());
    }
    let code = code(codes)?;
    let horizontal = || REGISTER.horizontal(code).map(|(_, wkt)| wkt);
    horizontal().or_else(|| Some(REGISTER.compound(code)?.wkt()))
}

/// A projected system.
pub fn projected(code: u32) -> Option<Projected> {
    REGISTER.projected(code)
}

/// A compound system.
pub fn compound(code: u32) -> Option<Compound> {
    REGISTER.compound(code)
}

/// A geographic system; numbers are texts, as the table has them.
pub struct Geographic {
    pub code: u32,
    pub name: &'static str,
    /// In WKT 1, with underscores.
    pub datum: &'static str,
    pub spheroid: &'static str,
    pub semi_major_m: &'static str,
    pub inverse_flattening: &'static str,
    pub meridian: &'static str,
    /// Longitude of the prime meridian, from Greenwich, degrees.
    pub meridian_degrees: &'static str,
    pub unit: &'static str,
    pub radians: &'static str,
}

/// A projected system; numbers are texts, as the table has them.
pub struct Projected {
    pub code: u32,
    pub name: String,
    pub base: Geographic,
    /// In WKT 1.
    pub method: &'static str,
    /// Names in WKT 1 and values, in units of the system and of its base.
    pub parameters: Vec<(&'static str, &'static str)>,
    pub unit: &'static str,
    pub metres: &'static str,
    /// Order of the axes in the register: `EN`, `NE`, or empty where one points elsewhere.
    pub axes: &'static str,
}

/// A vertical system; numbers are texts, as the table has them.
pub struct Vertical {
    pub code: u32,
    pub name: &'static str,
    pub datum: &'static str,
    pub unit: &'static str,
    pub metres: &'static str,
    /// `UP` or `DOWN`.
    pub direction: &'static str,
}

/// A projected or geographic system with a vertical one.
pub struct Compound {
    /// Its own code, where it has one.
    pub code: Option<u32>,
    pub name: String,
    /// Code of the projected or geographic system.
    pub horizontal: u32,
    horizontal_wkt: String,
    pub vertical: Vertical,
}

impl Geographic {
    fn wkt(&self) -> String {
        format!(
            "GEOGCS[\"{}\",DATUM[\"{}\",SPHEROID[\"{}\",{},{}]],PRIMEM[\"{}\",{}],UNIT[\"{}\",{}],AUTHORITY[\"EPSG\",\"{}\"]]",
            self.name,
            self.datum,
            self.spheroid,
            self.semi_major_m,
            self.inverse_flattening,
            self.meridian,
            self.meridian_degrees,
            self.unit,
            self.radians,
            self.code
        )
    }
}

impl Projected {
    fn wkt(&self) -> String {
        let (name, base, method) = (&self.name, self.base.wkt(), self.method);
        let mut text = format!("PROJCS[\"{name}\",{base},PROJECTION[\"{method}\"]");
        for (parameter, value) in &self.parameters {
            let _ = write!(text, ",PARAMETER[\"{parameter}\",{value}]");
        }
        let _ = write!(
            text,
            ",UNIT[\"{}\",{}],AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH],AUTHORITY[\"EPSG\",\"{}\"]]",
            self.unit, self.metres, self.code
        );
        text
    }
}

impl Vertical {
    /// Name, abbreviation and direction of the axis.
    pub fn axis(&self) -> (&'static str, &'static str, &'static str) {
        match self.direction {
            "DOWN" => ("Depth", "D", "down"),
            _ => ("Gravity-related height", "H", "up"),
        }
    }

    fn wkt(&self) -> String {
        format!(
            "VERT_CS[\"{}\",VERT_DATUM[\"{}\",2005],UNIT[\"{}\",{}],AXIS[\"{}\",{}],AUTHORITY[\"EPSG\",\"{}\"]]",
            self.name,
            self.datum,
            self.unit,
            self.metres,
            self.axis().0,
            self.direction,
            self.code
        )
    }
}

impl Compound {
    fn wkt(&self) -> String {
        let own = self.code.map(|code| format!(",AUTHORITY[\"EPSG\",\"{code}\"]"));
        format!(
            "COMPD_CS[\"{}\",{},{}{}]",
            self.name,
            self.horizontal_wkt,
            self.vertical.wkt(),
            own.unwrap_or_default()
        )
    }
}

/// The lines of the table, without their kind and code.
#[derive(Default)]
struct Register {
    spheroids: Vec<&'static str>,
    units: Vec<&'static str>,
    methods: Vec<&'static str>,
    /// Code of each geographic system, in the order of the table.
    bases: Vec<u32>,
    geographic: BTreeMap<u32, &'static str>,
    projected: BTreeMap<u32, &'static str>,
    vertical: BTreeMap<u32, &'static str>,
    compound: BTreeMap<u32, &'static str>,
}

impl Register {
    fn of(text: &'static str) -> Self {
        let mut register = Self::default();
        let mut last = [0; 4];
        for line in text.lines() {
            let Some((kind, rest)) = line.split_once('\t') else {
                continue;
            };
            let mut coded = |kind: usize| {
                let (step, rest) = rest.split_once('\t')?;
                last[kind] += step.parse::<u32>().ok()?;
                Some((last[kind], rest))
            };
            match kind {
                "S" => register.spheroids.push(rest),
                "U" => register.units.push(rest),
                "M" => register.methods.push(rest),
                "G" => register.geographic.extend(coded(0)),
                "P" => register.projected.extend(coded(1)),
                "V" => register.vertical.extend(coded(2)),
                _ => register.compound.extend(coded(3)),
            }
        }
        register.bases = register.geographic.keys().copied().collect();
        register
    }

    fn at(&self, lines: &[&'static str], number: &str) -> Option<&'static str> {
        lines.get(number.parse::<usize>().ok()?).copied()
    }

    fn geographic(&self, code: u32) -> Option<Geographic> {
        let [name, datum, spheroid, meridian, meridian_degrees, unit, radians] =
            cells(self.geographic.get(&code)?)[..]
        else {
            return None;
        };
        let [spheroid, semi_major_m, inverse_flattening] = cells(self.at(&self.spheroids, spheroid)?)[..]
        else {
            return None;
        };
        Some(Geographic {
            code,
            name,
            datum,
            spheroid,
            semi_major_m,
            inverse_flattening,
            meridian,
            meridian_degrees,
            unit,
            radians,
        })
    }

    fn projected(&self, code: u32) -> Option<Projected> {
        let line = cells(self.projected.get(&code)?);
        let [name, base, method, unit, ref values @ ..] = line[..] else {
            return None;
        };
        let base = self.geographic(*self.bases.get(base.parse::<usize>().ok()?)?)?;
        let name = match name.strip_prefix('/') {
            Some(rest) => format!("{} / {rest}", base.name),
            None => name.to_owned(),
        };
        let method = cells(self.at(&self.methods, method)?);
        let (method, parameters) = method.split_first()?;
        let [unit, metres, axes] = cells(self.at(&self.units, unit)?)[..] else {
            return None;
        };
        let parameters = parameters.iter().copied().zip(values.iter().copied());
        Some(Projected {
            code,
            name,
            base,
            method,
            parameters: parameters.collect(),
            unit,
            metres,
            axes,
        })
    }

    /// Name and definition of a projected or geographic system.
    fn horizontal(&self, code: u32) -> Option<(String, String)> {
        if let Some(system) = self.projected(code) {
            let wkt = system.wkt();
            return Some((system.name, wkt));
        }
        let system = self.geographic(code)?;
        Some((system.name.to_owned(), system.wkt()))
    }

    /// The compound system of a horizontal and a vertical system.
    fn joined(&self, horizontal: u32, vertical: u32) -> Option<Compound> {
        let (horizontal_name, horizontal_wkt) = self.horizontal(horizontal)?;
        let [name, datum, unit, metres, direction] = cells(self.vertical.get(&vertical)?)[..] else {
            return None;
        };
        Some(Compound {
            code: None,
            name: format!("{horizontal_name} + {name}"),
            horizontal,
            horizontal_wkt,
            vertical: Vertical {
                code: vertical,
                name,
                datum,
                unit,
                metres,
                direction,
            },
        })
    }

    fn compound(&self, code: u32) -> Option<Compound> {
        let [name, horizontal, vertical] = cells(self.compound.get(&code)?)[..] else {
            return None;
        };
        let mut system = self.joined(horizontal.parse().ok()?, vertical.parse().ok()?)?;
        system.code = Some(code);
        if !name.is_empty() {
            name.clone_into(&mut system.name);
        }
        Some(system)
    }
}

fn cells(line: &'static str) -> Vec<&'static str> {
    line.split('\t').collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::MapSystem;

    #[test]
    fn the_table_is_whole_and_most_of_its_systems_can_be_projected_into() {
        assert_eq!((REGISTER.geographic.len(), REGISTER.projected.len()), (662, 5504));
        assert_eq!((REGISTER.vertical.len(), REGISTER.compound.len()), (291, 448));
        let mut usable = 0;
        let mut other: BTreeMap<String, usize> = BTreeMap::new();
        for &code in REGISTER.projected.keys().chain(REGISTER.geographic.keys()) {
            match MapSystem::parse(&format!("EPSG:{code}")) {
                Ok(system) => usable += usize::from(system.is_some()),
                Err(reason) => *other.entry(reason).or_default() += 1,
            }
        }
        // Of the others most are in feet.
        assert_eq!(usable, 662 + 4448, "{other:?}");
    }
}
