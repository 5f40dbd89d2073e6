//! Differences between the sources of one epoch, from the points of single stones.

use super::observation::Observation;
use super::sight::{SeenStone, Sight, Source, SourcePoints, Target};
use crate::cloud::Cloud;
use crate::geometry::FaceFrame;
use crate::id::StoneId;
use crate::params::{Params, Range, Ranged, with_ranges};
use crate::registration::adjustment::observation::surface::{
    Equations, FitOptions, Layout, LocalPair, SurfaceNoise, equations, estimate_noise,
};
use crate::registration::adjustment::stone_vector::StoneVector;
use crate::registration::points::{PairPoints, face_spacing};
use crate::statistics::upper_median;
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Parameters of the comparison of an epoch's sources.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct ContrastParams {
    /// Points that a source needs on a stone.
    pub min_points: usize,
    /// Most points of a source on a stone that are used; more cost time and change nothing that matters here.
    pub max_points: usize,
    /// Most stones whose sources are compared, evenly chosen; the variances of a wall need no more.
    pub max_stones: usize,
    /// Cell of the stones' surface grid in median point spacings of one source.
    pub cell_spacings: f64,
    /// Smallest cell, metres: finer than a scanner's footprint shows nothing.
    pub min_cell_m: f64,
    /// Longest side of a piece of a face, cells.
    pub patch_cells: usize,
    /// Residuals beyond this many sigmas lose weight.
    pub outlier_sigmas: f64,
}

impl Default for ContrastParams {
    fn default() -> Self {
        Self {
            min_points: 40,
            max_points: 4000,
            max_stones: 400,
            cell_spacings: 2.0,
            min_cell_m: 0.003,
            patch_cells: 24,
            outlier_sigmas: 3.5,
        }
    }
}

impl Params for ContrastParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::NOT_NEGATIVE.holds("min_points", self.min_points),
            Range::NOT_NEGATIVE.holds("max_points", self.max_points),
            Range::NOT_NEGATIVE.holds("max_stones", self.max_stones),
            Range::POSITIVE.holds("cell_spacings", self.cell_spacings),
            Range::POSITIVE.holds("min_cell_m", self.min_cell_m),
            Range::POSITIVE.holds("patch_cells", self.patch_cells),
            Range::POSITIVE.holds("outlier_sigmas", self.outlier_sigmas),
        ]
    }
}

/// Pairs of points whose noise is estimated.
const NOISE_SAMPLE: usize = 32;
/// Rounds in which the sources' common differences are found and removed before the stones are compared.
const ALIGNMENTS: usize = 3;
/// Share of the face, seen along its normal, that two sources must both show. A source that shows another side of a
/// stone at a corner shows the edge of this face alone.
const LEAST_OVERLAP: f64 = 0.25;
/// Cells of a face, in distances of neighbouring points.
const FACE_SPACINGS: f64 = 2.0;
/// A cell that is as many times deeper than wide shows a flank of the stone, seen along the face.
const STEEP: f64 = 2.0;
/// Share of its points on a flank beyond which a stone is not compared: points there are close together in the face, and
/// their depths differ by as much as the flank is deep. Ordinary stones have less than 0.02.
const MOST_STEEP: f64 = 0.05;
/// Standard deviation that stands for "not seen", metres: keeps a flat stone's covariance finite.
const UNSEEN_M: f64 = 0.1;

/// What the sources of epoch `epoch` show of the stones, relative to the source that shows most of each.
pub(super) fn contrasts(
    sources: &[Source],
    stones: &[SeenStone],
    epoch: usize,
    params: &ContrastParams,
) -> Vec<Observation> {
    let seen: Vec<Comparison> = stones
        .iter()
        .filter_map(|stone| Comparison::new(sources, stone, epoch, params))
        .collect();
    if seen.is_empty() {
        return Vec::new();
    }
    let mut spacings: Vec<f64> = seen.iter().map(|c| c.spacing_m).collect();
    let spacing_m = upper_median(&mut spacings).unwrap_or(0.0);
    let layout = Layout {
        cell_m: (params.cell_spacings * spacing_m).max(params.min_cell_m),
        patch_cells: params.patch_cells,
        outlier_sigmas: params.outlier_sigmas,
    };

    let mut noise = SurfaceNoise {
        sigma_m: [0.003; 2],
        tau_m: 0.001,
    };
    let mut shifts: BTreeMap<(usize, usize), Vector3<f64>> = BTreeMap::new();

    for _ in 0..ALIGNMENTS {
        noise = common_noise(&seen, &shifts, &noise, &layout);
        shifts = common_shifts(&seen, &shifts, &noise, &layout);
    }

    seen.par_iter()
        .map(|comparison| comparison.observe(&shifts, &noise, &layout))
        .collect()
}

/// A stone with the sources of one epoch that show enough of it; the first shows most.
struct Comparison {
    sights: Vec<(Sight, u64)>,
    pairs: Vec<LocalPair>,
    spacing_m: f64,
    face_from_world: Matrix3<f64>,
}

impl Comparison {
    /// `None` where fewer than two sources show enough.
    fn new(sources: &[Source], stone: &SeenStone, epoch: usize, params: &ContrastParams) -> Option<Self> {
        let mut seen: Vec<(&SourcePoints, Cloud)> = stone
            .sights
            .iter()
            .filter(|s| sources[s.source].epoch == epoch && s.points.len() >= params.min_points)
            .map(|s| (s, thinned(&s.points, params.max_points)))
            .collect();
        if seen.len() < 2 {
            return None;
        }
        seen.sort_by_key(|(s, _)| (std::cmp::Reverse(s.points.len()), s.source));
        let shown = FaceCells::of_clouds(seen.iter().map(|(_, cloud)| cloud), &stone.normal);
        let widest = shown.iter().max_by_key(|cells| cells.by_place.len())?;
        if widest.steep_share() > MOST_STEEP {
            return None;
        }
        let mut is_of_face = shown.iter().map(|cells| cells.overlap(widest) >= LEAST_OVERLAP);
        seen.retain(|_| is_of_face.next().unwrap_or(false));
        let (reference, others) = seen.split_first().filter(|(_, others)| !others.is_empty())?;
        let frame = FaceFrame::from_normal(&stone.normal).face_from_world();

        let pair = |(_, other): &(&SourcePoints, Cloud)| {
            let pair = PairPoints {
                first: StoneId(1),
                second: StoneId(1),
                centroid: stone.centroid,
                centroid_second: stone.centroid,
                normal: stone.normal,
                points_first: reference.1.clone(),
                points_second: other.clone(),
                nearby_second: Cloud::new(stone.centroid, Vec::new()),
                window: None,
            };
            LocalPair::new(&pair, &frame, [1.0; 2])
        };

        let sight = |(s, cloud): &(&SourcePoints, Cloud)| {
            let sight = Sight {
                source: s.source,
                time_s: s.time_s,
                place: stone.centroid,
                target: Target::Stone { normal: stone.normal },
            };
            (sight, cloud.len() as u64)
        };

        Some(Self {
            pairs: others.iter().map(pair).collect(),
            spacing_m: face_spacing(&reference.1, &stone.normal),
            sights: seen.iter().map(sight).collect(),
            face_from_world: frame,
        })
    }

    fn shift(&self, k: usize, shifts: &BTreeMap<(usize, usize), Vector3<f64>>) -> Vector3<f64> {
        let (reference, other) = (self.sights[0].0.source, self.sights[k + 1].0.source);
        shifts.get(&(reference, other)).copied().unwrap_or_default()
    }

    /// Equations of the displacement of source k + 1 against the first, at `shift` (world).
    fn equations(
        &self,
        k: usize,
        shift: &Vector3<f64>,
        noise: &SurfaceNoise,
        layout: &Layout,
    ) -> Translation {
        let x = self.motion(shift);
        let e = equations(&self.pairs[k], &x, &x, noise, layout, &FitOptions::EXACT);
        Translation::new(&e, shift, &self.face_from_world)
    }

    fn motion(&self, shift: &Vector3<f64>) -> StoneVector {
        StoneVector::from_translation(self.face_from_world * shift)
    }

    fn observe(
        &self,
        shifts: &BTreeMap<(usize, usize), Vector3<f64>>,
        noise: &SurfaceNoise,
        layout: &Layout,
    ) -> Observation {
        let count = self.pairs.len();
        let mut values = DVector::zeros(3 * count);
        let mut covariance = DMatrix::zeros(3 * count, 3 * count);
        let mut of_reference = Matrix3::zeros();
        let points = |k: usize| self.sights[k].1 as f64;

        for k in 0..count {
            let shift = self.shift(k, shifts);
            let (value, spread) = self.equations(k, &shift, noise, layout).solved();
            values.fixed_rows_mut::<3>(3 * k).copy_from(&value);
            // The noise of a difference is that of both sources, each by its number of points.
            let share = points(0) / (points(0) + points(k + 1));
            let mut block = covariance.fixed_view_mut::<3, 3>(3 * k, 3 * k);
            block += spread * share;
            of_reference += spread * ((1.0 - share) / count as f64);
        }

        for r in 0..count {
            for c in 0..count {
                let mut block = covariance.fixed_view_mut::<3, 3>(3 * r, 3 * c);
                block += of_reference;
            }
        }

        Observation {
            sights: self.sights.iter().map(|s| s.0).collect(),
            directions: vec![Vector3::x(), Vector3::y(), Vector3::z()],
            values,
            covariance,
            face_from_world: self.face_from_world,
            weight: 1.0,
        }
    }
}

/// Normal equations of a translation, world frame, about none.
#[derive(Clone, Copy, Default)]
struct Translation {
    information: Matrix3<f64>,
    vector: Vector3<f64>,
}

impl Translation {
    /// A source's rotation within one stone is negligible.
    fn new(e: &Equations, at: &Vector3<f64>, face_from_world: &Matrix3<f64>) -> Self {
        let world = face_from_world.transpose();
        let information = world * e.information.fixed_view::<3, 3>(0, 0) * face_from_world;
        Self {
            information,
            vector: information * at - world * e.gradient.fixed_rows::<3>(0),
        }
    }

    fn solved(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let held = self.information + Matrix3::identity() / (UNSEEN_M * UNSEEN_M);
        match held.cholesky() {
            Some(factor) => (factor.solve(&self.vector), factor.inverse()),
            None => (Vector3::zeros(), Matrix3::identity() * UNSEEN_M * UNSEEN_M),
        }
    }
}

/// The mean displacement of every source against every reference, each found from all stones together.
fn common_shifts(
    seen: &[Comparison],
    shifts: &BTreeMap<(usize, usize), Vector3<f64>>,
    noise: &SurfaceNoise,
    layout: &Layout,
) -> BTreeMap<(usize, usize), Vector3<f64>> {
    let found: Vec<Vec<((usize, usize), Translation)>> = seen
        .par_iter()
        .map(|c| {
            let of_pair = |k: usize| {
                let key = (c.sights[0].0.source, c.sights[k + 1].0.source);
                (key, c.equations(k, &c.shift(k, shifts), noise, layout))
            };
            (0..c.pairs.len()).map(of_pair).collect()
        })
        .collect();
    let mut sums: BTreeMap<(usize, usize), Translation> = BTreeMap::new();

    for (key, term) in found.into_iter().flatten() {
        // Two sources the other way round give the same term with the other sign.
        let (key, sign) = if key.0 < key.1 {
            (key, 1.0)
        } else {
            ((key.1, key.0), -1.0)
        };
        let sum = sums.entry(key).or_default();
        sum.information += term.information;
        sum.vector += term.vector * sign;
    }

    sums.into_iter()
        .flat_map(|((a, b), sum)| {
            let shift = sum.solved().0;
            [((a, b), shift), ((b, a), -shift)]
        })
        .collect()
}

fn common_noise(
    seen: &[Comparison],
    shifts: &BTreeMap<(usize, usize), Vector3<f64>>,
    start: &SurfaceNoise,
    layout: &Layout,
) -> SurfaceNoise {
    let stride = seen.len().div_ceil(NOISE_SAMPLE).max(1);
    let sample: Vec<(&LocalPair, StoneVector)> = seen
        .iter()
        .step_by(stride)
        .map(|c| (&c.pairs[0], c.motion(&c.shift(0, shifts))))
        .collect();
    estimate_noise(&sample, start, layout)
}

/// The cells of a face with points of a cloud, seen along the normal.
struct FaceCells {
    cell_m: f64,
    by_place: BTreeMap<[i64; 2], CellDepths>,
}

/// The points of a cell.
struct CellDepths {
    points: usize,
    /// Smallest and largest distance from the face, metres.
    range_m: [f64; 2],
}

impl FaceCells {
    /// The cells of each cloud, in one grid.
    fn of_clouds<'a>(clouds: impl Iterator<Item = &'a Cloud> + Clone, normal: &Vector3<f64>) -> Vec<Self> {
        let spacing_m = clouds
            .clone()
            .map(|c| face_spacing(c, normal))
            .fold(0.0, f64::max);
        let frame = FaceFrame::from_normal(normal);
        let cell_m = FACE_SPACINGS * spacing_m;
        let of_cloud = |cloud: &Cloud| {
            let mut by_place = BTreeMap::new();
            for i in 0..cloud.len() {
                let at = cloud.world(i).coords;
                let place = [frame.along, frame.up].map(|axis| (at.dot(&axis) / cell_m).floor() as i64);
                let depth_m = at.dot(normal);
                let none = CellDepths {
                    points: 0,
                    range_m: [f64::INFINITY, f64::NEG_INFINITY],
                };
                let cell = by_place.entry(place).or_insert(none);
                cell.points += 1;
                cell.range_m = [cell.range_m[0].min(depth_m), cell.range_m[1].max(depth_m)];
            }
            Self { cell_m, by_place }
        };
        clouds.map(of_cloud).collect()
    }

    /// Share of the larger of two faces that both show.
    fn overlap(&self, other: &Self) -> f64 {
        let larger = self.by_place.len().max(other.by_place.len()).max(1);
        let shared = self
            .by_place
            .keys()
            .filter(|place| other.by_place.contains_key(*place));
        shared.count() as f64 / larger as f64
    }

    /// Share of the points in cells that are much deeper than wide.
    fn steep_share(&self) -> f64 {
        let is_steep = |c: &&CellDepths| c.range_m[1] - c.range_m[0] > STEEP * self.cell_m;
        let of_all = self.by_place.values().map(|c| c.points).sum::<usize>();
        let steep = self
            .by_place
            .values()
            .filter(is_steep)
            .map(|c| c.points)
            .sum::<usize>();
        steep as f64 / of_all.max(1) as f64
    }
}

/// Evenly spaced points, so that no more than `most` remain.
fn thinned(cloud: &Cloud, most: usize) -> Cloud {
    let step = cloud.len().div_ceil(most.max(1)).max(1);
    Cloud::new(
        cloud.origin(),
        cloud.offsets().iter().copied().step_by(step).collect(),
    )
}
