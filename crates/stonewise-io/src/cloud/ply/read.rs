//! Streaming the vertices.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use nalgebra::Point3;

use super::header::{Element, Encoding, Header, Kind};
use crate::cloud::chunk::{Chunker, PointRecord, Visit};
use crate::cloud::colour_scale::{LOOK_POINTS, Seen, to_16_bits};
use crate::cloud::lines::Lines;
use crate::cloud::scalar::Scalar;
use crate::cloud::{CloudError, ReadSummary};

/// Passes all vertices to `visit`.
pub fn read<E: From<CloudError>>(
    path: &Path,
    chunk_points: usize,
    visit: Visit<'_, E>,
) -> Result<ReadSummary, E> {
    let mut lines = Lines::open(path)?;
    let header = Header::read(&mut lines)?;
    let vertices = header.elements.iter().position(|e| e.name == "vertex");
    let no_vertices = || CloudError::malformed(path, "the ply header has no element vertex");
    let vertices = vertices.ok_or_else(no_vertices)?;
    let (before, vertex) = (&header.elements[..vertices], &header.elements[vertices]);
    let columns = Columns::find(vertex).ok_or_else(|| {
        CloudError::malformed(path, "the vertices of the ply header have no numbers x, y and z")
    })?;
    header.check_room(vertices + 1, lines.bytes_left()?, path)?;
    let mut values = Values::after_header(lines, header.encoding);
    let mut row = Vec::new();
    let columns = columns.with_color_factor(path)?;
    let (has_color, has_intensity) = (columns.color.is_some(), columns.intensity.is_some());
    let mut chunker = Chunker::new(chunk_points, has_color, has_intensity, visit);

    for element in before {
        for index in 0..element.count {
            if !values.next(path, element, &mut row)? {
                let reason = format!("it holds {index} of {} elements {}", element.count, element.name);
                return Err(CloudError::truncated(path, reason).into());
            }
            chunker.pass()?;
        }
    }

    for index in 0..vertex.count {
        if !values.next(path, vertex, &mut row)? {
            let reason = format!("it holds {index} of {} vertices", vertex.count);
            return Err(CloudError::truncated(path, reason).into());
        }
        chunker.push(columns.record(&row))?;
    }

    chunker.finish()
}

/// Number of vertices that the header claims.
pub fn vertex_count(path: &Path) -> Result<u64, CloudError> {
    let header = Header::read(&mut Lines::open(path)?)?;
    let vertices = header.elements.iter().find(|e| e.name == "vertex");
    Ok(vertices.map_or(0, |e| e.count))
}

/// Places of the values that are read among the properties of a vertex.
pub(super) struct Columns {
    pub(super) position: [usize; 3],
    color: Option<[(usize, Scalar); 3]>,
    /// Multiplies floating colours to 16 bits.
    color_factor: f64,
    intensity: Option<usize>,
}

impl Columns {
    pub(super) fn find(vertex: &Element) -> Option<Self> {
        let find = |names: &[&str]| {
            let known = |name: &str| names.iter().any(|n| n.eq_ignore_ascii_case(name));
            let place = vertex.properties.iter().position(|p| known(&p.name))?;
            match vertex.properties[place].kind {
                Kind::One(scalar) => Some((place, scalar)),
                Kind::List { .. } => None,
            }
        };
        let place = |name| find(&[name]).map(|(place, _)| place);
        let color = [
            find(&["red", "r", "diffuse_red"]),
            find(&["green", "g", "diffuse_green"]),
            find(&["blue", "b", "diffuse_blue"]),
        ];
        Some(Self {
            position: [place("x")?, place("y")?, place("z")?],
            color: match color {
                [Some(r), Some(g), Some(b)] => Some([r, g, b]),
                _ => None,
            },
            color_factor: 65535.0,
            intensity: find(&["intensity", "scalar_intensity", "reflectance"]).map(|(place, _)| place),
        })
    }

    fn record(&self, row: &[f64]) -> PointRecord {
        PointRecord {
            position: Some(Point3::from(self.position.map(|place| row[place]))),
            color: self
                .color
                .map(|channels| channels.map(|(place, scalar)| self.to_16_bit(row[place], scalar))),
            intensity: self.intensity.map(|place| row[place] as f32),
        }
    }

    /// A colour value: 16-bit integers go to 65535, all other integers to 255.
    fn to_16_bit(&self, value: f64, scalar: Scalar) -> u16 {
        let factor = match scalar {
            Scalar::F32 | Scalar::F64 => self.color_factor,
            Scalar::U16 | Scalar::I16 => 1.0,
            _ => 257.0,
        };
        (value * factor).round() as u16
    }

    /// Looks at the first vertices where colours are floats, which go to 1, to 255 or to 65535.
    fn with_color_factor(mut self, path: &Path) -> Result<Self, CloudError> {
        let is_real = |(_, scalar): &(usize, Scalar)| matches!(scalar, Scalar::F32 | Scalar::F64);
        let Some(channels) = self.color.filter(|channels| channels.iter().all(is_real)) else {
            return Ok(self);
        };
        let mut lines = Lines::open(path)?;
        let header = Header::read(&mut lines)?;
        let mut values = Values::after_header(lines, header.encoding);
        let mut row = Vec::new();
        let mut seen = [Seen::default(); 3];
        for element in &header.elements {
            let is_vertex = element.name == "vertex";
            let most = if is_vertex {
                LOOK_POINTS as u64
            } else {
                element.count
            };
            for _ in 0..element.count.min(most) {
                // An end of the file is met again while it is read.
                if !values.next(path, element, &mut row)? {
                    break;
                }
                for (seen, (place, _)) in seen.iter_mut().zip(channels).filter(|_| is_vertex) {
                    seen.add(row[place]);
                }
            }
            if is_vertex {
                break;
            }
        }
        self.color_factor = to_16_bits(seen, true);
        Ok(self)
    }
}

/// The values of the elements, one row at a time.
pub(super) enum Values {
    Text(Lines),
    Binary {
        bytes: BufReader<File>,
        big_endian: bool,
    },
}

impl Values {
    pub(super) fn after_header(lines: Lines, encoding: Encoding) -> Self {
        match encoding {
            Encoding::Text => Self::Text(lines),
            encoding => Self::Binary {
                bytes: lines.into_bytes(),
                big_endian: encoding == Encoding::BigEndian,
            },
        }
    }

    /// Reads one value per property into `row` (the length, where it is a list); false at the end of the
    /// file.
    fn next(&mut self, path: &Path, element: &Element, row: &mut Vec<f64>) -> Result<bool, CloudError> {
        self.next_with_items(path, element, row, &mut |_, _| {})
    }

    /// Reads on as `next` does, and passes (place of the property, item) for every item of every list.
    pub(super) fn next_with_items(
        &mut self,
        path: &Path,
        element: &Element,
        row: &mut Vec<f64>,
        item: &mut dyn FnMut(usize, f64),
    ) -> Result<bool, CloudError> {
        row.clear();
        match self {
            Self::Text(lines) => next_line(lines, element, row, item),
            Self::Binary { bytes, big_endian } => match next_binary(bytes, *big_endian, element, row, item) {
                Ok(()) => Ok(true),
                Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => Ok(false),
                Err(e) => Err(CloudError::read(path, e)),
            },
        }
    }
}

fn next_line(
    lines: &mut Lines,
    element: &Element,
    row: &mut Vec<f64>,
    item: &mut dyn FnMut(usize, f64),
) -> Result<bool, CloudError> {
    let Some(line) = lines.next_filled()? else {
        return Ok(false);
    };
    let parsed = parse_line(line, element, row, item);
    parsed.map(|()| true).map_err(|reason| lines.error(reason))
}

fn parse_line(
    line: &str,
    element: &Element,
    row: &mut Vec<f64>,
    item: &mut dyn FnMut(usize, f64),
) -> Result<(), String> {
    let mut words = line.split_ascii_whitespace();
    for (place, property) in element.properties.iter().enumerate() {
        let mut number = || {
            let short = || format!("the line ends before its property {:?}", property.name);
            let word = words.next().ok_or_else(short)?;
            word.parse::<f64>()
                .map_err(|_| format!("{word:?} is not a number (property {:?})", property.name))
        };
        let value = number()?;
        if let Kind::List { .. } = property.kind {
            for _ in 0..value as u64 {
                item(place, number()?);
            }
        }
        row.push(value);
    }
    Ok(())
}

fn next_binary(
    bytes: &mut impl Read,
    big_endian: bool,
    element: &Element,
    row: &mut Vec<f64>,
    item: &mut dyn FnMut(usize, f64),
) -> std::io::Result<()> {
    for (place, property) in element.properties.iter().enumerate() {
        let value = match property.kind {
            Kind::One(scalar) => next_scalar(bytes, big_endian, scalar)?,
            Kind::List { count, item: scalar } => {
                let length = next_scalar(bytes, big_endian, count)?;
                for _ in 0..length as u64 {
                    item(place, next_scalar(bytes, big_endian, scalar)?);
                }
                length
            }
        };
        row.push(value);
    }
    Ok(())
}

fn next_scalar(bytes: &mut impl Read, big_endian: bool, scalar: Scalar) -> std::io::Result<f64> {
    let mut raw = [0; 8];
    let size = scalar.size();
    bytes.read_exact(&mut raw[..size])?;
    if big_endian {
        raw[..size].reverse();
    }
    Ok(scalar.decode(raw))
}
