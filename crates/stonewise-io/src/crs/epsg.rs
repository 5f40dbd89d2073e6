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

/// The definition of a system as WKT 1; `None` where the table does not have it.
pub fn definition(code: u32) -> Option<String> {
    REGISTER.definition(code)
}

/// The size of the unit of a projected system, metres.
pub fn unit_m(code: u32) -> Option<f64> {
    let projected = REGISTER.projected.get(&code)?;
    let [_, _, _, unit, ..] = cells(projected)[..] else {
        return None;
    };
    cells(REGISTER.at(&REGISTER.units, unit)?).last()?.parse().ok()
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
}

impl Register {
    fn of(text: &'static str) -> Self {
        let mut register = Self::default();
        let (mut geographic, mut projected) = (0, 0);
        for line in text.lines() {
            let Some((kind, rest)) = line.split_once('\t') else {
                continue;
            };
            let coded = |last: &mut u32| {
                let (step, rest) = rest.split_once('\t')?;
                *last += step.parse::<u32>().ok()?;
                Some((*last, rest))
            };
            match kind {
                "S" => register.spheroids.push(rest),
                "U" => register.units.push(rest),
                "M" => register.methods.push(rest),
                "G" => register.geographic.extend(coded(&mut geographic)),
                _ => register.projected.extend(coded(&mut projected)),
            }
        }
        register.bases = register.geographic.keys().copied().collect();
        register
    }

    fn at(&self, lines: &[&'static str], number: &str) -> Option<&'static str> {
        lines.get(number.parse::<usize>().ok()?).copied()
    }

    fn definition(&self, code: u32) -> Option<String> {
        match self.projected.get(&code) {
            Some(line) => self.projected(code, line),
            None => self.geographic(code),
        }
    }

    fn geographic(&self, code: u32) -> Option<String> {
        let line = self.geographic.get(&code)?;
        let [name, datum, spheroid, meridian, degrees, unit, radians] = cells(line)[..] else {
            return None;
        };
        let [spheroid, semi_major, inverse] = cells(self.at(&self.spheroids, spheroid)?)[..] else {
            return None;
        };
        Some(format!(
            "GEOGCS[\"{name}\",DATUM[\"{datum}\",SPHEROID[\"{spheroid}\",{semi_major},{inverse}]],\
             PRIMEM[\"{meridian}\",{degrees}],UNIT[\"{unit}\",{radians}],AUTHORITY[\"EPSG\",\"{code}\"]]"
        ))
    }

    fn projected(&self, code: u32, line: &str) -> Option<String> {
        let line = cells(line);
        let [name, base, method, unit, ref values @ ..] = line[..] else {
            return None;
        };
        let base = *self.bases.get(base.parse::<usize>().ok()?)?;
        let name = match name.strip_prefix('/') {
            Some(rest) => format!("{} / {rest}", cells(self.geographic.get(&base)?).first()?),
            None => name.to_owned(),
        };
        let method = cells(self.at(&self.methods, method)?);
        let (method, parameters) = method.split_first()?;
        let [unit, metres] = cells(self.at(&self.units, unit)?)[..] else {
            return None;
        };
        let mut text = format!(
            "PROJCS[\"{name}\",{},PROJECTION[\"{method}\"]",
            self.geographic(base)?
        );
        for (parameter, value) in parameters.iter().zip(values) {
            let _ = write!(text, ",PARAMETER[\"{parameter}\",{value}]");
        }
        let _ = write!(
            text,
            ",UNIT[\"{unit}\",{metres}],AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH],AUTHORITY[\"EPSG\",\"{code}\"]]"
        );
        Some(text)
    }
}

fn cells(line: &str) -> Vec<&str> {
    line.split('\t').collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::MapSystem;

    #[test]
    fn the_table_is_whole_and_most_of_its_systems_can_be_projected_into() {
        assert_eq!((REGISTER.geographic.len(), REGISTER.projected.len()), (662, 5504));
        let mut usable = 0;
        let mut other: BTreeMap<String, usize> = BTreeMap::new();
        for &code in REGISTER.projected.keys().chain(REGISTER.geographic.keys()) {
            match MapSystem::parse(&definition(code).unwrap()) {
                Ok(system) => usable += usize::from(system.is_some()),
                Err(reason) => *other.entry(reason).or_default() += 1,
            }
        }
        // Of the others most are in feet.
        assert_eq!(usable, 662 + 4448, "{other:?}");
    }
}
