//! The record that names the coordinate system of a LAS file.

use las::Vlr;

use crate::crs::{Units, definition, unit_of_code};

const USER_ID: &str = "LASF_Projection";
/// WKT (LAS 1.4 R15, section 2.6).
const WKT: u16 = 2112;
/// The directory of GeoTIFF keys, and their numbers.
const KEYS: u16 = 34735;
const DOUBLES: u16 = 34736;
const TEXTS: u16 = 34737;
/// The key that says what kind the coordinates are of, and its values.
const KIND: u16 = 1024;
const PROJECTED: u16 = 1;
const GEOGRAPHIC: u16 = 2;
const GEOCENTRIC: u16 = 3;
/// A GeoTIFF key without a code of the register.
const USER_DEFINED: u16 = 32767;

/// The system of a file and the units of its coordinates.
#[derive(Debug, PartialEq)]
pub struct NamedSystem {
    /// WKT if the records hold it; else from GeoTIFF keys, `EPSG:` and a code, or the WKT of a compound system if the keys
    /// also name a vertical one.
    pub text: Option<String>,
    /// As the records state them; metres where they state nothing.
    pub units: Units,
}

/// The system that records name.
///
/// # Errors
/// Why a unit that they name has no known size.
pub fn named_system<'a>(records: impl Iterator<Item = &'a Vlr> + Clone) -> Result<NamedSystem, String> {
    let of = |id: u16| {
        records
            .clone()
            .find(|v| v.user_id == USER_ID && v.record_id == id)
    };
    if let Some(record) = of(WKT) {
        let text = String::from_utf8_lossy(&record.data);
        let text = text.trim_end_matches('\0').trim();
        if !text.is_empty() {
            return Ok(NamedSystem {
                units: Units::of(text)?,
                text: Some(text.to_owned()),
            });
        }
    }
    let data = |id: u16| of(id).map_or(&[][..], |record| &record.data);
    Keys::of(data(KEYS), data(DOUBLES), data(TEXTS)).system()
}

/// Whether a record holds a system as WKT.
pub fn is_wkt(record: &Vlr) -> bool {
    record.user_id == USER_ID && record.record_id == WKT
}

/// A record for a system as [`named_system`] gives it: WKT where that can be had, else GeoTIFF keys; `None` for
/// other texts.
pub fn crs_record(text: &str) -> Option<Vlr> {
    if text.contains('[') {
        return Some(wkt_record(text));
    }
    let code = text.strip_prefix("EPSG:")?;
    match definition(code) {
        Some(wkt) => Some(wkt_record(&wkt)),
        None => Some(key_record(code.trim().parse().ok()?)),
    }
}

fn wkt_record(text: &str) -> Vlr {
    let mut data = text.as_bytes().to_vec();
    data.push(0);
    Vlr {
        user_id: USER_ID.to_owned(),
        record_id: WKT,
        description: "WKT Information".to_owned(),
        data,
    }
}

/// A projected system by its code: version 1.1.0, the kind of system (key 1024), the code (key 3072).
fn key_record(code: u16) -> Vlr {
    let words = [1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, code];
    Vlr {
        user_id: USER_ID.to_owned(),
        record_id: KEYS,
        description: "GeoTIFF keys".to_owned(),
        data: words.into_iter().flat_map(u16::to_le_bytes).collect(),
    }
}

/// GeoTIFF keys (OGC 19-008r4), by their numbers.
struct Keys {
    /// Key, place (0: the value itself; else the record that holds it), count, value or index there.
    entries: Vec<[u16; 4]>,
    doubles: Vec<f64>,
    texts: String,
}

impl Keys {
    fn of(directory: &[u8], doubles: &[u8], texts: &[u8]) -> Self {
        let words: Vec<u16> = directory
            .as_chunks::<2>()
            .0
            .iter()
            .map(|b| u16::from_le_bytes(*b))
            .collect();
        let (entries, _) = words.get(4..).unwrap_or_default().as_chunks::<4>();
        Self {
            entries: entries.to_vec(),
            texts: texts.iter().map(|&b| char::from(b)).collect(),
            doubles: doubles
                .as_chunks::<8>()
                .0
                .iter()
                .map(|b| f64::from_le_bytes(*b))
                .collect(),
        }
    }

    /// A code; `None` where it is not there or 0, which is undefined.
    fn code(&self, key: u16) -> Option<u16> {
        let found = self
            .entries
            .iter()
            .find(|[id, place, ..]| *id == key && *place == 0);
        found.map(|[.., value]| *value).filter(|value| *value != 0)
    }

    fn double(&self, key: u16) -> Option<f64> {
        let found = self
            .entries
            .iter()
            .find(|[id, place, ..]| *id == key && *place == DOUBLES);
        self.doubles.get(usize::from(found?[3])).copied()
    }

    /// A text without the bar at its end, and without quotes.
    fn text(&self, key: u16) -> Option<String> {
        let mut entries = self.entries.iter();
        let [.., count, begin] = entries.find(|[id, place, ..]| *id == key && *place == TEXTS)?;
        let text = self
            .texts
            .chars()
            .skip(usize::from(*begin))
            .take(usize::from(*count));
        let text: String = text.filter(|c| !matches!(c, '|' | '"' | '\0')).collect();
        Some(text.trim().to_owned()).filter(|text| !text.is_empty())
    }

    /// A projection that the keys themselves define over a geographic system of the register, as WKT: transverse Mercator
    /// and Lambert's cone (GeoTIFF 1.0, section 6.3.3.3); `None` for others.
    fn own_projection(&self, unit_m: f64) -> Option<String> {
        let in_degrees = matches!(self.code(2054), None | Some(9102));
        let base = definition(&self.code(2048)?.to_string()).filter(|_| in_degrees)?;
        let origin = [
            ("latitude_of_origin", 3081),
            ("central_meridian", 3080),
            ("scale_factor", 3092),
        ];
        let shift = [("false_easting", 3082), ("false_northing", 3083)];
        let cone = [
            ("standard_parallel_1", 3078),
            ("standard_parallel_2", 3079),
            ("latitude_of_origin", 3085),
            ("central_meridian", 3084),
            ("false_easting", 3086),
            ("false_northing", 3087),
        ];
        let (method, keys) = match self.code(3075)? {
            1 => ("Transverse_Mercator", [&origin[..], &shift].concat()),
            8 => ("Lambert_Conformal_Conic_2SP", cone.to_vec()),
            9 => ("Lambert_Conformal_Conic_1SP", [&origin[..], &shift].concat()),
            _ => return None,
        };
        let mut parameters = String::new();
        for (name, key) in keys {
            parameters += &format!("PARAMETER[\"{name}\",{}],", self.double(key)?);
        }
        let name = self.text(3073).or_else(|| self.text(1026));
        let name = name.unwrap_or_else(|| "user-defined".to_owned());
        Some(format!(
            "PROJCS[\"{name}\",{base},PROJECTION[\"{method}\"],{parameters}UNIT[\"{}\",{unit_m}]]",
            if unit_m == 1.0 { "metre" } else { "unit" }
        ))
    }

    /// Size of a unit, by its code or, where that is user-defined, by the key of its size.
    fn unit_m(&self, key: u16, size: Option<u16>) -> Result<Option<f64>, String> {
        let Some(code) = self.code(key) else {
            return Ok(None);
        };
        let stated = || self.double(size?).filter(|m| m.is_finite() && *m > 0.0);
        let known = match code {
            USER_DEFINED => stated(),
            code => unit_of_code(code),
        };
        known
            .map(Some)
            .ok_or_else(|| format!("GeoTIFF key {key} names unit {code}, whose size is not known"))
    }

    /// The projected system (key 3072), else the geographic one (2048) if the coordinates are its own, with the vertical
    /// system (4096) if the register has its code. The file's units (3076, of earth-centred coordinates 2052, and 4099)
    /// count before those of the systems.
    fn system(&self) -> Result<NamedSystem, String> {
        let defined = |key| self.code(key).filter(|code| *code != USER_DEFINED);
        let is_projected = self.code(KIND) == Some(PROJECTED);
        let horizontal = defined(3072).or_else(|| defined(2048).filter(|_| !is_projected));
        let vertical = defined(4096).map(|code| match code {
            // GeoTIFF 1.0: Newlyn, NAVD88, Baltic Sea.
            5101 | 5103 | 5105 => code + 600,
            code => code,
        });
        let text = horizontal.map(|code| {
            let compound = || definition(&format!("{code}+{}", vertical?));
            compound().unwrap_or_else(|| format!("EPSG:{code}"))
        });
        let (plane, size) = match self.code(KIND) {
            Some(GEOCENTRIC) => (2052, 2053),
            _ => (3076, 3077),
        };
        let (plane_m, height_m) = (self.unit_m(plane, Some(size))?, self.unit_m(4099, None)?);
        let is_own = is_projected && self.code(3072) == Some(USER_DEFINED);
        let text = text.or_else(|| self.own_projection(plane_m.unwrap_or(1.0)).filter(|_| is_own));
        let own = match (&text, plane_m) {
            (Some(text), None) => Units::of(text)?,
            // The unit of the heights is that of their system.
            (Some(text), Some(plane_m)) if text.contains('[') => Units {
                plane_m,
                ..Units::of(text)?
            },
            (_, plane_m) => {
                let plane_m = plane_m.unwrap_or(1.0);
                Units {
                    plane_m,
                    height_m: plane_m,
                    is_geographic: false,
                }
            }
        };
        Ok(NamedSystem {
            text,
            units: Units {
                height_m: height_m.unwrap_or(own.height_m),
                is_geographic: own.is_geographic || self.code(KIND) == Some(GEOGRAPHIC),
                ..own
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::{Crs, MapSystem};

    fn named(record: &Vlr) -> NamedSystem {
        named_system([record].into_iter()).unwrap()
    }

    /// A directory of keys, each with a value of its own.
    fn keys(keys: &[(u16, u16)]) -> Vlr {
        let mut record = key_record(0);
        let entries = keys.iter().flat_map(|(key, value)| [*key, 0, 1, *value]);
        let words = [1, 1, 0, keys.len() as u16].into_iter().chain(entries);
        record.data = words.flat_map(u16::to_le_bytes).collect();
        record
    }

    /// UTM zone 17 by its parameters (EPSG:26917), in metres and in feet.
    #[test]
    fn a_projection_of_its_own_is_that_of_its_parameters() {
        let place = |text: &str| {
            let system = MapSystem::parse(&crate::crs::in_metres(text)).unwrap().unwrap();
            let crate::crs::Coordinates::Projected(projection) = system.coordinates else {
                panic!("not projected: {text}");
            };
            let at = crate::crs::Geodetic {
                latitude: 0.7,
                longitude: -1.42,
                height_m: 0.0,
            };
            projection.forward(&system.ellipsoid, &at)
        };
        for (code, unit_m) in [(9001, 1.0), (9002, 0.3048)] {
            let values = [0.0, -81.0, 0.9996, 500_000.0 / unit_m, 0.0];
            let named = "My dam|";
            let entries: Vec<[u16; 4]> = [
                (1024, 1),
                (2048, 4269),
                (3072, USER_DEFINED),
                (3075, 1),
                (3076, code),
            ]
            .map(|(key, value)| [key, 0, 1, value])
            .into_iter()
            .chain(
                [3081, 3080, 3092, 3082, 3083]
                    .into_iter()
                    .zip(0..)
                    .map(|(key, at)| [key, DOUBLES, 1, at]),
            )
            .chain([[3073, TEXTS, named.len() as u16, 0]])
            .collect();
            let words = [1, 1, 0, entries.len() as u16]
                .into_iter()
                .chain(entries.into_iter().flatten());
            let record = |record_id, data| Vlr {
                record_id,
                data,
                ..key_record(0)
            };
            let records = [
                record(KEYS, words.flat_map(u16::to_le_bytes).collect()),
                record(DOUBLES, values.into_iter().flat_map(f64::to_le_bytes).collect()),
                record(TEXTS, named.into()),
            ];
            let system = named_system(records.iter()).unwrap();
            assert_eq!(system.units, units(unit_m, unit_m));
            let text = system.text.unwrap();
            assert_eq!(Crs::parse(&text).unwrap().name, "My dam");
            let (found, expected) = (place(&text), place("EPSG:26917"));
            assert!(
                (found[0] - expected[0]).hypot(found[1] - expected[1]) < 1e-6,
                "{found:?} {expected:?}"
            );
            // Without a parameter nothing is named.
            assert_eq!(named_system(records[..1].iter()).unwrap().text, None);
        }
    }

    fn units(plane_m: f64, height_m: f64) -> Units {
        Units {
            plane_m,
            height_m,
            is_geographic: false,
        }
    }

    const FOOT: f64 = 0.3048;
    const US_FOOT: f64 = 1200.0 / 3937.0;

    #[test]
    fn a_system_comes_back_from_its_record() {
        let text = |text: &str| named(&crs_record(text).unwrap()).text;
        assert_eq!(text("EPSG:5513").as_deref(), Some("EPSG:5513"));
        let utm = Crs::parse(&text("EPSG:25832").unwrap()).unwrap();
        assert_eq!(
            (utm.epsg, utm.name.as_str()),
            (Some(25832), "ETRS89 / UTM zone 32N")
        );
        assert_eq!(text("LOCAL_CS[\"dam\"]").as_deref(), Some("LOCAL_CS[\"dam\"]"));
        assert_eq!(crs_record("the dam"), None);
    }

    #[test]
    fn heights_of_geotiff_keys_come_with_the_map() {
        let named = |vertical: u16, unit: u16| {
            let record = keys(&[(1024, 1), (3072, 25832), (4096, vertical), (4099, unit)]);
            (named(&record).text.unwrap(), named(&record).units)
        };
        let heights = |text: &str| MapSystem::parse(text).map(|system| system.unwrap().heights.unwrap());
        // DHHN92, as of GeoTIFF 1.1, and NAVD88, as of 1.0.
        let (text, _) = named(5783, 9001);
        assert_eq!(heights(&text).unwrap(), "DHHN92 height");
        assert_eq!(Crs::parse(&text).unwrap().epsg, Some(25832));
        assert_eq!(wkt_record(&text), crs_record(&text).unwrap());
        assert_eq!(crs_record("EPSG:25832+5783").unwrap(), wkt_record(&text));
        assert_eq!(heights(&named(5103, 9001).0).unwrap(), "NAVD88 height");
        // Codes of an ellipsoid and of a datum as in GeoTIFF 1.0, user-defined, and none.
        for vertical in [5030, 5104, USER_DEFINED, 0] {
            assert_eq!(named(vertical, 9001), ("EPSG:25832".to_owned(), Units::METRES));
        }
    }

    #[test]
    fn the_units_of_keys_count_before_those_of_codes() {
        let found = |list: &[(u16, u16)]| named(&keys(list)).units;
        let own = [(1024, 1), (2048, 4269), (3072, USER_DEFINED)];
        assert_eq!(found(&[&own[..], &[(3076, 9002)]].concat()), units(FOOT, FOOT));
        assert_eq!(
            found(&[&own[..], &[(3076, 9003)]].concat()),
            units(US_FOOT, US_FOOT)
        );
        assert_eq!(
            found(&[&own[..], &[(3076, 9003), (4099, 9001)]].concat()),
            units(US_FOOT, 1.0)
        );
        assert_eq!(found(&own), Units::METRES);
        // Codes in metres and in feet, with and without a unit of the file.
        assert_eq!(found(&[(3072, 26917), (3076, 9003)]), units(US_FOOT, US_FOOT));
        assert_eq!(found(&[(3072, 2277), (3076, 9001)]), Units::METRES);
        let texas = found(&[(3072, 2277)]);
        assert!((texas.plane_m - US_FOOT).abs() < 1e-14 && texas.height_m == texas.plane_m);
        // Heights of a vertical system that is in metres, in its own unit or another.
        assert_eq!(found(&[(3072, 2277), (4096, 5703)]).height_m, 1.0);
        assert_eq!(
            found(&[(3072, 26917), (4096, 5703), (4099, 9003)]),
            units(1.0, US_FOOT)
        );
        assert_eq!(found(&[(3072, 26917), (4099, 9002)]), units(1.0, FOOT));
        // Earth-centred coordinates in a unit of their own, and degrees.
        assert_eq!(found(&[(1024, 3), (2048, 4978), (2052, 9036)]), units(1e3, 1e3));
        assert!(found(&[(1024, 2), (2048, 4979)]).is_geographic);
        let unknown = named_system([&keys(&[(3076, 9999)])].into_iter()).unwrap_err();
        assert!(unknown.contains("key 3076 names unit 9999"), "{unknown}");
    }

    #[test]
    fn a_unit_of_the_users_own_has_the_size_that_the_file_states() {
        let mut directory = keys(&[(3072, USER_DEFINED), (3076, USER_DEFINED), (3077, 1)]);
        let place = directory.data.len() - 6;
        directory.data[place..place + 2].copy_from_slice(&DOUBLES.to_le_bytes());
        let doubles = Vlr {
            record_id: DOUBLES,
            data: [7.0f64, 0.9144].into_iter().flat_map(f64::to_le_bytes).collect(),
            ..directory.clone()
        };
        let found = named_system([&directory, &doubles].into_iter()).unwrap();
        assert_eq!(found.units, units(0.9144, 0.9144));
        assert!(named_system([&directory].into_iter()).is_err());
    }

    #[test]
    fn keys_of_zero_name_nothing() {
        let found = |list: &[(u16, u16)]| named(&keys(list));
        let nothing = NamedSystem {
            text: None,
            units: Units::METRES,
        };
        assert_eq!(found(&[(1024, 1), (3072, 0)]), nothing);
        assert_eq!(
            found(&[(1024, 1), (2048, 0), (3072, 0), (3076, 0), (4096, 0), (4099, 0)]),
            nothing
        );
        // The geographic system under a projection without a code is not that of the coordinates.
        assert_eq!(found(&[(1024, 1), (2048, 4258), (3072, 0)]), nothing);
        assert_eq!(found(&[(2048, 4258)]).text.as_deref(), Some("EPSG:4258"));
    }
}
