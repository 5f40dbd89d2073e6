//! The record that names the coordinate system of a LAS file.

use las::Vlr;

use crate::crs::Crs;

const USER_ID: &str = "LASF_Projection";
/// WKT (LAS 1.4 R15, section 2.6).
const WKT: u16 = 2112;
/// The directory of GeoTIFF keys.
const KEYS: u16 = 34735;
/// A GeoTIFF key without a code of the register.
const USER_DEFINED: u16 = 32767;

/// The system that records name: WKT, or `EPSG:` and a code where there are GeoTIFF keys alone.
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
    epsg(&of(KEYS)?.data).map(|code| format!("EPSG:{code}"))
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
    let crs = Crs::parse(text)?;
    if crs.wkt.is_empty() {
        Some(key_record(u16::try_from(crs.epsg).ok()?))
    } else {
        Some(wkt_record(&crs.wkt))
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

/// The code of the projected system (key 3072), else of the geographic one (2048), in a GeoTIFF key
/// directory.
fn epsg(directory: &[u8]) -> Option<u16> {
    let (words, _) = directory.as_chunks::<2>();
    let words: Vec<u16> = words.iter().map(|b| u16::from_le_bytes(*b)).collect();
    let (entries, _) = words.get(4..)?.as_chunks::<4>();
    let value = |key: u16| {
        let found = entries.iter().find(|[id, place, _, _]| *id == key && *place == 0);
        found.map(|[_, _, _, value]| *value)
    };
    value(3072)
        .or_else(|| value(2048))
        .filter(|code| *code != USER_DEFINED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_comes_back_from_its_record() {
        let named = |text: &str| named_crs([crs_record(text).unwrap()].iter());
        assert_eq!(named("EPSG:5513").as_deref(), Some("EPSG:5513"));
        let utm = Crs::parse(&named("EPSG:25832").unwrap()).unwrap();
        assert_eq!((utm.epsg, utm.name.as_str()), (25832, "ETRS89 / UTM zone 32N"));
        assert_eq!(named("LOCAL_CS[\"dam\"]").as_deref(), Some("LOCAL_CS[\"dam\"]"));
        assert_eq!(crs_record("the dam"), None);
    }
}
