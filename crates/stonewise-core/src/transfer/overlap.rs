//! How far the instances of different photos cover the same surface.

use super::atoms::{Atom, Atoms};
use crate::geometry::CellMap;
use std::collections::BTreeMap;

/// One instance of one photo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Instance {
    /// Position of the photo among those with a mask.
    pub photo: u32,
    /// Label in that photo's mask.
    pub label: u32,
    /// Sampled points on it.
    pub area: u32,
}

/// Areas that instances share, counted on the sampled points.
pub(super) struct Overlaps {
    /// All instances with points, ascending by photo and label.
    pub instances: Vec<Instance>,
    /// Instance of each small label of a photo; [`NONE`] for background.
    small: Vec<Vec<u32>>,
    /// Instance of each photo and label of [`SMALL_LABELS`] and above.
    large: CellMap<(u32, u32), u32>,
    /// Area common to two instances (ascending indices) of different photos.
    pub common: BTreeMap<(u32, u32), u32>,
    /// Area of an instance that another photo sees, whatever it says about it.
    seen_by: CellMap<(u32, u32), u32>,
}

/// Labels below this, those of 16-bit label images, are looked up in a table of their photo, which takes 256
/// KB at most.
const SMALL_LABELS: u32 = 1 << 16;
/// In a table: no instance.
const NONE: u32 = u32::MAX;

impl Overlaps {
    pub(super) fn of(atoms: &Atoms) -> Self {
        let mut areas: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        for atom in atoms.iter() {
            for s in atom.sightings.iter().filter(|s| s.instance != 0) {
                *areas.entry((s.photo, s.instance)).or_insert(0) += atom.area;
            }
        }
        let instances = areas
            .into_iter()
            .map(|((photo, label), area)| Instance { photo, label, area });
        let mut overlaps = Self::of_instances(instances.collect());
        for atom in atoms.iter() {
            overlaps.count(atom);
        }
        overlaps
    }

    /// Instances without what they share, ascending by photo and label.
    pub(super) fn of_instances(instances: Vec<Instance>) -> Self {
        let (mut small, mut large): (Vec<Vec<u32>>, _) = (Vec::new(), CellMap::default());
        for (&Instance { photo, label, .. }, number) in instances.iter().zip(0..) {
            if label >= SMALL_LABELS {
                large.insert((photo, label), number);
                continue;
            }
            small.resize_with(small.len().max(photo as usize + 1), Vec::new);
            let table = &mut small[photo as usize];
            table.resize(table.len().max(label as usize + 1), NONE);
            table[label as usize] = number;
        }
        Self {
            instances,
            small,
            large,
            common: BTreeMap::new(),
            seen_by: CellMap::default(),
        }
    }

    fn count(&mut self, atom: Atom) {
        for (k, a) in atom.sightings.iter().enumerate() {
            let Some(i) = self.find(a.photo, a.instance) else {
                continue;
            };
            for (l, b) in atom.sightings.iter().enumerate() {
                if l == k {
                    continue;
                }
                *self.seen_by.entry((i, b.photo)).or_insert(0) += atom.area;
                if l > k
                    && let Some(j) = self.find(b.photo, b.instance)
                {
                    *self.common.entry((i.min(j), i.max(j))).or_insert(0) += atom.area;
                }
            }
        }
    }

    /// Index of an instance; `None` for background.
    #[inline]
    pub(super) fn find(&self, photo: u32, label: u32) -> Option<u32> {
        if label >= SMALL_LABELS {
            return self.large.get(&(photo, label)).copied();
        }
        let number = *self.small.get(photo as usize)?.get(label as usize)?;
        (number != NONE).then_some(number)
    }

    /// Intersection and union of two instances over the points that both photos see.
    pub(super) fn intersection_union(&self, i: u32, j: u32) -> [u32; 2] {
        let common = self.common.get(&(i.min(j), i.max(j))).copied().unwrap_or(0);
        let seen = |a: u32, b: u32| {
            let photo = self.instances[b as usize].photo;
            self.seen_by.get(&(a, photo)).copied().unwrap_or(0)
        };
        [common, seen(i, j) + seen(j, i) - common]
    }
}
