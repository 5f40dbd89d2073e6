//! Which points near the border of a mask belong to the stone.
//!
//! Whether a noisy point there gets the stone's label depends on its noise, and on where the photos that voted stood: the heights of
//! labelled points are biased along the border, differently in every epoch and alike for all stones. So near the border a point's
//! place in the face decides, not its label: points that noise moved in and points that it moved out then balance. Both epochs have
//! the same borders, moved as the stones around moved: those of each, because an outline encloses the stray points of the epoch it
//! was drawn around and cuts off those of the other, which biases the motion of the whole wall.

use super::survey::middle;
use crate::cloud::GridIndex;
use crate::geometry::{FaceFrame, OutlineParams, outline, signed_area};
use nalgebra::{Matrix3, Point2, Point3, Vector3};

/// Points of a stone on which its noise is measured.
const NOISE_SAMPLES: usize = 300;
/// Share of a stone's points, at either end of their depths, that does not set how deep the stone reaches.
const DEPTH_TAIL: f64 = 0.02;
/// Noise levels by which the depth of a stone is widened.
const DEPTH_NOISES: f64 = 4.0;
/// How much farther than its neighbours' shift a stone may be followed into points without its label, metres.
const REACH_M: f64 = 0.03;
/// Neighbours whose shifts, in the median, say where the border lies in the second epoch.
const SHIFT_NEIGHBOURS: usize = 12;

/// A point near a stone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NearPoint {
    /// Relative to the stone's centroid in the first epoch, metres.
    pub offset: [f32; 3],
    /// Whether the point has the label of the stone.
    pub labelled: bool,
}

/// The points of a stone, chosen from all points near it, and the window in which they count.
#[derive(Clone, Debug)]
pub struct StonePoints {
    /// Of the first epoch: those in the window.
    pub first: Vec<[f32; 3]>,
    /// Of the second epoch: those with the label, in or out of the window, which moves with the stone.
    pub second: Vec<[f32; 3]>,
    /// Of the second epoch: those without the label that may lie in the window.
    pub nearby_second: Vec<[f32; 3]>,
    /// `None`: all points count.
    pub window: Option<Window>,
}

/// The points of a stone in both epochs, from all points near it, in their order.
///
/// Farther inside the outlines of both epochs' labelled points than `border_noises` times their noise, labelled points belong to the
/// stone. Nearer to an outline all points inside both do, whatever their label, if they lie no deeper and no farther out than the
/// labelled ones. `shift`: how the stone's place moved, second epoch minus first, about. Labelled points alone where no outline can be
/// found, or where `border_noises` is 0.
pub fn stone_points(
    near: [&[NearPoint]; 2],
    normal: &Vector3<f64>,
    shift: &Vector3<f64>,
    border_noises: f64,
) -> StonePoints {
    let [first, second] = near.map(labelled);
    match Window::new([&first, &second], normal, shift, border_noises) {
        Some(window) => StonePoints {
            first: near[0]
                .iter()
                .filter(|p| window.holds(&window.place(&p.offset), p.labelled))
                .map(|p| p.offset)
                .collect(),
            second,
            nearby_second: near[1]
                .iter()
                .filter(|p| {
                    !p.labelled && window.is_near(&(window.place(&p.offset) - window.face_from_world * shift))
                })
                .map(|p| p.offset)
                .collect(),
            window: Some(window),
        },
        None => StonePoints {
            first,
            second,
            nearby_second: Vec::new(),
            window: None,
        },
    }
}

/// How the surroundings of each stone moved: the median, component by component, of the shifts of its nearest neighbours and itself.
pub fn local_shifts(centroids: &[Point3<f64>], shifts: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let Some(bounds) = crate::geometry::Bounds::of(centroids.iter().copied()) else {
        return Vec::new();
    };
    let extent_m = (bounds.max - bounds.min).norm().max(1e-3);
    let index = GridIndex::new(centroids, 2.0 * extent_m / (centroids.len() as f64).sqrt());
    centroids
        .iter()
        .map(|c| {
            let near = index.nearest_k(c, SHIFT_NEIGHBOURS, extent_m);
            middle(&near.iter().map(|(j, _)| shifts[*j]).collect::<Vec<_>>())
        })
        .collect()
}

fn labelled(near: &[NearPoint]) -> Vec<[f32; 3]> {
    near.iter().filter(|p| p.labelled).map(|p| p.offset).collect()
}

/// The part of a stone's face that both epochs show, about its centroid in the first. In the second it moves with the stone: were it
/// put where the stone is thought to be, the points' edge would pull the stone's motion away from there, by as much as the thought
/// was wrong in noisy clouds.
#[derive(Clone, Debug)]
pub struct Window {
    face_from_world: Matrix3<f64>,
    /// Outline of each epoch, in the place of the first.
    rings: [Vec<Point2<f64>>; 2],
    /// Width of the border along the inside of the rings.
    border_m: f64,
    /// Lowest and highest place across the face.
    depth: [f64; 2],
}

impl Window {
    fn new(
        labelled: [&[[f32; 3]]; 2],
        normal: &Vector3<f64>,
        shift: &Vector3<f64>,
        border_noises: f64,
    ) -> Option<Self> {
        if border_noises <= 0.0 {
            return None;
        }
        let face_from_world = FaceFrame::from_normal(normal).face_from_world();
        let first = Face::new(labelled[0], &face_from_world, &Vector3::zeros())?;
        let second = Face::new(labelled[1], &face_from_world, shift)?;
        Some(Self {
            face_from_world,
            border_m: border_noises * first.noise_m.max(second.noise_m),
            depth: [
                first.depth[0].max(second.depth[0]),
                first.depth[1].min(second.depth[1]),
            ],
            rings: [first.ring, second.ring],
        })
    }

    /// From world axes to the window's: along, up and out of the face.
    pub(super) fn face_from_world(&self) -> &Matrix3<f64> {
        &self.face_from_world
    }

    /// Whether a point counts that lies here, in the window's axes about the stone's centroid.
    pub(super) fn holds(&self, at: &Point3<f64>, labelled: bool) -> bool {
        let (flat, [low, high]) = (at.xy(), self.depth);
        let is_close = |ring: &Vec<Point2<f64>>| distance_to_ring(ring, &flat) < self.border_m;
        self.rings.iter().all(|ring| is_inside(ring, &flat))
            && match self.rings.iter().any(is_close) {
                true => at.z > low && at.z < high,
                false => labelled,
            }
    }

    /// Whether a point that lies here may come to lie in the window once the stone's motion is known better.
    fn is_near(&self, at: &Point3<f64>) -> bool {
        let flat = at.xy();
        let is_near =
            |ring: &Vec<Point2<f64>>| is_inside(ring, &flat) || distance_to_ring(ring, &flat) < REACH_M;
        self.rings.iter().all(is_near)
    }

    fn place(&self, offset: &[f32; 3]) -> Point3<f64> {
        place(&self.face_from_world, offset)
    }
}

/// Outline, noise and depth of a stone's labelled points in one epoch.
struct Face {
    ring: Vec<Point2<f64>>,
    noise_m: f64,
    depth: [f64; 2],
}

impl Face {
    fn new(labelled: &[[f32; 3]], face_from_world: &Matrix3<f64>, shift: &Vector3<f64>) -> Option<Self> {
        let shift = face_from_world * shift;
        let local: Vec<Point3<f64>> = labelled
            .iter()
            .map(|p| place(face_from_world, p) - shift)
            .collect();
        let flat: Vec<Point2<f64>> = local.iter().map(|p| p.xy()).collect();
        let ring = outline(&flat, &OutlineParams::default())?;
        let noise_m = noise_m(&local, signed_area(&ring).abs().sqrt());
        let mut heights: Vec<f64> = local.iter().map(|p| p.z).collect();
        heights.sort_by(f64::total_cmp);
        let tail = (DEPTH_TAIL * heights.len() as f64) as usize;
        Some(Self {
            ring,
            noise_m,
            depth: [
                heights[tail] - DEPTH_NOISES * noise_m,
                heights[heights.len() - 1 - tail] + DEPTH_NOISES * noise_m,
            ],
        })
    }
}

fn place(face_from_world: &Matrix3<f64>, offset: &[f32; 3]) -> Point3<f64> {
    Point3::from(face_from_world * Vector3::from(offset.map(f64::from)))
}

/// Noise along z of points of a face of `size_m`: the median difference of neighbours that are nearest in x and y.
///
/// Relief within one point spacing counts as noise; on terrestrial scans that is about as much as the scanner's.
fn noise_m(local: &[Point3<f64>], size_m: f64) -> f64 {
    let flat: Vec<Point3<f64>> = local.iter().map(|p| Point3::new(p.x, p.y, 0.0)).collect();
    let index = GridIndex::new(&flat, 2.0 * size_m / (flat.len() as f64).sqrt());
    let mut differences: Vec<f64> = (0..flat.len())
        .step_by((flat.len() / NOISE_SAMPLES).max(1))
        .filter_map(|i| {
            let near = index.nearest_k(&flat[i], 2, size_m);
            let other = near.iter().find(|(j, _)| *j != i)?.0;
            Some((local[i].z - local[other].z).abs())
        })
        .collect();
    differences.sort_by(f64::total_cmp);
    // The median of |a - b| is 0.954 standard deviations of a.
    differences
        .get(differences.len() / 2)
        .map_or(0.0, |median| median / 0.954)
}

fn edges(ring: &[Point2<f64>]) -> impl Iterator<Item = (&Point2<f64>, &Point2<f64>)> {
    ring.iter().zip(ring.iter().cycle().skip(1))
}

/// Even-odd rule.
fn is_inside(ring: &[Point2<f64>], p: &Point2<f64>) -> bool {
    let crossings = edges(ring)
        .filter(|(a, b)| (a.y > p.y) != (b.y > p.y) && p.x < a.x + (p.y - a.y) / (b.y - a.y) * (b.x - a.x));
    crossings.count() % 2 == 1
}

fn distance_to_ring(ring: &[Point2<f64>], p: &Point2<f64>) -> f64 {
    let to_edge = |(a, b): (&Point2<f64>, &Point2<f64>)| {
        let edge = b - a;
        let t = ((p - a).dot(&edge) / edge.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (p - (a + edge * t)).norm()
    };
    edges(ring).map(to_edge).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    const NOISE_M: f64 = 0.01;

    /// A plane of 0.6 m, points every 4 mm, normal noise; a mask of 0.4 m in the middle, drawn by a photo from the side: what stands out
    /// seems farther along y by `slant` times its height.
    fn seen_from(slant: f64, shift: &Vector3<f64>, seed: u64) -> Vec<NearPoint> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..150 * 150)
            .map(|i| {
                let noise = NOISE_M * ((0..12).map(|_| rng.random_range(0.0..1.0)).sum::<f64>() - 6.0);
                let (y, z) = (f64::from(i % 150) * 0.004 - 0.3, f64::from(i / 150) * 0.004 - 0.3);
                let p = Vector3::new(noise, y, z) + shift;
                NearPoint {
                    offset: p.cast::<f32>().into(),
                    labelled: (y + slant * noise).abs() < 0.2 && z.abs() < 0.2,
                }
            })
            .collect()
    }

    /// Mean height of the points near either end along y.
    fn ends(points: &[[f32; 3]], shift: &Vector3<f64>) -> [f64; 2] {
        [-1.0, 1.0].map(|side| {
            let at: Vec<f64> = points
                .iter()
                .map(|p| Vector3::from(p.map(f64::from)) - shift)
                .filter(|p| side * p.y > 0.19)
                .map(|p| p.x)
                .collect();
            at.iter().sum::<f64>() / at.len() as f64
        })
    }

    #[test]
    fn heights_at_the_border_are_not_biased_by_where_the_photos_stood() {
        let shift = Vector3::new(0.03, 0.01, -0.02);
        let first = seen_from(1.0, &Vector3::zeros(), 1);
        let second = seen_from(-1.0, &shift, 2);
        let near = [first.as_slice(), second.as_slice()];
        let by_label = stone_points(near, &Vector3::x(), &shift, 0.0);
        let [left, right] = ends(&by_label.first, &Vector3::zeros());
        assert!(left > 0.003 && right < -0.003, "{left} {right}");
        let [left, right] = ends(&by_label.second, &shift);
        assert!(left < -0.003 && right > 0.003, "{left} {right}");
        let by_place = stone_points(near, &Vector3::x(), &shift, 3.0);
        for (points, shift) in counting(&by_place, &shift).iter().zip([Vector3::zeros(), shift]) {
            let [left, right] = ends(points, &shift);
            assert!(left.abs() < 1e-3 && right.abs() < 1e-3, "{left} {right}");
            let side = (points.len() as f64).sqrt() * 0.004;
            assert!((side - 0.41).abs() < 0.02, "{side}");
        }
    }

    /// Points of both epochs that count when the second moved by `shift`.
    fn counting(found: &StonePoints, shift: &Vector3<f64>) -> [Vec<[f32; 3]>; 2] {
        let Some(window) = &found.window else {
            return [found.first.clone(), found.second.clone()];
        };
        let there = |p: &&[f32; 3], labelled: bool| {
            let at = window.face_from_world() * (Vector3::from(p.map(f64::from)) - shift);
            window.holds(&Point3::from(at), labelled)
        };
        let stone = found.second.iter().filter(|p| there(p, true));
        let nearby = found.nearby_second.iter().filter(|p| there(p, false));
        [found.first.clone(), stone.chain(nearby).copied().collect()]
    }

    #[test]
    fn no_epoch_is_treated_unlike_the_other() {
        let shift = Vector3::new(0.03, 0.01, -0.02);
        let (first, second) = (seen_from(1.0, &Vector3::zeros(), 1), seen_from(-1.0, &shift, 2));
        let one_way = stone_points([&first, &second], &Vector3::x(), &shift, 3.0);
        let other_way = stone_points([&second, &first], &Vector3::x(), &-shift, 3.0);
        let [a, b] = counting(&one_way, &shift).map(|points| points.len());
        let [d, c] = counting(&other_way, &-shift).map(|points| points.len());
        assert!(a.abs_diff(c) < 10 && b.abs_diff(d) < 10, "{a} {b} {c} {d}");
        assert!(a.abs_diff(b) < 100, "{a} {b}");
    }

    #[test]
    fn inside_the_border_and_without_an_outline_labels_decide() {
        let mut near = seen_from(0.0, &Vector3::zeros(), 1);
        let hole = |p: &NearPoint| p.offset[1].abs() < 0.05 && p.offset[2].abs() < 0.05;
        for p in near.iter_mut().filter(|p| hole(p)) {
            p.labelled = false;
        }
        let first = stone_points([&near, &near], &Vector3::x(), &Vector3::zeros(), 3.0).first;
        assert!(!first.iter().any(|p| p[1].abs() < 0.04 && p[2].abs() < 0.04));
        let few = &near[..3];
        let found = stone_points([few, few], &Vector3::x(), &Vector3::zeros(), 3.0);
        assert!(found.window.is_none() && found.nearby_second.is_empty());
        assert_eq!([found.first, found.second], [labelled(few), labelled(few)]);
    }

    #[test]
    fn one_wrong_shift_does_not_move_a_stone_away_from_its_neighbours() {
        let places: Vec<Point3<f64>> = (0..40)
            .map(|k| Point3::new(0.0, 0.3 * f64::from(k % 8), 0.2 * f64::from(k / 8)))
            .collect();
        let mut shifts = vec![Vector3::new(0.0, 0.02, 0.05); 40];
        shifts[17] = Vector3::new(0.0, 0.3, 0.0);
        assert_eq!(
            local_shifts(&places, &shifts),
            vec![Vector3::new(0.0, 0.02, 0.05); 40]
        );
    }
}
