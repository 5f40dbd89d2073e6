//! The outlines of a patch of points.

use crate::geometry::ring::{is_simple, ring_contains, signed_area, simplify_ring};
use crate::geometry::{FaceFrame, RingIndex, contour};
use nalgebra::{Point2, Point3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// How an outline is drawn around points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct OutlineParams {
    /// Gaps and bays narrower than twice this many point spacings are closed. Scanned points are irregular,
    /// so 3 spacings close the holes of a real cloud and keep the bays of a real stone.
    pub closing_spacings: f64,
    /// Largest distance between the traced and the simplified outline, in point spacings. The border of
    /// irregular points is not known better.
    pub simplify_spacings: f64,
    /// Raster cells along the longer side at most; bounds the cost of a patch with one far outlier.
    pub max_cells: usize,
}

impl Default for OutlineParams {
    fn default() -> Self {
        Self {
            closing_spacings: 3.0,
            simplify_spacings: 0.75,
            max_cells: 512,
        }
    }
}

/// Share of the points that an outline must enclose; if it encloses fewer, wider gaps are closed.
const ENCLOSED: f64 = 0.9;
/// How often the width of the gaps that are closed is doubled at most: up to 24 point spacings on either
/// side, or a railing's bar of 19 cm in a cloud with a point every 4 mm.
const DOUBLINGS: u32 = 3;
/// A piece with a smaller share of the points is a speck: points of another stone or of plants.
const SPECK: f64 = 0.05;

/// Outline of points in their plane, a simple polygon, counter-clockwise, first vertex not repeated.
///
/// The largest of the [`outlines`]. If it encloses fewer than nine tenths of the points, because a railing or
/// a plant in front of the face divides it, wider gaps are closed until it does, up to eight times as wide;
/// where that is not enough, it is the largest piece all the same. `None` under four points or where they
/// cover no area. Cost: O(n log n + cells times the closing distance in cells).
pub fn outline(points: &[Point2<f64>], params: &OutlineParams) -> Option<Vec<Point2<f64>>> {
    let mut largest = None;
    for doubling in 0..=DOUBLINGS {
        let wider = OutlineParams {
            closing_spacings: params.closing_spacings.max(1.0) * f64::from(1 << doubling),
            ..params.clone()
        };
        let mut pieces = pieces(points, &wider);
        if pieces.is_empty() {
            break;
        }
        let is_whole = pieces.len() == 1 || share_inside(points, &pieces[0]) >= ENCLOSED;
        let piece = pieces.swap_remove(0);
        if is_whole {
            return Some(piece);
        }
        largest.get_or_insert(piece);
    }
    largest
}

/// Outlines of the pieces of a face, largest first: simple polygons beside each other, counter-clockwise, first
/// vertex not repeated.
///
/// The points grow to discs, the union of the discs shrinks again until the border lies half a point spacing
/// outside the outermost points (a closing on a distance raster), and its pieces are traced and simplified
/// (Douglas & Peucker 1973). Holes, what lies in them, and pieces with less than a twentieth of the points are
/// dropped. The point spacing is sqrt(area / n) of the convex hull. Empty under four points or where they
/// cover no area. Cost: O(n log n + cells times the closing distance in cells).
pub fn outlines(points: &[Point2<f64>], params: &OutlineParams) -> Vec<Vec<Point2<f64>>> {
    let mut pieces = pieces(points, params);
    for i in (1..pieces.len()).rev() {
        let is_in_a_hole = pieces[..i]
            .iter()
            .any(|larger| ring_contains(larger, &pieces[i][0]));
        if is_in_a_hole || share_inside(points, &pieces[i]) < SPECK {
            pieces.remove(i);
        }
    }
    pieces
}

fn share_inside(points: &[Point2<f64>], ring: &Vec<Point2<f64>>) -> f64 {
    let ring = RingIndex::new(std::slice::from_ref(ring));
    points.iter().filter(|p| ring.contains(p)).count() as f64 / points.len() as f64
}

fn pieces(points: &[Point2<f64>], params: &OutlineParams) -> Vec<Vec<Point2<f64>>> {
    let hull = convex_hull(points);
    let area = signed_area(&hull);
    if points.len() < 4 || area.is_nan() || area <= 0.0 {
        return Vec::new();
    }
    let spacing = (area / points.len() as f64).sqrt();
    let radius = params.closing_spacings.max(1.0) * spacing;
    let min = hull.iter().fold(hull[0], |m, p| m.inf(p));
    let max = hull.iter().fold(hull[0], |m, p| m.sup(p));
    let longer = (max - min).max() + 2.0 * radius;
    let cell = (spacing / 2.5).max(longer / params.max_cells.max(16) as f64);
    // Three empty cells beyond the discs, so that the contour never touches the raster's border.
    let origin = min - Vector2::repeat(radius + 3.0 * cell);
    let size = (max - origin + Vector2::repeat(radius + 3.0 * cell)) / cell;
    let (width, height) = (size.x.ceil() as usize + 1, size.y.ceil() as usize + 1);

    let mut seeds = vec![false; width * height];
    for p in points {
        let at = (p - origin) / cell;
        seeds[at.y.round() as usize * width + at.x.round() as usize] = true;
    }
    // The contour depends only on depths up to `level` and one cell, which is less than `reach`.
    let reach = radius / cell + 2.0;
    let to_points = contour::distance(&seeds, width, reach);
    let outside: Vec<bool> = to_points.iter().map(|d| d * cell > radius).collect();
    // Depth inside the union of discs; the border of the patch lies half a spacing outside its outermost
    // points.
    let depth = contour::distance(&outside, width, reach);
    let level = ((radius - 0.5 * spacing) / cell).max(0.5);
    let in_metres = |ring: Vec<Point2<f64>>| {
        let ring = ring.iter().map(|p| origin + p.coords * cell).collect();
        simplest(ring, params.simplify_spacings * spacing)
    };
    let traced = contour::trace(&depth, width, height, level);
    traced.into_iter().map(in_metres).collect()
}

/// Outline of points on a face, as a polygon in the plane through their mean, counter-clockwise for a viewer
/// in front.
///
/// `outward`: normal of the face. See [`outline`].
pub fn face_outline(
    points: &[Point3<f64>],
    outward: &Vector3<f64>,
    params: &OutlineParams,
) -> Option<Vec<Point3<f64>>> {
    let frame = FaceFrame::from_normal(outward);
    let base = *points.first()?;
    let mean = base + points.iter().map(|p| p - base).sum::<Vector3<f64>>() / points.len() as f64;
    let flat: Vec<Point2<f64>> = points
        .iter()
        .map(|p| Point2::new((p - mean).dot(&frame.along), (p - mean).dot(&frame.up)))
        .collect();
    let ring = outline(&flat, params)?;
    Some(
        ring.iter()
            .map(|p| mean + frame.along * p.x + frame.up * p.y)
            .collect(),
    )
}

/// Corners of the smallest convex polygon around the points, counter-clockwise (Andrew 1979, monotone chain).
pub fn convex_hull(points: &[Point2<f64>]) -> Vec<Point2<f64>> {
    let mut sorted: Vec<Point2<f64>> = points
        .iter()
        .copied()
        .filter(|p| p.x.is_finite() && p.y.is_finite())
        .collect();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    let mut hull: Vec<Point2<f64>> = Vec::new();
    let mut chain = |points: &mut dyn Iterator<Item = &Point2<f64>>| {
        let start = hull.len();
        for p in points {
            while hull.len() >= start + 2 {
                let (a, b) = (hull[hull.len() - 2], hull[hull.len() - 1]);
                if (b - a).perp(&(p - b)) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(*p);
        }
        hull.pop();
    };
    chain(&mut sorted.iter());
    chain(&mut sorted.iter().rev());
    hull
}

/// The ring simplified. Where the result crosses itself, the tolerance is halved, up to three
/// times; the ring itself where that is not enough.
fn simplest(ring: Vec<Point2<f64>>, tolerance: f64) -> Vec<Point2<f64>> {
    let mut tolerance = tolerance;
    for _ in 0..4 {
        let simpler = simplify_ring(&ring, tolerance);
        if simpler.len() >= 3 && signed_area(&simpler) > 0.0 && is_simple(&simpler) {
            return simpler;
        }
        tolerance /= 2.0;
    }
    ring
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};

    /// Uniformly random points of a shape within (-1, 1)^2, about `n` of them in the square.
    fn scatter(n: usize, seed: u64, inside: impl Fn(&Point2<f64>) -> bool) -> Vec<Point2<f64>> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        (0..n)
            .map(|_| Point2::new(rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)))
            .filter(inside)
            .collect()
    }

    fn check(points: &[Point2<f64>], true_area: f64, tolerance: f64) {
        let ring = outline(points, &OutlineParams::default()).unwrap();
        assert!(is_simple(&ring));
        let area = signed_area(&ring);
        assert!(
            (area / true_area - 1.0).abs() < tolerance,
            "area {area} instead of {true_area}"
        );
    }

    #[test]
    fn a_disc_a_rectangle_and_a_bay_keep_their_area() {
        check(
            &scatter(4000, 1, |p| p.coords.norm() < 0.9),
            std::f64::consts::PI * 0.81,
            0.03,
        );
        check(
            &scatter(4000, 2, |p| p.x.abs() < 0.8 && p.y.abs() < 0.5),
            1.6,
            0.03,
        );
        // An L: its convex hull is a quarter larger.
        check(&scatter(4000, 3, |p| p.x < 0.0 || p.y < 0.0), 3.0, 0.03);
    }

    #[test]
    fn a_regular_grid_covers_its_cells() {
        let points: Vec<_> = (0..600)
            .map(|i| Point2::new(f64::from(i % 30), f64::from(i / 30)) * 0.01)
            .collect();
        check(&points, 0.3 * 0.2, 0.03);
    }

    #[test]
    fn a_far_speck_and_a_hole_are_left_out() {
        let mut points = scatter(4000, 4, |p| p.coords.norm() < 0.9 && p.coords.norm() > 0.4);
        points.extend([
            Point2::new(1.6, 0.0),
            Point2::new(1.61, 0.0),
            Point2::new(1.6, 0.01),
        ]);
        let ring = outline(&points, &OutlineParams::default()).unwrap();
        assert!(
            ring.iter()
                .all(|p| p.coords.norm() < 1.1 && p.coords.norm() > 0.7)
        );
    }

    /// A face of 1.6 x 1.2 behind a bar whose middle lies `middle` above its lower edge.
    fn face_behind_a_bar(n: usize, bar: f64, middle: f64) -> Vec<Point2<f64>> {
        let is_hidden = |p: &Point2<f64>| (p.y + 0.6 - middle).abs() < bar / 2.0;
        scatter(n, 6, |p| p.x.abs() < 0.8 && p.y.abs() < 0.6 && !is_hidden(p))
    }

    #[test]
    fn a_bar_divides_a_face_but_not_its_outline() {
        let params = OutlineParams::default();
        for middle in [0.3, 0.9] {
            let points = face_behind_a_bar(8000, 0.2, middle);
            let pieces = outlines(&points, &params);
            let areas: Vec<f64> = pieces.iter().map(|r| signed_area(r)).collect();
            assert_eq!(areas.len(), 2);
            assert!((areas[0] / (1.6 * 0.8) - 1.0).abs() < 0.04, "{areas:?}");
            assert!((areas[1] / (1.6 * 0.2) - 1.0).abs() < 0.1, "{areas:?}");
            check(&points, 1.6 * 1.2, 0.03);
        }
        // 64 point spacings are too wide to be closed: the larger piece.
        check(&face_behind_a_bar(80_000, 0.9, 0.65), 1.6 * 0.2, 0.1);
    }

    #[test]
    fn what_lies_in_a_hole_is_no_piece_beside() {
        let points = scatter(8000, 7, |p| {
            (p.coords.norm() - 0.7).abs() < 0.25 || p.coords.norm() < 0.25
        });
        let pieces = outlines(&points, &OutlineParams::default());
        assert_eq!(pieces.len(), 1);
        assert!((signed_area(&pieces[0]) / (std::f64::consts::PI * 0.95 * 0.95) - 1.0).abs() < 0.03);
    }

    #[test]
    fn few_points_and_points_on_a_line_have_no_outline() {
        let line: Vec<_> = (0..50)
            .map(|i| Point2::new(f64::from(i), 2.0 * f64::from(i)))
            .collect();
        assert!(outline(&line, &OutlineParams::default()).is_none());
        assert!(outline(&line[..2], &OutlineParams::default()).is_none());
        assert!(outline(&[], &OutlineParams::default()).is_none());
        assert!(outlines(&line, &OutlineParams::default()).is_empty());
        assert!(face_outline(&[], &Vector3::x(), &OutlineParams::default()).is_none());
    }

    #[test]
    fn on_a_face_far_away_it_runs_counter_clockwise_for_a_viewer_in_front() {
        let frame = FaceFrame::from_normal(&Vector3::new(0.8, -0.3, 0.2));
        let origin = Point3::new(4.5e5, 5.6e6, 300.0);
        let flat = scatter(3000, 5, |p| p.x.abs() < 0.8 && p.y.abs() < 0.5);
        let points: Vec<_> = flat
            .iter()
            .map(|p| origin + frame.along * p.x + frame.up * p.y)
            .collect();
        let ring = face_outline(&points, &frame.out, &OutlineParams::default()).unwrap();
        let twice_area: Vector3<f64> = (0..ring.len())
            .map(|i| (ring[i] - origin).cross(&(ring[(i + 1) % ring.len()] - origin)))
            .sum();
        assert!((twice_area.dot(&frame.out) / 3.2 - 1.0).abs() < 0.04);
        assert!(ring.iter().all(|p| (p - origin).dot(&frame.out).abs() < 1e-6));
    }

    #[test]
    fn any_points_give_a_simple_counter_clockwise_polygon_or_none() {
        for case in 0..64_u32 {
            let squeeze = 0.01 + 0.99 * (0.618034 * f64::from(case)).fract();
            let points = scatter(4 + 6 * case as usize, u64::from(case), |_| true);
            let points: Vec<_> = points.iter().map(|p| Point2::new(p.x, p.y * squeeze)).collect();
            if let Some(ring) = outline(&points, &OutlineParams::default()) {
                assert!(is_simple(&ring) && signed_area(&ring) > 0.0, "case {case}");
            }
        }
    }
}
