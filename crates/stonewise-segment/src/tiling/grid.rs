//! Where tiles lie.

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    /// First column.
    pub left: u32,
    /// First row.
    pub top: u32,
    /// Width, pixels.
    pub width: u32,
    /// Height, pixels.
    pub height: u32,
}

/// Tiles that cover an image, row by row, in equal steps and with equal sizes.
pub fn tiles(width: u32, height: u32, tile_px: u32, overlap_px: u32) -> Vec<Rect> {
    let rows = origins(height, tile_px, overlap_px);
    let columns = origins(width, tile_px, overlap_px);
    let row = |&top: &u32| {
        columns.iter().map(move |&left| Rect {
            left,
            top,
            width: tile_px.min(width),
            height: tile_px.min(height),
        })
    };
    rows.iter().flat_map(row).collect()
}

/// First pixels of the tiles along one side: as few as give the overlap, evenly spread.
pub fn origins(size: u32, tile_px: u32, overlap_px: u32) -> Vec<u32> {
    if size <= tile_px {
        return vec![0];
    }
    let step = tile_px.saturating_sub(overlap_px).max(1);
    let gaps = (size - tile_px).div_ceil(step);
    let at = |i: u32| (u64::from(i) * u64::from(size - tile_px) / u64::from(gaps)) as u32;
    (0..=gaps).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_everything_with_the_overlap_that_was_asked_for() {
        for size in [1, 99, 100, 101, 137, 1000] {
            for overlap in [0, 10, 50] {
                let all = origins(size, 100, overlap);
                assert_eq!(all[0], 0);
                assert_eq!(all[all.len() - 1], size.saturating_sub(100));
                assert!(
                    all.windows(2)
                        .all(|w| w[1] > w[0] && w[1] + overlap <= w[0] + 100)
                );
            }
        }
    }
}
