//! The stones of one epoch as a pattern of places and sizes that any frame shows alike.

use super::centroids::area_ratio;
use crate::cloud::GridIndex;
use crate::geometry::{Rigid3, nearest_rotation};
use crate::statistics::upper_median;
use crate::stone::Stone;
use nalgebra::{Matrix3, Point3, Vector3};
use std::collections::BTreeMap;

/// Nearest neighbours with which a stone forms pairs.
const NEIGHBOURS: usize = 6;
/// Neighbours are sought this far away, in sizes of the usual stone.
const NEIGHBOUR_SIZES: f64 = 8.0;
/// A stone is the same as another if their centroids differ by less than this share of its size: a fifth is more than
/// masks of different photos differ by, and chance brings one stone of ten that near.
const SAME_SIZES: f64 = 0.2;
/// The share while a motion is known from two stones only, whose normals are good to some degrees.
const ROUGHLY_SAME_SIZES: f64 = 0.4;
/// Least ratio of the faces of one stone in two epochs.
const MIN_AREA_RATIO: f64 = 0.6;
/// A stone lies where the other epoch has stones if one is nearer than this, in sizes of the usual stone.
const COVERED_SIZES: f64 = 1.2;

/// Places and sizes of stones, searched by place.
pub(super) struct Constellation<'a> {
    pub stones: &'a [Stone],
    index: GridIndex,
    /// Root of the usual stone's area, metres.
    pub size_m: f64,
}

/// Two neighbours, in this order.
#[derive(Clone, Copy)]
pub(super) struct Neighbours {
    pub stones: [usize; 2],
    pub distance_m: f64,
}

/// What a motion brings together.
pub(super) struct Agreement {
    /// Stones that are the same: index in the first epoch, index in the second.
    pub same: Vec<[usize; 2]>,
    /// Stones of the second epoch that lie where the first one has stones.
    pub covered: usize,
    /// Number of the stones that are the same, each less the square of its distance as a share of the largest.
    pub closeness: f64,
}

impl Agreement {
    /// Number of the stones that are the same, as a share of those that lie where both epochs have stones.
    pub(super) fn share(&self) -> f64 {
        self.same.len() as f64 / self.covered.max(1) as f64
    }
}

/// How near two centroids must come, in sizes.
#[derive(Clone, Copy)]
pub(super) enum Nearness {
    Rough,
    Fine,
}

impl<'a> Constellation<'a> {
    pub(super) fn new(stones: &'a [Stone]) -> Self {
        let places: Vec<Point3<f64>> = stones.iter().map(|s| s.centroid).collect();
        let mut sizes: Vec<f64> = stones.iter().map(size_m).collect();
        let size_m = upper_median(&mut sizes).unwrap_or(0.0).max(0.01);
        Self {
            stones,
            index: GridIndex::new(&places, 2.0 * size_m),
            size_m,
        }
    }

    /// Every stone with each of its nearest neighbours.
    pub(super) fn pairs(&self) -> Vec<Neighbours> {
        let of = |i: usize| {
            let near = self.nearest(&self.stones[i].centroid, NEIGHBOURS + 1);
            near.into_iter()
                .filter(move |&(j, _)| j != i)
                .map(move |(j, distance_m)| Neighbours {
                    stones: [i, j],
                    distance_m,
                })
        };
        (0..self.stones.len()).flat_map(of).collect()
    }

    /// The nearest stones to a place, nearest first, with their distances.
    pub(super) fn nearest(&self, place: &Point3<f64>, count: usize) -> Vec<(usize, f64)> {
        let found = self.index.nearest_k(place, count, NEIGHBOUR_SIZES * self.size_m);
        found.into_iter().map(|(i, d2)| (i, d2.sqrt())).collect()
    }

    /// The frame of two neighbours: from the first stone to the second, across the wall's face, out of it.
    pub(super) fn frame(&self, [a, b]: [usize; 2]) -> Option<Matrix3<f64>> {
        let (a, b) = (&self.stones[a], &self.stones[b]);
        let along = (b.centroid - a.centroid).try_normalize(1e-9)?;
        let out = a.normal + b.normal;
        let out = (out - along * along.dot(&out)).try_normalize(1e-9)?;
        Some(Matrix3::from_columns(&[along, out.cross(&along), out]))
    }

    /// Which of some stones of another constellation a motion brings to one of these; no stone is two others.
    pub(super) fn agreement(
        &self,
        other: &[Stone],
        among: impl IntoIterator<Item = usize>,
        motion: &Rigid3,
        nearness: Nearness,
    ) -> Agreement {
        let sizes = match nearness {
            Nearness::Rough => ROUGHLY_SAME_SIZES,
            Nearness::Fine => SAME_SIZES,
        };
        let mut partners: BTreeMap<usize, (f64, usize)> = BTreeMap::new();
        let mut covered = 0;

        for j in among {
            let place = motion * other[j].centroid;
            let Some((i, d2)) = self.index.nearest(&place, COVERED_SIZES * self.size_m) else {
                continue;
            };
            covered += 1;
            let distance = d2.sqrt() / (sizes * size_m(&other[j]).min(size_m(&self.stones[i])));
            let nearest_yet = partners.get(&i).is_none_or(|&(best, _)| distance < best);
            if distance <= 1.0 && nearest_yet && area_ratio(&self.stones[i], &other[j]) >= MIN_AREA_RATIO {
                partners.insert(i, (distance, j));
            }
        }

        Agreement {
            closeness: partners.values().map(|&(d, _)| 1.0 - d * d).sum(),
            same: partners.into_iter().map(|(i, (_, j))| [i, j]).collect(),
            covered,
        }
    }
}

fn size_m(stone: &Stone) -> f64 {
    stone.area_m2.max(0.0).sqrt()
}

/// The rigid motion that brings places together (Kabsch 1976), `first = motion * second`; places that fit badly
/// count less (Cauchy weights about the median distance). `None` for fewer than three places.
pub(super) fn rigid_fit(places: &[[Point3<f64>; 2]], start: Option<&Rigid3>) -> Option<RigidFit> {
    if places.len() < 3 {
        return None;
    }
    let distance = |motion: &Rigid3, [a, b]: &[Point3<f64>; 2]| (a - motion * b).norm();
    let weights: Vec<f64> = match start {
        None => vec![1.0; places.len()],
        Some(motion) => {
            let mut distances: Vec<f64> = places.iter().map(|p| distance(motion, p)).collect();
            let usual = upper_median(&mut distances)?.max(1e-6);
            let weight = |p| 1.0 / (1.0 + (distance(motion, p) / (2.0 * usual)).powi(2));
            places.iter().map(weight).collect()
        }
    };
    let total: f64 = weights.iter().sum();

    let [mean_a, mean_b] = [0, 1].map(|e| {
        let moved = places.iter().zip(&weights);
        let origin = places[0][e];
        origin + moved.map(|(p, w)| (p[e] - origin) * *w).sum::<Vector3<f64>>() / total
    });
    let mut covariance = Matrix3::zeros();
    for ([a, b], w) in places.iter().zip(&weights) {
        covariance += (a - mean_a) * (b - mean_b).transpose() * *w;
    }
    let rotation = nearest_rotation(&covariance);
    let motion = Rigid3::from_parts((mean_a.coords - rotation * mean_b.coords).into(), rotation);
    let misfit: f64 = places
        .iter()
        .zip(&weights)
        .map(|(pair, w)| w * distance(&motion, pair).powi(2))
        .sum();

    let rms_m = (misfit / total).sqrt();
    Some(RigidFit { motion, rms_m })
}

/// A rigid motion and how well it fits.
pub(super) struct RigidFit {
    pub motion: Rigid3,
    pub rms_m: f64,
}
