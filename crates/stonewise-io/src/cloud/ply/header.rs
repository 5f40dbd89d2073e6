//! The header: which elements with which properties follow.

use std::path::Path;

use crate::cloud::CloudError;
use crate::cloud::lines::Lines;
use crate::cloud::scalar::Scalar;

/// How values are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// Kind of a property.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

#[derive(Debug)]
pub struct Property {
    pub name: String,
    pub kind: Kind,
}

#[derive(Debug)]
pub struct Element {
    pub name: String,
    pub count: u64,
    pub properties: Vec<Property>,
}

impl Element {
    /// Bytes that one of them takes at least; in text a digit and the end of the line.
    fn least_bytes(&self, encoding: Encoding) -> u64 {
        let least = |property: &Property| match property.kind {
            Kind::One(scalar) | Kind::List { count: scalar, .. } => scalar.size() as u64,
        };
        let bytes: u64 = self.properties.iter().map(least).sum();
        match encoding {
            Encoding::Text if bytes > 0 => 2,
            _ => bytes,
        }
    }
}

#[derive(Debug)]
pub struct Header {
    pub encoding: Encoding,
    pub elements: Vec<Element>,
}

impl Header {
    /// Reads up to and including `end_header`.
    pub fn read(lines: &mut Lines) -> Result<Self, CloudError> {
        let mut encoding = None;
        let mut elements: Vec<Element> = Vec::new();
        while let Some(line) = lines.next()? {
            let line = line.to_owned();
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.as_slice() {
                ["end_header"] => {
                    let missing = "the header has no known format line before this";
                    let encoding = encoding.ok_or_else(|| lines.error(missing))?;
                    return Ok(Self { encoding, elements });
                }
                ["format", name, "1.0"] => encoding = Some(parse_encoding(name, lines)?),
                ["element", name, count] => elements.push(Element {
                    name: (*name).to_owned(),
                    count: count
                        .parse()
                        .map_err(|_| lines.error(format!("{count:?} is not a count")))?,
                    properties: Vec::new(),
                }),
                ["property", rest @ ..] => {
                    let property = parse_property(rest, lines)?;
                    let orphan = || lines.error("a property before any element");
                    elements.last_mut().ok_or_else(orphan)?.properties.push(property);
                }
                [] | ["ply"] | ["comment" | "obj_info", ..] => {}
                _ => return Err(lines.error(format!("not a line of a ply header: {line:?}"))),
            }
        }
        Err(lines.error("the header has no end_header"))
    }

    /// Checks that the first `needed` elements have room in the `bytes` after the header, before any of them
    /// is read.
    pub fn check_room(&self, needed: usize, bytes: u64, path: &Path) -> Result<(), CloudError> {
        // The last line of a text may have no end.
        let mut left = bytes.saturating_add(u64::from(self.encoding == Encoding::Text));
        for element in self.elements.iter().take(needed).filter(|e| e.count > 0) {
            let (name, count) = (&element.name, element.count);
            let least = element.least_bytes(self.encoding);
            if least == 0 {
                let reason = format!("the header claims {count} elements {name} that have no properties");
                return Err(CloudError::malformed(path, reason));
            }
            let room = left / least;
            if room < count {
                let reason =
                    format!("it has room for {room} of the {count} elements {name} that its header claims");
                return Err(CloudError::truncated(path, reason));
            }
            left -= count * least;
        }
        Ok(())
    }
}

fn parse_encoding(name: &str, lines: &Lines) -> Result<Encoding, CloudError> {
    match name {
        "ascii" => Ok(Encoding::Text),
        "binary_little_endian" => Ok(Encoding::LittleEndian),
        "binary_big_endian" => Ok(Encoding::BigEndian),
        _ => Err(lines.error(format!("unknown ply format {name:?}"))),
    }
}

fn parse_property(words: &[&str], lines: &Lines) -> Result<Property, CloudError> {
    let scalar = |word: &str| {
        scalar_type(word).ok_or_else(|| lines.error(format!("unknown type of property {word:?}")))
    };
    let (kind, name) = match words {
        ["list", count, item, name] => {
            let (count, item) = (scalar(count)?, scalar(item)?);
            if matches!(count, Scalar::F32 | Scalar::F64) {
                return Err(lines.error("the length of a list must be an integer"));
            }
            (Kind::List { count, item }, name)
        }
        [kind, name] => (Kind::One(scalar(kind)?), name),
        _ => return Err(lines.error("a property needs a type and a name")),
    };
    let name = (*name).to_owned();
    Ok(Property { name, kind })
}

fn scalar_type(word: &str) -> Option<Scalar> {
    Some(match word {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return None,
    })
}
