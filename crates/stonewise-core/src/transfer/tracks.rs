//! Instances of all photos gathered into stones.

use super::overlap::Overlaps;
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap};

/// Groups of instances that are one stone, at most one a photo; each instance is in exactly one group. Groups
/// and their members ascend.
///
/// Starts from every instance alone and joins the two groups that agree best, again and again. Agreement of
/// two groups is the sum of intersections over the sum of unions of all their pairs, so a chain of photos,
/// each shifted a little from the last, breaks where its ends stop overlapping, and the order of the photos
/// does not matter. Only groups with an assigned pair between them are joined.
pub(super) fn group(overlaps: &Overlaps, pairs: &[(u32, u32)], min_iou: f64) -> Vec<Vec<u32>> {
    let count = overlaps.instances.len();
    let mut groups: Vec<Vec<u32>> = (0..count as u32).map(|i| vec![i]).collect();
    let mut neighbours: Vec<BTreeSet<usize>> = vec![BTreeSet::new(); count];
    let mut version = vec![0u32; count];
    let mut queue = BinaryHeap::new();

    for &(i, j) in pairs {
        neighbours[i as usize].insert(j as usize);
        neighbours[j as usize].insert(i as usize);
        push(
            &mut queue,
            overlaps,
            &groups,
            &version,
            [i as usize, j as usize],
            min_iou,
        );
    }

    while let Some(Candidate {
        ends: [a, b],
        versions,
        ..
    }) = queue.pop()
    {
        if versions != [version[a], version[b]] {
            continue;
        }
        let joined = std::mem::take(&mut groups[b]);
        groups[a].extend(joined);
        groups[a].sort_unstable();
        version[a] += 1;
        version[b] += 1;
        let moved = std::mem::take(&mut neighbours[b]);
        neighbours[a].extend(moved.iter().copied());
        neighbours[a].remove(&a);
        neighbours[a].remove(&b);
        for &c in &moved {
            neighbours[c].remove(&b);
            if c != a {
                neighbours[c].insert(a);
            }
        }
        for c in neighbours[a].clone() {
            push(
                &mut queue,
                overlaps,
                &groups,
                &version,
                [a.min(c), a.max(c)],
                min_iou,
            );
        }
    }

    groups.retain(|g| !g.is_empty());
    groups.sort_unstable();
    groups
}

/// Two groups that might be joined; the greatest is joined first.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    /// Agreement in parts per billion.
    agreement: u64,
    /// Area on which it rests.
    common: u64,
    /// The first of equals wins.
    order: Reverse<[usize; 2]>,
    ends: [usize; 2],
    versions: [u32; 2],
}

fn push(
    queue: &mut BinaryHeap<Candidate>,
    overlaps: &Overlaps,
    groups: &[Vec<u32>],
    version: &[u32],
    ends: [usize; 2],
    min_iou: f64,
) {
    let [a, b] = ends;
    if a == b || share_a_photo(overlaps, &groups[a], &groups[b]) {
        return;
    }
    let (mut common, mut union) = (0u64, 0u64);
    for &i in &groups[a] {
        for &j in &groups[b] {
            let [c, u] = overlaps.intersection_union(i, j);
            common += u64::from(c);
            union += u64::from(u);
        }
    }
    if union > 0 && common as f64 >= min_iou * union as f64 {
        queue.push(Candidate {
            agreement: common * 1_000_000_000 / union,
            common,
            order: Reverse(ends),
            ends,
            versions: [version[a], version[b]],
        });
    }
}

/// Whether a photo shows the two groups as different stones.
fn share_a_photo(overlaps: &Overlaps, a: &[u32], b: &[u32]) -> bool {
    let photo = |i: &u32| overlaps.instances[*i as usize].photo;
    a.iter().any(|i| b.iter().any(|j| photo(i) == photo(j)))
}
