//! Fewer vertices for an outline.

/// A closed ring without the vertices that lie nearer than `tolerance` to the lines between those kept.
///
/// Douglas & Peucker (1973), on the two halves between the first vertex and the one farthest from it.
pub fn simplify(ring: &[[f64; 2]], tolerance: f64) -> Vec<[f64; 2]> {
    let Some(&first) = ring.first() else {
        return Vec::new();
    };
    let away = |p: &[f64; 2]| (p[0] - first[0]).hypot(p[1] - first[1]);
    let far = (0..ring.len())
        .max_by(|&a, &b| away(&ring[a]).total_cmp(&away(&ring[b])))
        .unwrap_or(0);
    let mut out = vec![first];
    halve(&ring[..=far], tolerance, &mut out);
    let mut back = ring[far..].to_vec();
    back.push(first);
    halve(&back, tolerance, &mut out);
    // The last is the first again.
    out.pop();
    out
}

/// Adds the kept vertices of an open line after its first one.
fn halve(line: &[[f64; 2]], tolerance: f64, out: &mut Vec<[f64; 2]>) {
    let (Some(&a), Some(&b)) = (line.first(), line.last()) else {
        return;
    };
    let distance = |p: &[f64; 2]| {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = dx.hypot(dy);
        if length == 0.0 {
            return (p[0] - a[0]).hypot(p[1] - a[1]);
        }
        ((p[0] - a[0]) * dy - (p[1] - a[1]) * dx).abs() / length
    };
    let inner = 1..line.len().saturating_sub(1);
    let far = inner
        .map(|i| (distance(&line[i]), i))
        .max_by(|p, q| p.0.total_cmp(&q.0));
    match far.filter(|(d, _)| *d > tolerance) {
        Some((_, i)) => {
            halve(&line[..=i], tolerance, out);
            halve(&line[i..], tolerance, out);
        }
        None if line.len() > 1 => out.push(b),
        None => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stepped_diagonal_becomes_straight_and_corners_stay() {
        let mut ring: Vec<[f64; 2]> = vec![[0.0, 0.0], [20.0, 0.0], [20.0, 20.0]];
        ring.extend((1..20).flat_map(|i| {
            let v = 20.0 - f64::from(i);
            [[v, v + 1.0], [v, v]]
        }));
        let simple = simplify(&ring, 0.9);
        assert_eq!(simple, [[0.0, 0.0], [20.0, 0.0], [20.0, 20.0]]);
        assert!(simplify(&[], 1.0).is_empty());
        assert_eq!(simplify(&ring, 0.1).len(), ring.len());
    }
}
