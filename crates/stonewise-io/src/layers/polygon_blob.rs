//! Polygons in GeoPackage geometry blobs, as other programs write them.

/// A ring of (x, y), its first vertex not repeated.
pub(super) type Ring = Vec<[f64; 2]>;

/// ISO codes of the shapes that are read.
const POLYGON: u32 = 3;
const MULTIPOLYGON: u32 = 6;
/// Bits of the older extended code for z and m.
const EXTENDED: [(u32, usize); 2] = [(0x8000_0000, 1), (0x4000_0000, 1)];

/// The polygons of a blob: an outer ring and its holes each; z and m are dropped. `None` where it is damaged,
/// or holds other shapes.
///
/// Source: OGC 12-128r17, clause 2.1.3; ISO 13249-3 well-known binary.
pub(super) fn polygons(blob: &[u8]) -> Option<Vec<Vec<Ring>>> {
    let [b'G', b'P', _, flags, ..] = blob else {
        return None;
    };
    let envelope = *[0usize, 32, 48, 48, 64].get(usize::from(flags >> 1 & 7))?;
    let mut reader = Reader {
        rest: blob.get(8 + envelope..)?,
        little: true,
    };
    reader.shape()
}

struct Reader<'a> {
    rest: &'a [u8],
    little: bool,
}

impl Reader<'_> {
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        Some(*head)
    }

    fn count(&mut self) -> Option<u32> {
        let bytes = self.bytes()?;
        Some(match self.little {
            true => u32::from_le_bytes(bytes),
            false => u32::from_be_bytes(bytes),
        })
    }

    fn number(&mut self) -> Option<f64> {
        let bytes = self.bytes()?;
        let number = match self.little {
            true => f64::from_le_bytes(bytes),
            false => f64::from_be_bytes(bytes),
        };
        number.is_finite().then_some(number)
    }

    fn shape(&mut self) -> Option<Vec<Vec<Ring>>> {
        let [order] = self.bytes()?;
        self.little = order == 1;
        let code = self.count()?;
        let extended: usize = EXTENDED
            .iter()
            .filter(|(bit, _)| code & bit != 0)
            .map(|e| e.1)
            .sum();
        let code = code & 0x0fff_ffff;
        let axes = 2 + extended + [0, 1, 1, 2].get((code / 1000) as usize)?;
        match code % 1000 {
            POLYGON => Some(vec![self.rings(axes)?]),
            MULTIPOLYGON => {
                let count = self.count()?;
                let mut all = Vec::new();
                for _ in 0..count {
                    all.extend(self.shape()?);
                }
                Some(all)
            }
            _ => None,
        }
    }

    fn rings(&mut self, axes: usize) -> Option<Vec<Ring>> {
        let count = self.count()?;
        let mut rings = Vec::new();
        for _ in 0..count {
            let vertices = self.count()? as usize;
            if vertices.checked_mul(8 * axes)? > self.rest.len() {
                return None;
            }
            let mut ring: Ring = Vec::with_capacity(vertices);
            for _ in 0..vertices {
                ring.push([self.number()?, self.number()?]);
                for _ in 2..axes {
                    let _: [u8; 8] = self.bytes()?;
                }
            }
            if ring.len() > 1 && ring.first() == ring.last() {
                ring.pop();
            }
            rings.push(ring);
        }
        Some(rings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A multipolygon of a square with a hole and a triangle with z, big-endian and little-endian, put
    /// together by hand.
    #[test]
    fn shapes_of_both_byte_orders_and_with_z_are_read() {
        let square: [[f64; 2]; 4] = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        let hole: [[f64; 2]; 3] = [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]];
        let mut blob = b"GP\0\x01".to_vec();
        blob.extend(0i32.to_le_bytes());
        blob.push(0);
        blob.extend(6u32.to_be_bytes());
        blob.extend(2u32.to_be_bytes());
        blob.push(0);
        blob.extend(3u32.to_be_bytes());
        blob.extend(2u32.to_be_bytes());
        for ring in [&square[..], &hole[..]] {
            blob.extend((ring.len() as u32 + 1).to_be_bytes());
            for v in ring.iter().chain(&ring[..1]).flatten() {
                blob.extend(v.to_be_bytes());
            }
        }
        blob.push(1);
        blob.extend(1003u32.to_le_bytes());
        blob.extend(1u32.to_le_bytes());
        blob.extend(3u32.to_le_bytes());
        for v in hole.iter().flat_map(|p| [p[0], p[1], 7.0]) {
            blob.extend(v.to_le_bytes());
        }
        let read = polygons(&blob).unwrap();
        assert_eq!(
            read,
            vec![vec![square.to_vec(), hole.to_vec()], vec![hole.to_vec()]]
        );
        // No cut may panic or pass for whole.
        for end in 0..blob.len() {
            assert!(polygons(&blob[..end]).is_none(), "{end}");
        }
    }
}
