//! Grids of EGM96 and EGM2008 as the NGA ships them.
//!
//! Rows run from north to south, values from Greenwich to the east without a second copy of Greenwich.
//!
//! - `WW15MGH.DAC` of EGM96: 721 rows of centimetres, as big-endian integers of 16 bits (the readme beside it).
//! - `Und_min2.5x2.5_egm2008_isw=82_WGS84_TideFree` and `Und_min1x1_...` of EGM2008: a Fortran record for each row with
//!   the length of the row in bytes, its heights in metres in single precision, and the length again. Files whose names
//!   end in `_SE` are little-endian (NGA, comments of the program INTERP).

use super::geoid::Geoid;

const EGM96_COLUMNS: usize = 4 * 360;
/// Columns of the grids of EGM2008, at steps of 2.5 minutes and of 1 minute.
const EGM2008_COLUMNS: [usize; 2] = [24 * 360, 60 * 360];

/// Reads a grid whose length and marks are those of such a file; `None` for other files.
pub fn read(bytes: &[u8]) -> Option<Geoid> {
    egm96(bytes).or_else(|| {
        EGM2008_COLUMNS
            .iter()
            .find_map(|columns| egm2008(bytes, *columns))
    })
}

fn egm96(bytes: &[u8]) -> Option<Geoid> {
    if bytes.len() != 2 * EGM96_COLUMNS * rows(EGM96_COLUMNS) {
        return None;
    }
    let metres = |centimetres: &[u8; 2]| f32::from(i16::from_be_bytes(*centimetres)) / 100.0;
    let rows = bytes.chunks_exact(2 * EGM96_COLUMNS);
    of_earth(
        EGM96_COLUMNS,
        rows.map(|row| row.as_chunks().0.iter().map(metres).collect()),
    )
}

fn egm2008(bytes: &[u8], columns: usize) -> Option<Geoid> {
    let length = 4 * columns;
    let mark = u32::try_from(length).ok()?;
    let metres = if bytes.starts_with(&mark.to_be_bytes()) {
        f32::from_be_bytes
    } else if bytes.starts_with(&mark.to_le_bytes()) {
        f32::from_le_bytes
    } else {
        return None;
    };
    let record = length + 8;
    if bytes.len() != record * rows(columns) {
        return None;
    }
    let rows = bytes.chunks_exact(record).map(|record| {
        let heights = record.as_chunks().0.iter().skip(1).take(columns);
        heights.map(|height| metres(*height)).collect()
    });
    of_earth(columns, rows)
}

/// From pole to pole, with the same step as the columns.
fn rows(columns: usize) -> usize {
    columns / 2 + 1
}

fn of_earth(columns: usize, rows: impl DoubleEndedIterator<Item = Vec<f32>>) -> Option<Geoid> {
    let step = 360.0 / columns as f64;
    let mut heights = Vec::with_capacity((columns + 1) * self::rows(columns));
    for row in rows.rev() {
        heights.extend(&row);
        // Greenwich once more, so that the grid has no gap west of it.
        heights.extend(row.first());
    }
    let size = [self::rows(columns), columns + 1];
    Geoid::of([-90.0, 0.0], [step, step], size, heights)
}

#[cfg(test)]
mod tests {
    use super::super::ellipsoid::Geodetic;
    use super::*;

    const COLUMNS: usize = 24;

    /// Linear between the nodes, and continuous at Greenwich.
    fn height_m(latitude: f64, longitude: f64) -> f64 {
        10.0 + 0.25 * latitude - 0.125 * (longitude - 180.0).abs()
    }

    fn file(mark: fn(u32) -> [u8; 4], metres: fn(f32) -> [u8; 4]) -> Vec<u8> {
        let step = 360.0 / COLUMNS as f64;
        let mark = mark(4 * COLUMNS as u32);
        let row = |row: usize| {
            let node = |column: usize| height_m(90.0 - row as f64 * step, column as f64 * step);
            let heights = (0..COLUMNS).flat_map(|column| metres(node(column) as f32));
            [mark.to_vec(), heights.collect(), mark.to_vec()].concat()
        };
        (0..rows(COLUMNS)).flat_map(row).collect()
    }

    #[test]
    fn records_of_either_byte_order_have_the_heights_of_their_layout() {
        for bytes in [
            file(u32::to_be_bytes, f32::to_be_bytes),
            file(u32::to_le_bytes, f32::to_le_bytes),
        ] {
            let geoid = egm2008(&bytes, COLUMNS).unwrap();
            for (latitude, longitude) in [
                (89.0, 1.0),
                (-33.3, 200.0),
                (51.07, 7.53),
                (12.34, 359.9),
                (-89.0, 352.0),
            ] {
                let at = Geodetic {
                    latitude: f64::to_radians(latitude),
                    longitude: f64::to_radians(longitude),
                    height_m: 0.0,
                };
                let error = geoid.height_m(&at).unwrap() - height_m(latitude, longitude);
                assert!(error.abs() < 1e-5, "{latitude} {longitude}: {error}");
            }
            assert_eq!(egm2008(&bytes[..bytes.len() - 4], COLUMNS), None);
            assert_eq!(egm2008(&bytes[4..], COLUMNS), None);
            assert_eq!(read(&bytes), None);
        }
    }
}
