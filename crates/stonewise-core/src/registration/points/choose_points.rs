//! The points of matched stones, chosen from clouds that lie in memory.

use super::matched_pairs::{MatchedPair, PairPlaces, StoneExtents};
use super::near_point::NearPoint;
use super::pairs::MemoryPairs;
use nalgebra::Point3;

/// The points of matched stones out of all points of the first and of the second epoch, world frame, each with
/// the number of its stone in that epoch, 0 for none.
///
/// Which points near the border of a stone belong to it, `border_noises` says: see
/// [`stone_points`](super::stone_points). Cost: two passes over the first epoch, one over the second.
pub fn choose_points<I>(pairs: &[MatchedPair], epochs: [I; 2], border_noises: f64) -> MemoryPairs
where
    I: Iterator<Item = (Point3<f64>, u32)> + Clone,
{
    let [first, second] = epochs;
    let mut extents = StoneExtents::default();
    if border_noises > 0.0 {
        let labelled = first.clone().filter(|(_, stone)| *stone != 0);
        labelled.for_each(|(point, stone)| extents.add(stone, point));
    }
    let near = |points: I, is_later| {
        let places = PairPlaces::new(pairs, is_later, &extents);
        let mut near: Vec<Vec<NearPoint>> = vec![Vec::new(); pairs.len()];
        for (point, stone) in points {
            places
                .near(point, stone)
                .for_each(|(k, point)| near[k].push(point));
        }
        near
    };
    let (ones, twos) = (near(first, false), near(second, true));
    let near = ones.iter().zip(&twos);
    let chosen = pairs.iter().zip(near);
    MemoryPairs::new(
        chosen
            .map(|(pair, (one, two))| pair.choose([one, two], border_noises))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Bounds;
    use crate::id::StoneId;
    use crate::stone::Stone;
    use nalgebra::Vector3;

    /// Points of a plane every 5 mm, in three stones of 20 cm by 12 cm with joints of 3 cm.
    fn epoch(shift: &Vector3<f64>, numbers: [u32; 3]) -> Vec<(Point3<f64>, u32)> {
        let point = |i: u32| {
            let (x, z) = (f64::from(i % 140) * 0.005, f64::from(i / 140) * 0.005);
            let label = match (x % 0.23 < 0.2).then_some(numbers).filter(|_| z < 0.12) {
                Some(numbers) => numbers[((x / 0.23) as usize).min(2)],
                None => 0,
            };
            (Point3::new(x, 0.002 * (90.0 * x).sin(), z) + shift, label)
        };
        (0..140 * 30).map(point).collect()
    }

    fn stones(points: &[(Point3<f64>, u32)], numbers: [u32; 3]) -> Vec<Stone> {
        let stone = |id| {
            let own: Vec<Vector3<f64>> = points.iter().filter(|p| p.1 == id).map(|p| p.0.coords).collect();
            Stone {
                id: StoneId(id),
                centroid: (own.iter().sum::<Vector3<f64>>() / own.len() as f64).into(),
                normal: -Vector3::y(),
                area_m2: 0.024,
                points: own.len() as u32,
                photos: 2,
                confidence: 1.0,
            }
        };
        numbers.map(stone).to_vec()
    }

    #[test]
    fn points_are_those_that_each_stone_chooses_from_all_around_it() {
        let shift = Vector3::new(0.004, -0.01, 0.002);
        let (ones, twos) = ([1, 2, 3], [7, 8, 9]);
        let (first, second) = (epoch(&Vector3::zeros(), ones), epoch(&shift, twos));
        let matches = [(1, 7), (2, 8), (3, 9)].map(|(a, b)| (StoneId(a), StoneId(b)));
        let pairs = MatchedPair::of_matches(&stones(&first, ones), &stones(&second, twos), &matches);
        for border_noises in [0.0, 3.0] {
            let epochs = [&first, &second].map(|e| e.iter().copied());
            let found = choose_points(&pairs, epochs, border_noises);
            for (pair, found) in pairs.iter().zip(found.pairs()) {
                let near = |points: &[(Point3<f64>, u32)], id: StoneId, moved: Vector3<f64>| {
                    let own = first.iter().filter(|p| p.1 == pair.first.id.0).map(|p| p.0);
                    let bounds = Bounds::of(own).unwrap().grown(0.02).moved(&moved);
                    let here = points.iter().filter(|p| p.1 == id.0 || bounds.contains(&p.0));
                    here.map(|p| NearPoint {
                        offset: (p.0 - pair.first.centroid).cast::<f32>().into(),
                        labelled: p.1 == id.0,
                        source: 0,
                    })
                    .collect::<Vec<_>>()
                };
                let one = near(&first, pair.first.id, Vector3::zeros());
                let two = near(&second, pair.second.id, pair.shift);
                let expected = pair.choose([&one, &two], border_noises);
                let offsets = |cloud: &crate::cloud::Cloud| cloud.offsets().to_vec();
                assert_eq!(offsets(&found.points_first), offsets(&expected.points_first));
                assert_eq!(offsets(&found.points_second), offsets(&expected.points_second));
                assert_eq!(offsets(&found.nearby_second), offsets(&expected.nearby_second));
                assert_eq!(found.window.is_some(), border_noises > 0.0);
            }
        }
    }
}
