//! The clouds of a repetition: those of the first survey with other noise, and with every station moved by an error of
//! its own.
//!
//! Another noise of the same size, and uncorrelated with the first, follows from the residuals about a smooth surface by
//! giving some of them, chosen at random, the other sign (the wild bootstrap of Wu 1986, with the two-point distribution
//! of Liu 1988).

use crate::error::{Error, Result};
use crate::project::Epoch;
use crate::sources::SourceRule;
use crate::storage::step::Key;
use crate::storage::store::StepStore;
use nalgebra::{Point3, Vector3};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use stonewise_core::cloud::GridIndex;
use stonewise_core::geometry::Plane;
use stonewise_core::statistics::split_mix;
use stonewise_io::cloud::{Observed, cloud_crs, measure_cloud, read_cloud, stream_points_laz};

/// Points that pass by at once.
const CHUNK: usize = 1 << 18;
/// The plane through this many nearest points within this distance, metres, gives the direction across the surface; a point
/// with fewer than half of them keeps its place.
const NEIGHBOURS: usize = 64;
const NEAR_M: f64 = 0.1;
/// The surface at a point is the mean of the plane's residuals of this many of them that lie nearest along the plane.
const AVERAGED: usize = 5;
/// Share of the points whose residual changes its sign: n / (2 (n - 1)) of means of n, so that nothing of the noise stays.
const CHANGED: f64 = 0.5 * AVERAGED as f64 / (AVERAGED as f64 - 1.0);
/// How far points may be moved beyond the box of a cloud, metres.
const AROUND_M: f64 = 1.0;

/// How far a station of the repetition is off: a shift and a small rotation about the middle of the cloud.
struct StationError {
    shift: Vector3<f64>,
    turn: Vector3<f64>,
}

impl StationError {
    /// Independent normal numbers with these standard deviations, metres and radians.
    fn draw(station: u64, [shift_m, turn_rad]: [f64; 2], seed: u64) -> Self {
        let normal = |number: u64| {
            let mixed = split_mix(seed ^ split_mix(station ^ split_mix(number)));
            // The middles of 2^53 equal parts: neither 0 nor 1.
            let share = ((mixed >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
            Normal::standard().inverse_cdf(share)
        };
        Self {
            shift: Vector3::from_fn(|axis, _| shift_m * normal(axis as u64)),
            turn: Vector3::from_fn(|axis, _| turn_rad * normal(3 + axis as u64)),
        }
    }

    fn moved(&self, p: &Point3<f64>, middle: &Point3<f64>) -> Point3<f64> {
        p + self.shift + self.turn.cross(&(p - middle))
    }
}

/// The clouds of an epoch with every station moved by an error of its own.
pub(super) fn moved_clouds(
    epoch: &Epoch,
    sizes: [f64; 2],
    seed: u64,
    store: &StepStore,
) -> Result<Vec<PathBuf>> {
    let digests: Vec<String> = epoch
        .clouds
        .iter()
        .map(|cloud| store.digest(cloud))
        .collect::<Result<_>>()?;
    let digests: Vec<&str> = digests.iter().map(String::as_str).collect();
    let key = Key::new("repetition", &(seed, sizes, epoch.sources), &digests);
    let name = |number: usize| format!("cloud_{}.laz", number + 1);
    let (dir, _) = store.step("repetition", key, &[], |dir| {
        for (number, cloud) in epoch.clouds.iter().enumerate() {
            move_cloud(epoch.sources, number, cloud, &dir.file(name(number)), sizes, seed)?;
        }
        Ok(())
    })?;
    Ok((0..epoch.clouds.len())
        .map(|number| dir.file(name(number)))
        .collect())
}

fn move_cloud(
    rule: SourceRule,
    number: usize,
    from: &Path,
    to: &Path,
    sizes: [f64; 2],
    seed: u64,
) -> Result<()> {
    let Some(bounds) = measure_cloud(from)?.1 else {
        return Ok(());
    };
    let (middle, around) = (bounds.centre(), bounds.grown(AROUND_M));
    let crs = cloud_crs(from)?;
    let mut read = 0;
    stream_points_laz(to, crs.as_deref(), &around, &[], |sink| {
        read_cloud(from, CHUNK, |chunk| {
            let own = |i: usize| match (&chunk.sources, chunk.scan) {
                (Some(sources), _) => sources[i],
                (None, scan) => scan.unwrap_or(0) as u16,
            };
            let sources: Vec<u16> = (0..chunk.len()).map(own).collect();
            let station = |i: usize| match rule {
                SourceRule::Auto => u64::from(sources[i]) | (number as u64) << 16,
                SourceRule::File => (number as u64) << 16,
                SourceRule::None => 0,
            };
            let mut errors: BTreeMap<u64, StationError> = BTreeMap::new();
            let scattered = scattered_anew(&chunk.positions, seed ^ split_mix(read));
            read += chunk.len() as u64;
            let moved: Vec<Point3<f64>> = scattered
                .iter()
                .enumerate()
                .map(|(i, p)| {
                    let error = errors
                        .entry(station(i))
                        .or_insert_with(|| StationError::draw(station(i), sizes, seed));
                    error.moved(p, &middle)
                })
                .collect();
            let none = vec![0.0; chunk.len()];
            let observed = Observed {
                sources: &sources,
                times: chunk.times_s.as_deref().unwrap_or(&none),
            };
            Ok::<_, Error>(sink.append_observed(&moved, observed, &[])?)
        })?;
        Ok(())
    })
}

/// Points with another noise of the same size.
///
/// A residual against a mean that the point itself is part of has less variance than the noise, by just what the noise of
/// the mean adds where the sign changes. Cost: some ten microseconds a point, on all cores.
fn scattered_anew(points: &[Point3<f64>], seed: u64) -> Vec<Point3<f64>> {
    let index = GridIndex::for_nearest(points);
    let anew = |(i, p): (usize, &Point3<f64>)| {
        let drawn = (split_mix(seed ^ split_mix(i as u64)) >> 11) as f64 / (1u64 << 53) as f64;
        if drawn >= CHANGED {
            return *p;
        }
        let near = index.nearest_k(p, NEIGHBOURS, NEAR_M);
        let around: Vec<Point3<f64>> = near.iter().map(|&(k, _)| points[k]).collect();
        let Some(plane) = Plane::fit(&around).filter(|_| 2 * around.len() >= NEIGHBOURS) else {
            return *p;
        };
        let height = |q: &Point3<f64>| (q - plane.centroid).dot(&plane.normal);
        let own = height(p);
        let mut heights: Vec<(f64, f64)> = { around.iter() }
            .map(|q| (height(q), (q - p).norm_squared() - (height(q) - own).powi(2)))
            .collect();
        heights.sort_by(|a, b| a.1.total_cmp(&b.1));
        heights.truncate(AVERAGED);
        let surface = heights.iter().map(|h| h.0).sum::<f64>() / heights.len() as f64;
        p - plane.normal * (2.0 * (own - surface))
    };
    points.par_iter().enumerate().map(anew).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_noise_has_the_size_of_the_first_and_nothing_in_common_with_it() {
        // A plane that leans, points 7 mm apart, noise of 8 mm along its normal.
        const NOISE_M: f64 = 0.008;
        let normal = Vector3::new(0.6, 0.0, 0.8);
        let along = [Vector3::new(0.8, 0.0, -0.6), Vector3::y()];
        let draw = |i: usize| StationError::draw(i as u64, [NOISE_M, 0.0], 11).shift.x;
        let count = 200;
        let exact = |i: usize| {
            let [x, y] = [i % count, i / count].map(|k| 0.007 * k as f64);
            Point3::new(1e3, 2e3, 3e2) + along[0] * x + along[1] * y
        };
        let points: Vec<Point3<f64>> = (0..count * count).map(|i| exact(i) + normal * draw(i)).collect();
        let anew = scattered_anew(&points, 3);
        let (mut square, mut product) = (0.0, 0.0);
        for (i, p) in anew.iter().enumerate() {
            let noise = (p - exact(i)).dot(&normal) / NOISE_M;
            square += noise * noise;
            product += noise * draw(i) / NOISE_M;
        }
        let n = points.len() as f64;
        assert!((square / n - 1.0).abs() < 0.05, "{}", square / n);
        assert!((product / n).abs() < 0.05, "{}", product / n);
        let far = [
            Point3::origin(),
            Point3::new(1.0, 0.0, 0.0),
            Point3::new(0.0, 1.0, 0.0),
        ];
        assert_eq!(scattered_anew(&far, 3), far);
    }

    #[test]
    fn errors_of_stations_have_the_size_asked_for() {
        let errors: Vec<StationError> = (0..2000)
            .map(|k| StationError::draw(k, [2e-3, 1e-4], 5))
            .collect();
        let rms = |of: fn(&StationError) -> f64| {
            (errors.iter().map(|e| of(e).powi(2)).sum::<f64>() / errors.len() as f64).sqrt()
        };
        // Of 2,000 draws: standard error 1.6 %.
        assert!((rms(|e| e.shift.x) / 2e-3 - 1.0).abs() < 0.06);
        assert!((rms(|e| e.turn.z) / 1e-4 - 1.0).abs() < 0.06);
        assert_eq!(
            StationError::draw(1, [1.0; 2], 5).shift,
            StationError::draw(1, [1.0; 2], 5).shift
        );
        assert_ne!(
            StationError::draw(1, [1.0; 2], 5).shift,
            StationError::draw(1, [1.0; 2], 6).shift
        );
    }
}
