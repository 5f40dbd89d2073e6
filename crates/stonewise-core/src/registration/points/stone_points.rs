//! Which points near the border of a mask belong to the stone.
//!
//! Whether a noisy point there gets the stone's label depends on its noise, and on where the photos that
//! voted stood: the heights of labelled points are biased along the border, differently in every epoch and
//! alike for all stones. So near the border a point's place in the face decides, not its label: points that
//! noise moved in and points that it moved out then balance. Both epochs have the same borders, moved as the
//! stones around moved: those of each, because an outline encloses the stray points of the epoch it was drawn
//! around and cuts off those of the other, which biases the motion of the whole wall.

use super::best_sensor::of_best_sensor;
use super::near_point::NearPoint;
use super::window::Window;
use crate::geometry::FaceFrame;
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// The points of a stone, chosen from all points near it, and the window in which they count.
#[derive(Clone, Debug)]
pub struct StonePoints {
    /// Points of the first epoch in the window.
    pub first: Vec<[f32; 3]>,
    /// Points of the second epoch with the label, in or out of the window, which moves with the stone.
    pub second: Vec<[f32; 3]>,
    /// Points of the second epoch without the label that may lie in the window.
    pub nearby_second: Vec<[f32; 3]>,
    /// `None`: all points count.
    pub window: Option<Window>,
}

/// The points of a stone in both epochs, from all points near it, in their order.
///
/// Farther inside the outlines of both epochs' labelled points than `border_noises` times their noise,
/// labelled points belong to the stone. Nearer to an outline all points inside both do, whatever their label,
/// if they lie no deeper and no farther out than the labelled ones. `shift`: how the stone's place moved,
/// second epoch minus first, about. Labelled points alone where no outline can be found, or where
/// `border_noises` is 0. Where several sensors show the stone in an epoch, the points are those of the sharpest
/// one.
pub fn stone_points(
    near: [&[NearPoint]; 2],
    normal: &Vector3<f64>,
    shift: &Vector3<f64>,
    border_noises: f64,
) -> StonePoints {
    let face_from_world = FaceFrame::from_normal(normal).face_from_world();
    let near = near.map(|near| of_best_sensor(near, &face_from_world));
    let [first, second] = near.each_ref().map(|near| labelled(near));
    let sources = near.each_ref().map(|near| {
        let mut counts = BTreeMap::new();
        for point in near.iter().filter(|p| p.labelled) {
            *counts.entry(point.source).or_default() += 1;
        }
        counts
    });

    match Window::new([&first, &second], normal, shift, border_noises, sources) {
        Some(window) => StonePoints {
            first: near[0]
                .iter()
                .filter(|p| window.holds(0, &window.place(&p.offset), p.labelled))
                .map(|p| p.offset)
                .collect(),
            second,
            nearby_second: near[1]
                .iter()
                .filter(|p| {
                    !p.labelled
                        && window.is_near(&(window.place(&p.offset) - window.face_from_world() * shift))
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

fn labelled(near: &[NearPoint]) -> Vec<[f32; 3]> {
    near.iter().filter(|p| p.labelled).map(|p| p.offset).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    const NOISE_M: f64 = 0.01;

    /// A plane of 0.6 m, points every 4 mm, normal noise; a mask of 0.4 m in the middle, drawn by a photo
    /// from the side: what stands out seems farther along y by `slant` times its height.
    fn seen_from(slant: f64, shift: &Vector3<f64>, seed: u64) -> Vec<NearPoint> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..150 * 150)
            .map(|i| {
                let noise = NOISE_M * stonewise_testing::normal(&mut rng);
                let (y, z) = (f64::from(i % 150) * 0.004 - 0.3, f64::from(i / 150) * 0.004 - 0.3);
                let p = Vector3::new(noise, y, z) + shift;
                NearPoint {
                    offset: p.cast::<f32>().into(),
                    labelled: (y + slant * noise).abs() < 0.2 && z.abs() < 0.2,
                    source: 0,
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
            window.holds(1, &Point3::from(at), labelled)
        };
        let stone = found.second.iter().filter(|p| there(p, true));
        let nearby = found.nearby_second.iter().filter(|p| there(p, false));
        [found.first.clone(), stone.chain(nearby).copied().collect()]
    }

    #[test]
    fn both_parts_of_a_stone_behind_a_bar_count() {
        // The photos of the first epoch show more below the bar, those of the second more above it.
        let shown = |low: f64, high: f64, seed: u64| {
            let mut near = seen_from(0.0, &Vector3::zeros(), seed);
            for p in near.iter_mut() {
                let z = f64::from(p.offset[2]);
                p.labelled &= z > low && z < high && (z + 0.01).abs() > 0.04;
            }
            near
        };
        let (first, second) = (shown(-0.2, 0.16, 1), shown(-0.15, 0.2, 2));
        let found = stone_points([&first, &second], &Vector3::x(), &Vector3::zeros(), 3.0);
        let heights = |low: f32, high: f32| {
            let is_there = |p: &&[f32; 3]| p[2] > low && p[2] < high;
            found.first.iter().filter(is_there).count() as f64 * 0.004 * 0.004 / 0.4
        };
        assert!(
            (heights(-0.2, -0.05) - 0.1).abs() < 0.02,
            "{}",
            heights(-0.2, -0.05)
        );
        assert!((heights(0.03, 0.2) - 0.13).abs() < 0.02, "{}", heights(0.03, 0.2));
    }

    #[test]
    fn what_one_epoch_alone_shows_is_not_shared() {
        let cut = |low: f64, high: f64, seed: u64| {
            let mut near = seen_from(0.0, &Vector3::zeros(), seed);
            let is_shown = |p: &NearPoint| p.offset[2] > low as f32 && p.offset[2] < high as f32;
            near.iter_mut().for_each(|p| p.labelled &= is_shown(p));
            near
        };
        // A part of the face of 0.4 m, and two of equal size, as if the stone had moved.
        for ([first, second], expected) in [
            ([[-0.2, 0.2], [-0.2, 0.2]], 1.0),
            ([[-0.2, 0.2], [-0.2, -0.1]], 0.25),
            ([[-0.2, -0.1], [-0.2, 0.2]], 0.25),
            ([[-0.2, 0.0], [-0.1, 0.1]], 1.0),
        ] {
            let (first, second) = (cut(first[0], first[1], 1), cut(second[0], second[1], 2));
            let found = stone_points([&first, &second], &Vector3::x(), &Vector3::zeros(), 3.0);
            let shared = found.window.unwrap().shared();
            assert!((shared - expected).abs() < 0.03, "{shared} {expected}");
        }
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
}
