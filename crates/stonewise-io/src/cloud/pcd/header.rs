//! The header: which fields a point has, and how they are stored.

use std::path::Path;

use nalgebra::Point3;

use crate::cloud::CloudError;
use crate::cloud::lines::Lines;
use crate::cloud::scalar::Scalar;

/// More bytes for a point than this are no point.
const MOST_POINT_BYTES: u64 = 1 << 20;

/// How points are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Text,
    Binary,
    /// Field after field, packed with LZF.
    Compressed,
}

/// A field of a point; of several values, the first counts.
#[derive(Clone, Debug)]
pub struct Field {
    pub name: String,
    pub scalar: Scalar,
    /// Values.
    pub count: u64,
    /// Values of the fields before it.
    pub first: u64,
    /// Bytes of the fields before it.
    pub offset: u64,
}

#[derive(Debug)]
pub struct Header {
    pub encoding: Encoding,
    pub fields: Vec<Field>,
    pub points: u64,
    pub point_bytes: u64,
    pub point_values: u64,
    /// Place of the sensor, where the file names one.
    pub viewpoint: Option<Point3<f64>>,
}

impl Header {
    /// Reads up to and including `DATA`.
    pub fn read(path: &Path, lines: &mut Lines) -> Result<Self, CloudError> {
        let mut raw = Raw::default();
        while let Some(line) = lines.next_filled()? {
            let line = line.to_owned();
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            let Some((key, values)) = words.split_first() else {
                continue;
            };
            if *key == "DATA" {
                let encoding = match values {
                    ["ascii"] => Encoding::Text,
                    ["binary"] => Encoding::Binary,
                    ["binary_compressed"] => Encoding::Compressed,
                    _ => {
                        let known = "known: ascii, binary, binary_compressed";
                        return Err(lines.error(format!("unknown DATA of a PCD file ({known}): {line:?}")));
                    }
                };
                return raw.finish(encoding).map_err(|e| CloudError::malformed(path, e));
            }
            raw.take(key, values).map_err(|reason| lines.error(reason))?;
        }
        Err(lines.error("the header of the PCD file has no DATA"))
    }

    pub fn field(&self, names: &[&str]) -> Option<&Field> {
        let known = |name: &str| names.iter().any(|n| n.eq_ignore_ascii_case(name));
        self.fields.iter().find(|f| known(&f.name))
    }
}

/// The lines of the header, as they come.
#[derive(Default)]
struct Raw {
    names: Vec<String>,
    sizes: Vec<u64>,
    types: Vec<String>,
    counts: Vec<u64>,
    width: Option<u64>,
    height: Option<u64>,
    points: Option<u64>,
    viewpoint: Option<Point3<f64>>,
}

impl Raw {
    fn take(&mut self, key: &str, values: &[&str]) -> Result<(), String> {
        let texts = || values.iter().map(|v| (*v).to_owned()).collect();
        let counts = || {
            let parse = |v: &&str| {
                v.parse::<u64>()
                    .map_err(|_| format!("{v:?} is not a count ({key})"))
            };
            values.iter().map(parse).collect::<Result<Vec<u64>, String>>()
        };
        let one = || match counts()?.as_slice() {
            [one] => Ok(*one),
            _ => Err(format!("{key} needs one number")),
        };
        match key {
            "FIELDS" | "COLUMNS" => self.names = texts(),
            "SIZE" => self.sizes = counts()?,
            "TYPE" => self.types = texts(),
            "COUNT" => self.counts = counts()?,
            "WIDTH" => self.width = Some(one()?),
            "HEIGHT" => self.height = Some(one()?),
            "POINTS" => self.points = Some(one()?),
            "VIEWPOINT" => {
                let values: Option<Vec<f64>> = values.iter().map(|v| v.parse().ok()).collect();
                let values = values.filter(|all| all.iter().all(|v| v.is_finite()));
                let Some([x, y, z, ..]) = values.as_deref() else {
                    return Err("VIEWPOINT needs a place and a quaternion, seven numbers".to_owned());
                };
                let place = Point3::new(*x, *y, *z);
                self.viewpoint = (place != Point3::origin()).then_some(place);
            }
            "VERSION" => {}
            comment if comment.starts_with('#') => {}
            _ => {
                return Err(format!(
                    "not a line of the header of a PCD file: it begins with {key:?}"
                ));
            }
        }
        Ok(())
    }

    fn finish(mut self, encoding: Encoding) -> Result<Header, String> {
        if self.counts.is_empty() {
            self.counts = vec![1; self.names.len()];
        }
        let lengths = [self.sizes.len(), self.types.len(), self.counts.len()];
        if lengths.iter().any(|&n| n != self.names.len()) {
            return Err("FIELDS, SIZE, TYPE and COUNT of the header differ in length".to_owned());
        }
        let (mut fields, mut offset, mut first) = (Vec::new(), 0u64, 0u64);
        for (k, name) in self.names.into_iter().enumerate() {
            let (kind, size, count) = (self.types[k].as_str(), self.sizes[k], self.counts[k]);
            let scalar = scalar(kind, size)
                .ok_or_else(|| format!("field {name:?} has the unknown TYPE {kind} of SIZE {size}"))?;
            fields.push(Field {
                name,
                scalar,
                count,
                first,
                offset,
            });
            let bytes = count
                .checked_mul(size)
                .and_then(|bytes| offset.checked_add(bytes));
            offset = bytes.filter(|&bytes| bytes <= MOST_POINT_BYTES).ok_or_else(|| {
                format!(
                    "the fields of a point take more than {MOST_POINT_BYTES} bytes: no PCD file of points"
                )
            })?;
            first += count;
        }
        let area = match (self.width, self.height) {
            (Some(width), height) => width.checked_mul(height.unwrap_or(1)),
            _ => None,
        };
        let points = match (self.points, area) {
            (Some(points), Some(area)) if points != area => {
                return Err(format!("POINTS is {points}, but WIDTH times HEIGHT is {area}"));
            }
            (points, area) => points.or(area).ok_or("the header says no number of POINTS")?,
        };
        Ok(Header {
            encoding,
            fields,
            points,
            point_bytes: offset,
            point_values: first,
            viewpoint: self.viewpoint,
        })
    }
}

fn scalar(kind: &str, size: u64) -> Option<Scalar> {
    Some(match (kind, size) {
        ("I", 1) => Scalar::I8,
        ("U", 1) => Scalar::U8,
        ("I", 2) => Scalar::I16,
        ("U", 2) => Scalar::U16,
        ("I", 4) => Scalar::I32,
        ("U", 4) => Scalar::U32,
        ("I", 8) => Scalar::I64,
        ("U", 8) => Scalar::U64,
        ("F", 4) => Scalar::F32,
        ("F", 8) => Scalar::F64,
        _ => return None,
    })
}
