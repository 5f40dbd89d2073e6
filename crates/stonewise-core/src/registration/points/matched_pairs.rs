//! Matched stones in the order in which they are measured, and the points that each of them may consist of.

use super::local_shifts::local_shifts;
use super::near_point::NearPoint;
use super::pairs::PairPoints;
use super::stone_points::stone_points;
use super::window::Window;
use crate::cloud::Cloud;
use crate::geometry::{Bounds, cell_of, cells_between};
use crate::id::StoneId;
use crate::stone::Stone;
use nalgebra::{Point3, Vector3};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Edge of the cells by which stones are sorted into neighbourhoods, metres.
const NEIGHBOURHOOD_M: f64 = 4.0;
/// Edge of the cells by which a point finds the stones that it may belong to, metres.
const BOX_CELL_M: f64 = 0.5;
/// The outline of a stone reaches half a point spacing beyond its points, metres.
const BOX_MARGIN_M: f64 = 0.02;

/// A matched stone in both epochs.
#[derive(Clone, Debug)]
pub struct MatchedPair {
    /// In the first epoch.
    pub first: Stone,
    /// In the later epoch.
    pub second: Stone,
    /// How the stones around it moved, metres, world frame.
    pub shift: Vector3<f64>,
}

impl MatchedPair {
    /// The stones of two epochs that `matches` names, in neighbourhoods: sorted by the cell of the first
    /// centroid, then by stone.
    pub fn of_matches(first: &[Stone], second: &[Stone], matches: &[(StoneId, StoneId)]) -> Vec<Self> {
        let [ones, twos] = [first, second].map(|stones| {
            stones
                .iter()
                .map(|s| (s.id, s))
                .collect::<BTreeMap<StoneId, &Stone>>()
        });
        let found: Vec<(Stone, Stone)> = matches
            .iter()
            .filter_map(|(a, b)| Some(((*ones.get(a)?).clone(), (*twos.get(b)?).clone())))
            .collect();
        let moved: Vec<(Point3<f64>, Vector3<f64>)> = found
            .iter()
            .map(|(a, b)| (a.centroid, b.centroid - a.centroid))
            .collect();
        let mut pairs: Vec<Self> = found
            .into_iter()
            .zip(local_shifts(&moved))
            .map(|((first, second), shift)| Self { first, second, shift })
            .collect();
        pairs.sort_by_key(|p| (cell_of(&p.first.centroid, NEIGHBOURHOOD_M), p.first.id));
        pairs
    }

    /// Its points out of those near it in both epochs; see [`stone_points`].
    pub fn choose(&self, near: [&[NearPoint]; 2], border_noises: f64) -> PairPoints {
        let chosen = stone_points(near, &self.first.normal, &self.shift, border_noises);
        let offsets = [chosen.first, chosen.second, chosen.nearby_second];
        self.with_points(offsets, chosen.window.map(Arc::new))
    }

    /// The pair with points that are known: of the first epoch, of the second, and of the second near the
    /// stone, relative to its centroid in the first.
    pub fn with_points(&self, offsets: [Vec<[f32; 3]>; 3], window: Option<Arc<Window>>) -> PairPoints {
        let clouds = offsets.map(|offsets| Cloud::new(self.first.centroid, offsets));
        let [points_first, points_second, nearby_second] = clouds;
        PairPoints {
            first: self.first.id,
            second: self.second.id,
            centroid: self.first.centroid,
            centroid_second: self.second.centroid,
            normal: self.first.normal,
            points_first,
            points_second,
            nearby_second,
            window,
        }
    }
}

/// Boxes around the points of the stones of an epoch.
#[derive(Clone, Debug, Default)]
pub struct StoneExtents(BTreeMap<u32, Bounds>);

impl StoneExtents {
    /// Counts a point of a stone in.
    pub fn add(&mut self, stone: u32, place: Point3<f64>) {
        let point = Bounds {
            min: place,
            max: place,
        };
        let extent = self.0.entry(stone).or_insert(point);
        *extent = extent.union(&point);
    }

    /// The box of a stone, world frame, metres.
    pub fn of(&self, stone: StoneId) -> Option<&Bounds> {
        self.0.get(&stone.0)
    }
}

/// Where matched stones lie in one of the epochs: which of them a point may belong to.
#[derive(Debug)]
pub struct PairPlaces {
    places: Vec<Place>,
    /// The place of a stone of this epoch.
    of_stone: BTreeMap<u32, usize>,
    /// Places by the cells that their boxes touch.
    cells: BTreeMap<[i64; 3], Vec<usize>>,
}

/// Where a matched stone lies.
#[derive(Debug)]
struct Place {
    /// What its points are relative to: its centroid in the first epoch.
    centre: Point3<f64>,
    /// Box in which all points are of interest; `None`: labelled ones only.
    extent: Option<Bounds>,
}

impl PairPlaces {
    /// The places in the first epoch, or in the later one. `extents`: of the first epoch's stones;
    /// without a box only points with the stone's own label count.
    pub fn new(pairs: &[MatchedPair], is_later: bool, extents: &StoneExtents) -> Self {
        let mut found = Self {
            places: Vec::with_capacity(pairs.len()),
            of_stone: BTreeMap::new(),
            cells: BTreeMap::new(),
        };
        for (k, pair) in pairs.iter().enumerate() {
            let (stone, shift) = match is_later {
                false => (pair.first.id, Vector3::zeros()),
                true => (pair.second.id, pair.shift),
            };
            found.of_stone.insert(stone.0, k);
            let extent = extents.of(pair.first.id);
            let extent = extent.map(|e| e.grown(BOX_MARGIN_M).moved(&shift));
            let cells =
                extent.map(|e| cells_between(cell_of(&e.min, BOX_CELL_M), cell_of(&e.max, BOX_CELL_M)));
            for cell in cells.into_iter().flatten() {
                found.cells.entry(cell).or_default().push(k);
            }
            found.places.push(Place {
                centre: pair.first.centroid,
                extent,
            });
        }
        found
    }

    /// Whether a matched stone may have points in these bounds without its label.
    pub fn reach_into(&self, bounds: &Bounds) -> bool {
        let reaches = |p: &Place| p.extent.is_some_and(|e| e.intersects(bounds));
        self.places.iter().any(reaches)
    }

    /// Whether this stone of the epoch is a matched one.
    pub fn has(&self, stone: u32) -> bool {
        self.of_stone.contains_key(&stone)
    }

    /// The pairs, by their index, that a point may belong to, with the point as they see it: that of its own
    /// stone, then those in whose box it lies, all as of the first source. `stone`: its label, 0 for none.
    pub fn near(&self, point: Point3<f64>, stone: u32) -> impl Iterator<Item = (usize, NearPoint)> + '_ {
        let own = self.of_stone.get(&stone).copied();
        let here = self.cells.get(&cell_of(&point, BOX_CELL_M)).into_iter().flatten();
        let inside = move |k: &usize| self.places[*k].extent.is_some_and(|e| e.contains(&point));
        let others = here.copied().filter(move |k| Some(*k) != own && inside(k));
        own.into_iter().chain(others).map(move |k| {
            let near = NearPoint {
                offset: (point - self.places[k].centre).cast::<f32>().into(),
                labelled: Some(k) == own,
                source: 0,
            };
            (k, near)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stone(id: u32, x: f64) -> Stone {
        Stone {
            id: StoneId(id),
            centroid: Point3::new(x, 0.0, 0.0),
            normal: Vector3::y(),
            area_m2: 0.04,
            points: 100,
            photos: 2,
            confidence: 1.0,
        }
    }

    #[test]
    fn a_point_belongs_to_its_own_stone_first_and_to_every_box_around_it() {
        let first = [stone(1, 0.0), stone(2, 0.4), stone(3, 9.0)];
        let second = [stone(11, 0.01), stone(12, 0.41), stone(13, 9.01)];
        let matches = [(1, 11), (2, 12), (3, 13)].map(|(a, b)| (StoneId(a), StoneId(b)));
        let pairs = MatchedPair::of_matches(&first, &second, &matches);
        let half = Vector3::new(0.25, 0.05, 0.1);
        let mut extents = StoneExtents::default();
        for stone in &first {
            extents.add(stone.id.0, stone.centroid - half);
            extents.add(stone.id.0, stone.centroid + half);
        }
        for is_later in [false, true] {
            let places = PairPlaces::new(&pairs, is_later, &extents);
            let label = if is_later { 12 } else { 2 };
            let found: Vec<(u32, bool)> = places
                .near(Point3::new(0.2, 0.0, 0.0), label)
                .map(|(k, near)| (pairs[k].first.id.0, near.labelled))
                .collect();
            assert_eq!(found, [(2, true), (1, false)]);
            // Every stone looked at one by one finds the same.
            for x in (0..100).map(|i| f64::from(i) * 0.1 - 0.5) {
                let point = Point3::new(x, 0.0, 0.0);
                let mut near: Vec<u32> = places.near(point, 0).map(|(k, _)| pairs[k].first.id.0).collect();
                near.sort_unstable();
                let shift = if is_later { pairs[0].shift.x } else { 0.0 };
                let all = first.iter().filter(|s| (x - shift - s.centroid.x).abs() <= 0.27);
                assert_eq!(near, all.map(|s| s.id.0).collect::<Vec<_>>(), "at {x}");
            }
            assert!(places.has(label) && !places.has(99));
        }
        // Without boxes only labels count.
        let places = PairPlaces::new(&pairs, false, &StoneExtents::default());
        assert_eq!(places.near(Point3::origin(), 0).count(), 0);
        assert_eq!(places.near(Point3::origin(), 3).count(), 1);
    }
}
