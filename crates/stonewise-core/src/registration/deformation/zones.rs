//! Zones that deformed: areas around peaks of the deformation along the wall, up and out.

use super::areas::{Area, HALF, Motion};
use super::body::Body;
use super::extent::Extent;
use super::found::{Against, DeformationZone, OUTSIDE, ZoneKind};
use super::frames::frames;
use super::rigid_part::RigidPart;
use super::scan::Scan;
use super::shape::shape;
use crate::registration::bulges::OUT;
use crate::statistics::{chi_square_p, discoveries};
use nalgebra::{Matrix3, Vector3};
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::BTreeSet;

/// Share of false discoveries that is accepted among the motions of all stones in the three directions.
const FALSE_DISCOVERY_RATE: f64 = 0.05;
/// Number of the direction up the wall.
const UP: usize = 1;

/// A body and how its stones deformed.
pub(super) struct Wall<'a> {
    body: &'a Body<'a>,
    rigid: &'a RigidPart,
    against: Against,
    /// Neighbours of each stone that count for the shape of the wall.
    next: Vec<Vec<usize>>,
    /// Takes world components to along, up and out.
    frames: Vec<Matrix3<f64>>,
}

impl<'a> Wall<'a> {
    pub fn new(body: &'a Body, rigid: &'a RigidPart, against: Against) -> Self {
        let mut next = vec![Vec::new(); body.stones.len()];
        for [low, high] in &body.neighbours {
            if body.stones[*low].is_firm && body.stones[*high].is_firm {
                next[*low].push(*high);
                next[*high].push(*low);
            }
        }
        Self {
            frames: frames(body, &next),
            body,
            rigid,
            against,
            next,
        }
    }

    /// The zones that deformed, the one of the largest motion first; their numbers are left open.
    ///
    /// The motions along, up and out of each stone are tested with the false discovery rate controlled over the body
    /// (Benjamini & Hochberg 1995; tests of stones that share errors are positively dependent). An area whose interval
    /// begins at zero is no zone. Of two that share more than half of their stones, the one that moved less is part of
    /// the other's motion.
    pub fn zones(&self) -> Vec<DeformationZone> {
        let mut found = self.of_directions();
        found.sort_by(|a, b| b.largest_m.total_cmp(&a.largest_m));
        let mut zones: Vec<DeformationZone> = Vec::new();
        for zone in found {
            if !zones.iter().any(|larger| is_same(larger, &zone)) {
                zones.push(zone);
            }
        }
        zones
    }

    /// A zone for each area of each direction.
    fn of_directions(&self) -> Vec<DeformationZone> {
        let count = self.body.stones.len();
        let motion = |k: usize, i: usize| (self.frames[i] * self.rigid.deformations[i].0)[k];
        let sd = |k: usize, i: usize| {
            let axis = self.frames[i].row(k).transpose();
            axis.dot(&(self.rigid.deformations[i].1 * axis)).max(0.0).sqrt()
        };
        let motions: [Vec<f64>; 3] = [0, 1, 2].map(|k| (0..count).map(|i| motion(k, i)).collect());
        let sds: [Vec<f64>; 3] = [0, 1, 2].map(|k| (0..count).map(|i| sd(k, i)).collect());
        let p = |(k, i): (usize, usize)| {
            let square = (motions[k][i] / sds[k][i]).powi(2);
            self.body.stones[i].is_firm.then(|| chi_square_p(square, 1))
        };
        let tests = (0..3).flat_map(|k| (0..count).map(move |i| (k, i)));
        let p_values: Vec<Option<f64>> = tests.map(p).collect();
        let mut moved = vec![false; 3 * count];
        discoveries(&p_values, FALSE_DISCOVERY_RATE)
            .into_iter()
            .for_each(|test| moved[test] = true);

        let mut zones = Vec::new();
        for (k, moved) in moved.chunks(count).enumerate() {
            for sign in [1.0, -1.0] {
                let signed: Vec<f64> = motions[k].iter().map(|m| sign * m).collect();
                let motion = Motion::new(&self.next, &signed, &sds[k]);
                for area in motion.areas(moved) {
                    let extent = Extent::new(self.body, &self.next, &motion, &area);
                    let kind = match k {
                        OUT => shape(self.body, &area, &motion, [&signed, &sds[k]], &extent),
                        _ => in_face(k, sign),
                    };
                    zones.extend(self.zone(&area, k, kind, extent.sides_m()));
                }
            }
        }
        zones
    }

    /// The zone of an area in direction `k`; `None` if its interval begins at zero. A stone that moved most in this
    /// direction counts with its whole deformation, any other with its component in it. The interval holds the largest
    /// deformation of all stones, not only of the stone with the largest measured one (Bonferroni over the stones).
    fn zone(&self, area: &Area, k: usize, kind: ZoneKind, sides_m: [f64; 2]) -> Option<DeformationZone> {
        let quantile = Normal::standard().inverse_cdf(1.0 - 0.5 * OUTSIDE / area.stones.len() as f64);
        let (mut largest_m, mut low_m, mut high_m): (f64, f64, f64) = (0.0, 0.0, 0.0);
        let mut mean_m = Vector3::zeros();
        for &i in &area.stones {
            let (deformation, covariance) = &self.rigid.deformations[i];
            let in_wall = self.frames[i] * deformation;
            let axis = match in_wall.iamax() == k {
                true => deformation.try_normalize(0.0).unwrap_or_else(Vector3::x),
                false => self.frames[i].row(k).transpose(),
            };
            let length_m = axis.dot(deformation).abs();
            let half_m = quantile * axis.dot(&(covariance * axis)).max(0.0).sqrt();
            largest_m = largest_m.max(length_m);
            low_m = low_m.max(length_m - half_m);
            high_m = high_m.max(length_m + half_m);
            mean_m += in_wall / area.stones.len() as f64;
        }
        let size = Size {
            sides_m,
            largest_m,
            interval_m: [low_m, high_m],
        };
        (low_m > 0.0).then(|| self.described(&area.stones, kind, mean_m, size))
    }

    /// The zone of the most likely bulge, for where stones show no zone because the field smooths weak motions. Its
    /// amplitude is that of the stones' own observations. The interval holds with 95 % although the bulge was chosen
    /// from all places, sizes and directions.
    pub fn bulge(&self, scan: &Scan) -> DeformationZone {
        let found = &scan.most_likely;
        let largest = found.stones.iter().map(|s| s.1).fold(0.0, f64::max);
        let half = || found.stones.iter().filter(|s| s.1 >= HALF * largest);
        let moved = |&(i, share): &(usize, f64)| {
            let world_from_face = self.body.stones[i].joint.face_from_world.transpose();
            self.frames[i] * world_from_face * Vector3::ith(found.direction, found.amplitude_m * share)
        };
        let mean_m = half().map(moved).sum::<Vector3<f64>>() / half().count() as f64;
        let (largest_m, half_m) = (
            largest * found.amplitude_m.abs(),
            scan.reach * largest * found.amplitude_sd_m,
        );
        let stones: Vec<usize> = half().map(|s| s.0).collect();
        let size = Size {
            // A cos^2 is half as large half of the way to its edge.
            sides_m: [HALF * found.diameter_m; 2],
            largest_m,
            interval_m: [(largest_m - half_m).max(0.0), largest_m + half_m],
        };
        let kind = match mean_m.iamax() {
            OUT => ZoneKind::Bulge,
            k => in_face(k, mean_m[k]),
        };
        self.described(&stones, kind, mean_m, size)
    }

    fn described(
        &self,
        stones: &[usize],
        kind: ZoneKind,
        mean_m: Vector3<f64>,
        size: Size,
    ) -> DeformationZone {
        let mut ids: Vec<_> = stones.iter().map(|&i| self.body.stones[i].id).collect();
        ids.sort_unstable();
        let [length_m, width_m] = size.sides_m;
        let is_round = length_m - width_m < self.body.step_m();
        DeformationZone {
            number: 0,
            stones: ids,
            diameter_m: is_round.then_some((length_m * width_m).sqrt()),
            length_m,
            width_m,
            largest_m: size.largest_m,
            interval_m: size.interval_m,
            mean_m,
            kind,
            against: self.against,
        }
    }
}

/// Whether two zones share more than half of the stones of both.
fn is_same(a: &DeformationZone, b: &DeformationZone) -> bool {
    let of_a: BTreeSet<_> = a.stones.iter().collect();
    let shared = b.stones.iter().filter(|id| of_a.contains(id)).count();
    shared as f64 > HALF * (a.stones.len() + b.stones.len() - shared) as f64
}

/// How large a zone is and how far it moved, metres.
struct Size {
    /// Length and width.
    sides_m: [f64; 2],
    largest_m: f64,
    /// Of the largest, 95 %.
    interval_m: [f64; 2],
}

/// The kind of what moved in direction `k` in the face.
fn in_face(k: usize, moved: f64) -> ZoneKind {
    match k == UP && moved < 0.0 {
        true => ZoneKind::Settlement,
        false => ZoneKind::Other,
    }
}
