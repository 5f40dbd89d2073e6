//! Cells of a wall: convex polygons, one for each stone.

/// A convex polygon, its corners in order.
pub(super) type Ring = Vec<[f32; 2]>;

/// The part of the wall to be filled: x from, y from, x to, y to.
pub(super) type Extent = [f32; 4];

pub(super) fn along(a: [f32; 2], b: [f32; 2], t: f32) -> [f32; 2] {
    [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
}

/// Keeps the part of a convex ring where `normal . p <= limit` (Sutherland and Hodgman 1974).
pub(super) fn clip(ring: &mut Ring, normal: [f32; 2], limit: f32) {
    let excess = |p: [f32; 2]| normal[0] * p[0] + normal[1] * p[1] - limit;
    if ring.iter().all(|&p| excess(p) <= 0.0) {
        return;
    }
    let mut kept = Vec::with_capacity(ring.len() + 1);
    for (i, &b) in ring.iter().enumerate() {
        let a = ring[(i + ring.len() - 1) % ring.len()];
        let (ea, eb) = (excess(a), excess(b));
        if (ea <= 0.0) != (eb <= 0.0) {
            kept.push(along(a, b, ea / (ea - eb)));
        }
        if eb <= 0.0 {
            kept.push(b);
        }
    }
    *ring = kept;
}

/// Whether a convex ring holds a point.
#[cfg(test)]
pub(super) fn contains(ring: &Ring, p: [f32; 2]) -> bool {
    let turn = |i: usize| {
        let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    };
    (0..ring.len()).all(|i| turn(i) >= 0.0)
}
