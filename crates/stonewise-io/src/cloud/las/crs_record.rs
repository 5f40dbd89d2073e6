//! The record that names the coordinate system of a LAS file.

use las::Vlr;

use crate::crs::definition;

const USER_ID: &str = "LASF_Projection";
/// WKT (LAS 1.4 R15, section 2.6).
const WKT: u16 = 2112;
/// The directory of GeoTIFF keys.
const KEYS: u16 = 34735;
/// A GeoTIFF key without a code of the register.
const USER_DEFINED: u16 = 32767;

/// The system that records name: WKT if they hold it; else from GeoTIFF keys, `EPSG:` and a code, or the WKT of a
/// compound system if the keys also name a vertical one.
pub fn named_crs<'a>(records: impl Iterator<Item = &'a Vlr> + Clone) -> Option<String> {
    let of = |id: u16| {
        records
            .clone()
            .find(|v| v.user_id == USER_ID && v.record_id == id)
    };
    if let Some(record) = of(WKT) {
        let text = String::from_utf8_lossy(&record.data);
        let text = text.trim_end_matches('\0').trim();
        if !text.is_empty() {
            return Some(text.to_owned());
        }
    }
    keyed_crs(&of(KEYS)?.data)
}

/// Whether a record holds a system as WKT.
pub fn is_wkt(record: &Vlr) -> bool {
    record.user_id == USER_ID && record.record_id == WKT
}

/// A record for a system as [`named_crs`] gives it: WKT where that can be had, else GeoTIFF keys; `None` for
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

/// The projected system (key 3072) of a GeoTIFF key directory, else the geographic one (2048), with the vertical system
/// (4096) in its unit (4099) if the register has its code; old files may give other codes.
fn keyed_crs(directory: &[u8]) -> Option<String> {
    let (words, _) = directory.as_chunks::<2>();
    let words: Vec<u16> = words.iter().map(|b| u16::from_le_bytes(*b)).collect();
    let (entries, _) = words.get(4..)?.as_chunks::<4>();
    let value = |key: u16| {
        let found = entries.iter().find(|[id, place, _, _]| *id == key && *place == 0);
        found.map(|[_, _, _, value]| *value)
    };
    let horizontal = value(3072)
        .or_else(|| value(2048))
        .filter(|code| *code != USER_DEFINED)?;
    let compound = || {
        let vertical = match value(4096)? {
            // GeoTIFF 1.0: Newlyn, NAVD88, Baltic Sea.
            old @ (5101 | 5103 | 5105) => old + 600,
            code => code,
        };
        let text = definition(&format!("{horizontal}+{vertical}"))?;
        Some(in_unit(&text, value(4099)))
    };
    Some(compound().unwrap_or_else(|| format!("EPSG:{horizontal}")))
}

/// A compound system whose heights are in the unit of this code.
fn in_unit(text: &str, unit: Option<u16>) -> String {
    let unit = match unit {
        Some(9002) => "UNIT[\"foot\",0.3048]",
        Some(9003) => "UNIT[\"US survey foot\",0.304800609601219]",
        _ => return text.to_owned(),
    };
    let (horizontal, vertical) = text.split_at(text.find("VERT_CS[").unwrap_or(text.len()));
    horizontal.to_owned() + &vertical.replacen("UNIT[\"metre\",1]", unit, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::crs::{Crs, MapSystem};

    #[test]
    fn a_system_comes_back_from_its_record() {
        let named = |text: &str| named_crs([crs_record(text).unwrap()].iter());
        assert_eq!(named("EPSG:5513").as_deref(), Some("EPSG:5513"));
        let utm = Crs::parse(&named("EPSG:25832").unwrap()).unwrap();
        assert_eq!((utm.epsg, utm.name.as_str()), (25832, "ETRS89 / UTM zone 32N"));
        assert_eq!(named("LOCAL_CS[\"dam\"]").as_deref(), Some("LOCAL_CS[\"dam\"]"));
        assert_eq!(crs_record("the dam"), None);
    }

    #[test]
    fn heights_of_geotiff_keys_come_with_the_map() {
        let named = |vertical: u16, unit: u16| {
            let mut record = key_record(25832);
            record.data[6] = 4;
            let keys = [[4096, 0, 1, vertical], [4099, 0, 1, unit]];
            let words = keys.into_iter().flatten().flat_map(u16::to_le_bytes);
            record.data.extend(words);
            named_crs([record].iter()).unwrap()
        };
        let heights = |text: &str| MapSystem::parse(text).map(|system| system.unwrap().heights.unwrap());
        // DHHN92, as of GeoTIFF 1.1, and NAVD88, as of 1.0.
        let text = named(5783, 9001);
        assert_eq!(heights(&text).unwrap(), "DHHN92 height");
        assert_eq!(Crs::parse(&text).unwrap().epsg, 25832);
        assert_eq!(wkt_record(&text), crs_record(&text).unwrap());
        assert_eq!(crs_record("EPSG:25832+5783").unwrap(), wkt_record(&text));
        assert_eq!(heights(&named(5103, 9001)).unwrap(), "NAVD88 height");
        for feet in [9002, 9003] {
            assert!(heights(&named(5703, feet)).unwrap_err().contains("not the metre"));
        }
        // Codes of an ellipsoid and of a datum as in GeoTIFF 1.0, user-defined, and none.
        for vertical in [5030, 5104, USER_DEFINED, 0] {
            assert_eq!(named(vertical, 9001), "EPSG:25832");
        }
    }
}
