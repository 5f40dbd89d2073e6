//! What a camera writes beside the pixels of a photo: Exif 2.32 in JPEG and TIFF files.

use exif::{Context, DateTime, In, Reader, Tag};
use serde::Serialize;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use tiff::decoder::Decoder;
use tiff::decoder::ifd::Value as TiffValue;
use tiff::tags::Tag as TiffTag;

/// What the camera says of a photo; every part is `None` where it says nothing, or nothing sound.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Exif {
    /// Maker and model of the camera.
    pub camera: Option<String>,
    /// When the photo was taken, by the camera's clock: `2025-04-12 09:31:02`.
    pub taken: Option<String>,
    /// Focal length, millimetres.
    pub focal_mm: Option<f64>,
    /// Focal length of a lens with the same view on film of 36 mm, millimetres.
    pub focal_35_mm: Option<f64>,
    /// Latitude and longitude, degrees.
    pub position: Option<[f64; 2]>,
    /// Altitude, metres, in the system of the camera's receiver.
    pub altitude_m: Option<f64>,
}

/// The value of a tag.
enum Value {
    Text(Vec<u8>),
    Numbers(Vec<f64>),
}

/// Reads the Exif data of a JPEG or TIFF; `None` where there are none, or the file cannot be read. Of a TIFF the tags alone
/// are read, however large it is.
pub fn read_exif(path: &Path) -> Option<Exif> {
    let mut file = BufReader::new(File::open(path).ok()?);
    let head = file.fill_buf().ok()?;
    match head.get(..2)? {
        b"II" | b"MM" => Some(describe(tiff_tags(file)?)),
        _ => {
            let mut reader = Reader::new();
            let read = reader.continue_on_error(true).read_from_container(&mut file);
            let found = read.or_else(|e| e.distill_partial_result(|_| ())).ok()?;
            Some(describe(|tag| of_jpeg(&found.get_field(tag, In::PRIMARY)?.value)))
        }
    }
}

fn of_jpeg(value: &exif::Value) -> Option<Value> {
    match value {
        exif::Value::Ascii(texts) => texts.first().cloned().map(Value::Text),
        exif::Value::Rational(ratios) => Some(Value::Numbers(ratios.iter().map(|r| r.to_f64()).collect())),
        value => Some(Value::Numbers(value.iter_uint()?.map(f64::from).collect())),
    }
}

/// Looks tags up in the first image of a TIFF and in the directories of Exif and GPS that belong to it.
fn tiff_tags(file: BufReader<File>) -> Option<impl FnMut(Tag) -> Option<Value>> {
    let mut tiff = Decoder::new(file).ok()?;
    let mut below = |tag: TiffTag| {
        let pointer = tiff.find_tag(tag).ok()??.into_ifd_pointer().ok()?;
        tiff.read_directory(pointer).ok()
    };
    let (own, gps) = (below(TiffTag::ExifDirectory), below(TiffTag::GpsDirectory));
    Some(move |tag: Tag| {
        let number = TiffTag::from_u16_exhaustive(tag.number());
        let value = match tag.context() {
            Context::Exif => tiff.read_directory_tags(own.as_ref()?).find_tag(number),
            Context::Gps => tiff.read_directory_tags(gps.as_ref()?).find_tag(number),
            _ => tiff.find_tag(number),
        };
        match value.ok()?? {
            TiffValue::Ascii(text) => Some(Value::Text(text.into_bytes())),
            TiffValue::List(values) => values
                .iter()
                .map(number_of)
                .collect::<Option<_>>()
                .map(Value::Numbers),
            value => Some(Value::Numbers(vec![number_of(&value)?])),
        }
    })
}

fn number_of(value: &TiffValue) -> Option<f64> {
    match value {
        TiffValue::Rational(over, under) => Some(f64::from(*over) / f64::from(*under)),
        value => value.clone().into_u32().ok().map(f64::from),
    }
}

/// What the tags say.
fn describe(mut look_up: impl FnMut(Tag) -> Option<Value>) -> Exif {
    let (make, model) = (text(look_up(Tag::Make)), text(look_up(Tag::Model)));
    let camera = match (make, model) {
        // Many models begin with their maker.
        (Some(make), Some(model)) if model.starts_with(&make) => Some(model),
        (Some(make), Some(model)) => Some(format!("{make} {model}")),
        (make, model) => make.or(model),
    };
    let taken = text(look_up(Tag::DateTimeOriginal)).or_else(|| text(look_up(Tag::DateTime)));

    let mut angle = |tag: Tag, reference: Tag, negative: &str, most: f64| {
        let [degrees, minutes, seconds] = numbers(look_up(tag))?;
        let size = degrees + minutes / 60.0 + seconds / 3600.0;
        let sign = text(look_up(reference))?;
        (size <= most).then_some(if sign == negative { -size } else { size })
    };
    let latitude = angle(Tag::GPSLatitude, Tag::GPSLatitudeRef, "S", 90.0);
    let longitude = angle(Tag::GPSLongitude, Tag::GPSLongitudeRef, "W", 180.0);
    let is_below = numbers(look_up(Tag::GPSAltitudeRef)) == Some([1.0]);
    let altitude = numbers(look_up(Tag::GPSAltitude)).map(|[a]| if is_below { -a } else { a });
    let mut length = |tag: Tag| numbers(look_up(tag)).map(|[f]| f).filter(|f| *f > 0.0);
    Exif {
        camera,
        taken: taken.and_then(|text| date(&text)),
        focal_mm: length(Tag::FocalLength),
        focal_35_mm: length(Tag::FocalLengthIn35mmFilm),
        position: latitude.zip(longitude).map(|(a, b)| [a, b]),
        altitude_m: altitude,
    }
}

fn text(value: Option<Value>) -> Option<String> {
    let Value::Text(bytes) = value? else {
        return None;
    };
    let text: String = String::from_utf8_lossy(&bytes)
        .chars()
        .filter(|c| !c.is_control())
        .collect();
    Some(text.trim().to_owned()).filter(|text| !text.is_empty())
}

/// The first N numbers; `None` where one of them is not finite.
fn numbers<const N: usize>(value: Option<Value>) -> Option<[f64; N]> {
    let Value::Numbers(all) = value? else {
        return None;
    };
    let first = *all.first_chunk::<N>()?;
    first.iter().all(|v| v.is_finite()).then_some(first)
}

/// `2025:04:12 09:31:02` as a date is written elsewhere; `None` for a clock that was never set.
fn date(text: &str) -> Option<String> {
    let date = DateTime::from_ascii(text.as_bytes()).ok()?;
    (date.year > 0).then(|| date.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_was_never_set_gives_no_date() {
        assert_eq!(
            date("2025:04:12 09:31:02").as_deref(),
            Some("2025-04-12 09:31:02")
        );
        for text in [
            "0000:00:00 00:00:00",
            "    :  :     :  :  ",
            "2025:04:12",
            "yesterday",
        ] {
            assert_eq!(date(text), None, "{text}");
        }
    }
}
