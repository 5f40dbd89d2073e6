//! Which instance of one photo is which instance of another.

use super::overlap::Overlaps;
use crate::components::components;
use pathfinding::prelude::{Matrix, kuhn_munkres};
use std::collections::BTreeMap;

/// Least share of the smaller of two instances that both must have in common. Through gaps in a surface, a photo shows
/// a few points of another surface behind it. If two instances have only such points in common, their intersection
/// over union is high although they lie metres apart, on opposite sides of a tower. 0.1: many times as much as gaps
/// show.
const LEAST_COMMON: f64 = 0.1;

/// Pairs of instances of different photos that may be one stone, each instance at most once per pair of
/// photos: the assignment with the greatest sum of intersection over union (Kuhn 1955).
///
/// Solved block by block: pairs under `min_iou` or [`LEAST_COMMON`] could never be accepted and are no edges, so the
/// blocks are a few instances large on a wall of any size. Cost: cubic in the instances of a block.
pub(super) fn assign(overlaps: &Overlaps, min_iou: f64) -> Vec<(u32, u32)> {
    let mut edges: BTreeMap<(u32, u32), Vec<Edge>> = BTreeMap::new();
    for &(i, j) in overlaps.common.keys() {
        let [common, union] = overlaps.intersection_union(i, j);
        let iou = f64::from(common) / f64::from(union);
        let [a, b] = [i, j].map(|k| overlaps.instances[k as usize].area);
        let is_enough = f64::from(common) >= LEAST_COMMON * f64::from(a.min(b));
        if is_enough && iou >= min_iou {
            let photo = |k: u32| overlaps.instances[k as usize].photo;
            edges.entry((photo(i), photo(j))).or_default().push((i, j, iou));
        }
    }
    let mut pairs: Vec<(u32, u32)> = edges
        .values()
        .flat_map(|edges| blocks(edges))
        .flat_map(|block| solve(&block))
        .collect();
    pairs.sort_unstable();
    pairs
}

type Edge = (u32, u32, f64);

/// Edges of one pair of photos that hang together, one sharing an instance with the next.
fn blocks(edges: &[Edge]) -> Vec<Vec<Edge>> {
    let mut of_instance: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (number, &(i, j, _)) in edges.iter().enumerate() {
        of_instance.entry(i).or_default().push(number);
        of_instance.entry(j).or_default().push(number);
    }
    let beside = |number: usize| {
        let (i, j, _) = edges[number];
        of_instance[&i].iter().chain(&of_instance[&j]).copied()
    };
    let block = |numbers: Vec<usize>| numbers.into_iter().map(|number| edges[number]).collect();
    components(edges.len(), beside).into_iter().map(block).collect()
}

fn solve(block: &[Edge]) -> Vec<(u32, u32)> {
    if let [(i, j, _)] = block {
        return vec![(*i, *j)];
    }
    let mut rows: Vec<u32> = block.iter().map(|e| e.0).collect();
    let mut columns: Vec<u32> = block.iter().map(|e| e.1).collect();

    for side in [&mut rows, &mut columns] {
        side.sort_unstable();
        side.dedup();
    }

    let turned = rows.len() > columns.len();
    if turned {
        std::mem::swap(&mut rows, &mut columns);
    }
    let mut weights = Matrix::new(rows.len(), columns.len(), 0i64);

    for &(i, j, iou) in block {
        let (row, column) = if turned { (j, i) } else { (i, j) };
        if let (Ok(r), Ok(c)) = (rows.binary_search(&row), columns.binary_search(&column)) {
            weights[(r, c)] = (iou * 1e9) as i64;
        }
    }

    let (_, assigned) = kuhn_munkres(&weights);
    assigned
        .iter()
        .enumerate()
        .filter(|&(r, &c)| weights[(r, c)] > 0)
        .map(|(r, &c)| {
            if turned {
                (columns[c], rows[r])
            } else {
                (rows[r], columns[c])
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::atoms::Atoms;
    use super::super::visibility::Sighting;
    use super::*;

    /// The best sum over all one-to-one choices, by trying them all.
    fn best(edges: &[Edge], used: &mut Vec<u32>) -> f64 {
        let Some((&(i, j, iou), rest)) = edges.split_first() else {
            return 0.0;
        };
        let without = best(rest, used);
        if used.contains(&i) || used.contains(&j) {
            return without;
        }
        used.extend([i, j]);
        let with = iou + best(rest, used);
        used.truncate(used.len() - 2);
        with.max(without)
    }

    /// The pairs of two photos with one instance each, `common` points that both see, and others that only one sees.
    fn pairs_of(common: u32, alone: [u32; 2]) -> Vec<(u32, u32)> {
        let sighting = |photo| Sighting {
            photo,
            instance: 1,
            weight: 1.0,
        };
        let mut atoms = Atoms::default();
        for (area, photos) in [(common, &[0, 1][..]), (alone[0], &[0]), (alone[1], &[1])] {
            atoms.push(photos.iter().copied().map(sighting), area);
        }
        assign(&Overlaps::of(&atoms), 0.5)
    }

    #[test]
    fn instances_that_share_only_what_shows_through_gaps_are_no_pair() {
        assert_eq!(pairs_of(5, [995, 745]), []);
        assert_eq!(pairs_of(100, [900, 700]), [(0, 1)]);
        // The border of the second photo cuts the stone: only a tenth of it is in the photo.
        assert_eq!(pairs_of(100, [900, 0]), [(0, 1)]);
    }

    #[test]
    fn a_block_reaches_the_sum_of_an_exhaustive_search() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        for _ in 0..200 {
            let mut edges: Vec<Edge> = Vec::new();
            for i in 0..rng.random_range(1..5u32) {
                for j in 10..10 + rng.random_range(1..5u32) {
                    if rng.random_bool(0.6) {
                        edges.push((i, j, rng.random_range(0.01..1.0)));
                    }
                }
            }
            let pairs: Vec<_> = blocks(&edges).iter().flat_map(|b| solve(b)).collect();
            let sum: f64 = pairs
                .iter()
                .map(|p| edges.iter().find(|e| (e.0, e.1) == *p).unwrap().2)
                .sum();
            assert!((sum - best(&edges, &mut Vec::new())).abs() < 1e-6);
            let mut ends: Vec<u32> = pairs.iter().flat_map(|p| [p.0, p.1]).collect();
            ends.sort_unstable();
            ends.dedup();
            assert_eq!(ends.len(), 2 * pairs.len());
        }
    }
}
