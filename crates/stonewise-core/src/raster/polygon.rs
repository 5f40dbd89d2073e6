//! Filling of polygons.

/// Calls `span(y, x_begin, x_end)` for every horizontal run of pixels whose centres lie inside the rings.
///
/// Inside is where a ray crosses the rings an odd number of times, so a ring inside another is a hole. Rings
/// are closed implicitly; vertices are pixel coordinates (pixel (0, 0) covers [0, 1) x [0, 1)) and may lie
/// outside the image, to which the spans are clipped. A centre exactly on an edge belongs to the polygon on
/// its right. Rings with non-finite coordinates are ignored. Cost: O(c log c) for c crossings of rows with
/// edges.
pub fn fill_polygon(rings: &[Vec<[f64; 2]>], width: u32, height: u32, mut span: impl FnMut(u32, u32, u32)) {
    let mut crossings: Vec<(u32, f64)> = Vec::new();
    for ring in rings {
        if ring.iter().flatten().all(|v| v.is_finite()) {
            for (i, &end) in ring.iter().enumerate() {
                let start = ring[if i == 0 { ring.len() - 1 } else { i - 1 }];
                add_crossings(start, end, height, &mut crossings);
            }
        }
    }
    crossings.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    for pair in crossings.chunks_exact(2) {
        // Every row is crossed an even number of times, so pairs never mix rows.
        let (begin, end) = (first_centre(pair[0].1, width), first_centre(pair[1].1, width));
        if begin < end {
            span(pair[0].0, begin, end);
        }
    }
}

/// Crossings of an edge with the rows whose centres it passes, its lower end included and its upper excluded.
fn add_crossings(start: [f64; 2], end: [f64; 2], height: u32, crossings: &mut Vec<(u32, f64)>) {
    // Always from top to bottom, so that two polygons that share an edge share its crossings to the last bit.
    let (a, b) = if start[1] <= end[1] {
        (start, end)
    } else {
        (end, start)
    };
    let (first, last) = (first_centre(a[1], height), first_centre(b[1], height));
    for y in first..last {
        let t = (f64::from(y) + 0.5 - a[1]) / (b[1] - a[1]);
        crossings.push((y, a[0] + t * (b[0] - a[0])));
    }
}

/// Index of the first pixel whose centre lies at or after the coordinate, at most `size`.
fn first_centre(coordinate: f64, size: u32) -> u32 {
    (coordinate - 0.5).ceil().clamp(0.0, f64::from(size)) as u32
}
