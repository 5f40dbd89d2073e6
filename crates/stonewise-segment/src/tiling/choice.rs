//! Between a mask and the masks inside it.

use super::candidate::Candidate;
use super::overlap::{common_pixels, extent, intersects};

/// Masks with at least this IoU show the same stone; the better one stays.
const SAME_IOU: f64 = 0.5;
/// A mask lies inside a larger one if this share of it does.
const INSIDE_SHARE: f64 = 0.75;
/// What lies inside a mask explains it, if score times area is at least this share of its own: the joints of
/// a group belong to none of its stones.
const GROUP_SHARE: f64 = 0.75;

/// Of masks in descending order those that are neither found twice, nor a part of a stone, nor a group of
/// stones.
///
/// Masks inside others make a tree. From its leaves on, a mask stays if its score times its area is more than
/// what the best choice of the masks inside it has; else these stay. So a fragment cannot displace its stone
/// however good its score is, and a group cannot displace stones that fill it. Cost: pixels of overlapping
/// pairs of masks.
pub fn choose(candidates: Vec<Candidate>) -> Vec<Candidate> {
    let mut unique: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        let is_known = |known: &Candidate| {
            let common = f64::from(common_pixels(&known.mask, &candidate.mask));
            common >= SAME_IOU * (f64::from(known.area) + f64::from(candidate.area) - common)
        };
        if !unique
            .iter()
            .any(|known| near(known, &candidate) && is_known(known))
        {
            unique.push(candidate);
        }
    }
    let parents: Vec<Option<usize>> = (0..unique.len()).map(|i| parent(&unique, i)).collect();
    let kept = kept(&unique, &parents);
    let all = unique.into_iter().zip(kept);
    all.filter(|(_, kept)| *kept)
        .map(|(candidate, _)| candidate)
        .collect()
}

/// Whether two masks can overlap at all.
fn near(a: &Candidate, b: &Candidate) -> bool {
    intersects(&extent(&a.mask), &extent(&b.mask))
}

/// The smallest mask in which a mask lies.
fn parent(all: &[Candidate], child: usize) -> Option<usize> {
    let inner = &all[child];
    let holds = |outer: &Candidate| {
        outer.area > inner.area
            && near(outer, inner)
            && f64::from(common_pixels(&outer.mask, &inner.mask)) >= INSIDE_SHARE * f64::from(inner.area)
    };
    let outer = all.iter().enumerate().filter(|(_, outer)| holds(outer));
    outer
        .min_by_key(|(index, outer)| (outer.area, *index))
        .map(|(index, _)| index)
}

/// Which masks stay.
fn kept(all: &[Candidate], parents: &[Option<usize>]) -> Vec<bool> {
    // A parent is larger than its children, so that they come first.
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by_key(|&i| (all[i].area, i));
    let mut inside = vec![0.0f64; all.len()];
    let mut is_group = vec![false; all.len()];
    for &index in &order {
        let own = f64::from(all[index].score) * f64::from(all[index].area);
        is_group[index] = inside[index] >= GROUP_SHARE * own;
        if let Some(parent) = parents[index] {
            inside[parent] += if is_group[index] { inside[index] } else { own };
        }
    }
    let mut kept = vec![false; all.len()];
    let mut is_covered = vec![false; all.len()];
    for &index in order.iter().rev() {
        is_covered[index] = parents[index].is_some_and(|p| is_covered[p] || kept[p]);
        kept[index] = !is_covered[index] && !is_group[index];
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::super::grid::Rect;
    use super::*;
    use crate::Patch;
    use stonewise_core::raster::Raster;

    fn mask([left, top, width, height]: [u32; 4], score: f32) -> Candidate {
        Candidate {
            mask: Patch {
                left,
                top,
                pixels: Raster::filled(width, height, true),
            },
            area: width * height,
            score,
            scale: 0,
            tile: Rect {
                left: 0,
                top: 0,
                width: 200,
                height: 200,
            },
            is_cut: false,
        }
    }

    fn chosen(masks: &[Candidate]) -> Vec<u32> {
        choose(masks.to_vec()).iter().map(|c| c.area).collect()
    }

    #[test]
    fn a_fragment_does_not_displace_its_stone() {
        let (fragment, stone) = (mask([0, 0, 20, 20], 0.95), mask([0, 0, 60, 40], 0.7));
        assert_eq!(chosen(&[fragment, stone]), [2400]);
    }

    #[test]
    fn a_group_does_not_displace_the_stones_that_fill_it() {
        let group = mask([0, 0, 62, 40], 0.9);
        let stones = [mask([0, 0, 30, 40], 0.8), mask([32, 0, 30, 40], 0.8)];
        let all = [
            group,
            stones[0].clone(),
            stones[1].clone(),
            mask([2, 2, 6, 6], 0.7),
        ];
        assert_eq!(chosen(&all), [1200, 1200]);
    }

    #[test]
    fn a_stone_found_twice_stays_once_and_neighbours_stay() {
        let all = [
            mask([0, 0, 30, 40], 0.9),
            mask([1, 1, 30, 40], 0.8),
            mask([33, 0, 30, 40], 0.5),
        ];
        assert_eq!(chosen(&all), [1200, 1200]);
    }
}
