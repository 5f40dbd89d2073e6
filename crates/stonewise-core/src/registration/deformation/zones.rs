//! Zones that deformed: connected stones whose deformation is not zero.

use super::body::Body;
use super::found::{DeformationZone, OUTSIDE, ZoneKind};
use super::rigid_part::RigidPart;
use super::scan::Scan;
use crate::components::components;
use crate::geometry::FaceFrame;
use crate::statistics::{chi_square_p, discoveries};
use nalgebra::{Matrix3, Vector3};
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::BTreeSet;

/// Share of false discoveries that is accepted among the stones of all zones.
const FALSE_DISCOVERY_RATE: f64 = 0.05;
/// Fewer connected stones are no zone: one or two that differ from their surroundings are judged as loose stones are.
const LEAST_STONES: usize = 3;
/// Share of the variance of the motion across a zone that a plane must explain to call it a tilt.
const TILTED: f64 = 0.8;
/// Least standard deviation of the motion across a tilted zone, as a share of its mean: half of what a tilt about one
/// side has.
const UNEVEN: f64 = 0.3;
/// Least mean of a zone's motions, as a share of the mean of their sizes, for the zone to have moved in one direction:
/// three quarters of the motion has one sign.
const ONE_WAY: f64 = 0.5;
/// Fewest stones that show a tilt.
const TILT_STONES: usize = 6;
/// Cosine of the angle to the vertical above which a face lies level, as on a step or a crest.
const LEVEL: f64 = 0.7;

/// The zones of a body that deformed; their numbers are left open.
///
/// Stones are tested one by one with the false discovery rate controlled over the body (Benjamini & Hochberg 1995; tests
/// of stones that share errors are positively dependent). Fewer than three connected stones, or stones whose interval
/// begins at zero, are no zone. If none is left, the zone is the most likely bulge, with the amplitude that the stones'
/// own observations give it, as the field smooths weak motions.
pub(super) fn zones(body: &Body, rigid: &RigidPart, scan: &Scan) -> Vec<DeformationZone> {
    let p = |(i, square): (usize, &f64)| body.stones[i].is_firm.then(|| chi_square_p(*square, 3));
    let p_values: Vec<Option<f64>> = rigid.squares.iter().enumerate().map(p).collect();
    let moved: BTreeSet<usize> = discoveries(&p_values, FALSE_DISCOVERY_RATE).into_iter().collect();
    let mut next = vec![Vec::new(); body.stones.len()];
    for [low, high] in &body.neighbours {
        if moved.contains(low) && moved.contains(high) {
            next[*low].push(*high);
            next[*high].push(*low);
        }
    }
    let parts = components(next.len(), |stone| next[stone].iter().copied());
    let of_part = |stones: &Vec<usize>| {
        let zone = (stones.len() >= LEAST_STONES).then(|| zone(body, rigid, stones))?;
        (zone.interval_m[0] > 0.0).then_some(zone)
    };
    let found: Vec<DeformationZone> = parts.iter().filter_map(of_part).collect();
    match found.is_empty() {
        true => vec![bulge(body, scan)],
        false => found,
    }
}

/// The zone of the most likely bulge. Its interval holds with 95 % although the bulge was chosen from all places, sizes
/// and directions.
fn bulge(body: &Body, scan: &Scan) -> DeformationZone {
    let found = &scan.most_likely;
    let moved = |(_, share): &(usize, f64)| Vector3::ith(found.direction, found.amplitude_m * share);
    let in_face: Vec<Vector3<f64>> = found.stones.iter().map(moved).collect();
    let largest = found.stones.iter().map(|s| s.1).fold(0.0, f64::max);
    let (largest_m, half_m) = (
        largest * found.amplitude_m.abs(),
        scan.reach * largest * found.amplitude_sd_m,
    );
    let interval_m = [(largest_m - half_m).max(0.0), largest_m + half_m];
    let stones: Vec<usize> = found.stones.iter().map(|s| s.0).collect();
    described(body, &stones, &in_face, largest_m, interval_m)
}

/// The zone of these stones. Its interval holds the largest deformation of them all, not only that of the stone at which
/// the measured one is largest (Bonferroni over the stones).
fn zone(body: &Body, rigid: &RigidPart, stones: &[usize]) -> DeformationZone {
    let quantile = Normal::standard().inverse_cdf(1.0 - 0.5 * OUTSIDE / stones.len() as f64);
    let (mut largest_m, mut low_m, mut high_m): (f64, f64, f64) = (0.0, 0.0, 0.0);
    for &i in stones {
        let (deformation, covariance) = &rigid.deformations[i];
        let length_m = deformation.norm();
        let direction = deformation.try_normalize(0.0).unwrap_or_else(Vector3::x);
        let half_m = quantile * direction.dot(&(covariance * direction)).max(0.0).sqrt();
        largest_m = largest_m.max(length_m);
        low_m = low_m.max(length_m - half_m);
        high_m = high_m.max(length_m + half_m);
    }
    let motion = |&i: &usize| body.stones[i].joint.face_from_world * rigid.deformations[i].0;
    let in_face: Vec<Vector3<f64>> = stones.iter().map(motion).collect();
    described(body, stones, &in_face, largest_m, [low_m, high_m])
}

/// `in_face`: the motion of each stone along, up and out; `interval_m`: of the largest, 95 %.
fn described(
    body: &Body,
    stones: &[usize],
    in_face: &[Vector3<f64>],
    largest_m: f64,
    interval_m: [f64; 2],
) -> DeformationZone {
    let in_face = &in_wall(body, stones, in_face);
    let mean_m = in_face.iter().sum::<Vector3<f64>>() / stones.len() as f64;
    let mut ids: Vec<_> = stones.iter().map(|&i| body.stones[i].id).collect();
    ids.sort_unstable();
    DeformationZone {
        number: 0,
        stones: ids,
        largest_m,
        interval_m,
        mean_m,
        kind: kind(body, stones, in_face, &mean_m),
    }
}

/// The motions (along, up, out) with those of level faces along, up and out of the upright wall around them: what moves
/// out of a level face rises.
fn in_wall(body: &Body, stones: &[usize], in_face: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let frame = |i: usize| body.stones[i].joint.face_from_world;
    let out = |i: usize| frame(i).row(2).transpose();
    let is_level = |i: usize| out(i).z.abs() > LEVEL;
    let upright = |stones: &mut dyn Iterator<Item = usize>| {
        let sum: Vector3<f64> = stones.filter(|&i| !is_level(i)).map(out).sum();
        Vector3::new(sum.x, sum.y, 0.0).try_normalize(0.0)
    };
    let wall = upright(&mut stones.iter().copied()).or_else(|| upright(&mut (0..body.stones.len())));
    let of_stone = |(&i, motion): (&usize, &Vector3<f64>)| match &wall {
        Some(out) if is_level(i) => {
            FaceFrame::from_normal(out).face_from_world() * frame(i).transpose() * motion
        }
        _ => *motion,
    };
    stones.iter().zip(in_face).map(of_stone).collect()
}

/// What the motions of a zone (along, up, out) resemble: by the component that is largest in the quadratic mean and its
/// sign, and across the wall by whether they grow towards one side.
fn kind(body: &Body, stones: &[usize], in_face: &[Vector3<f64>], mean: &Vector3<f64>) -> ZoneKind {
    let squares: Vector3<f64> = in_face.iter().map(|d| d.component_mul(d)).sum();
    let largest = squares.imax();
    let mean_size = in_face.iter().map(|d| d[largest].abs()).sum::<f64>() / stones.len() as f64;
    let is_one_way = mean[largest].abs() >= ONE_WAY * mean_size;
    match largest {
        2 if is_tilt(body, stones, in_face) => ZoneKind::Tilt,
        _ if !is_one_way => ZoneKind::Distortion,
        0 => ZoneKind::Slide,
        1 if mean.y < 0.0 => ZoneKind::Settlement,
        1 => ZoneKind::Heave,
        _ if mean.z > 0.0 => ZoneKind::Bulge,
        _ => ZoneKind::Dent,
    }
}

/// Whether a plane explains how far stones moved out.
fn is_tilt(body: &Body, stones: &[usize], in_face: &[Vector3<f64>]) -> bool {
    if stones.len() < TILT_STONES {
        return false;
    }
    let middle = stones
        .iter()
        .map(|&i| body.stones[i].joint.place.coords)
        .sum::<Vector3<f64>>()
        / stones.len() as f64;
    let frame = body.stones[stones[0]].joint.face_from_world;
    let (mut normal, mut right, mut whole) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    let mean = in_face.iter().map(|d| d.z).sum::<f64>() / stones.len() as f64;
    for (&i, d) in stones.iter().zip(in_face) {
        let place = frame * (body.stones[i].joint.place.coords - middle);
        let row = Vector3::new(1.0, place.x, place.y);
        normal += row * row.transpose();
        right += row * (d.z - mean);
        whole += (d.z - mean).powi(2);
    }
    let Some(factor) = normal.cholesky() else {
        return false;
    };
    let count = stones.len() as f64;
    // Per degree of freedom: a plane goes through any three stones.
    let rest = (whole - right.dot(&factor.solve(&right))) / (count - 3.0);
    let varies = whole > count * (UNEVEN * mean).powi(2);
    varies && rest < (1.0 - TILTED) * whole / (count - 1.0)
}
