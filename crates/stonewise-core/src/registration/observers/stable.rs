//! Differences between sources, of one epoch and of both, on planes that did not move.

use super::observation::Observation;
use super::sight::{Sight, StablePlane, Target};
use crate::cloud::Cloud;
use crate::geometry::FaceFrame;
use crate::params::{Params, Range, Ranged, with_ranges};
use crate::statistics::upper_median;
use nalgebra::{Cholesky, DMatrix, DVector, Matrix3, Point3, Vector3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Parameters of the stable areas.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[schemars(transform = with_ranges::<Self>)]
pub struct StableParams {
    /// Edge of the cells in which an area is a plane, metres.
    pub cell_m: f64,
    /// Points that a source needs in a cell.
    pub min_points: usize,
    /// A cell whose points scatter more about their plane is no plane, metres; nor is one whose points
    /// scatter much more than their noise.
    pub max_scatter_m: f64,
    /// Cells that the areas must have in all.
    pub min_cells: usize,
    /// Share of a point's noise that no number of points in a cell averages away (incidence, reflectance,
    /// footprint).
    pub systematic_share: f64,
}

impl Default for StableParams {
    fn default() -> Self {
        Self {
            cell_m: 0.25,
            min_points: 12,
            max_scatter_m: 0.03,
            min_cells: 12,
            systematic_share: 0.1,
        }
    }
}

impl Params for StableParams {
    fn ranges(&self) -> Vec<Ranged> {
        vec![
            Range::POSITIVE.holds("cell_m", self.cell_m),
            Range::NOT_NEGATIVE.holds("min_points", self.min_points),
            Range::NOT_NEGATIVE.holds("max_scatter_m", self.max_scatter_m),
            Range::NOT_NEGATIVE.holds("min_cells", self.min_cells),
            Range::SHARE.holds("systematic_share", self.systematic_share),
        ]
    }
}

/// Points of one source in one stable area.
#[derive(Clone, Debug)]
pub struct StablePoints {
    /// Which of the project's areas.
    pub area: usize,
    /// Index into the sources.
    pub source: usize,
    /// The points.
    pub points: Cloud,
    /// Time of each point, seconds; empty where there are none.
    pub times_s: Vec<f64>,
}

/// Factor by which noise along the normal may exceed that of the wall's points, and roughness of a plane, metres. What
/// scatters more is a shrub or an edge, and its mean plane depends on the source that measures it.
const NOISE_SLACK: f64 = 1.5;
const ROUGHNESS_M: f64 = 0.01;
/// Points farther from their plane than this many median absolute deviations are left out.
const OUTLIER_MADS: f64 = 4.5;
/// Least extent of a cell's points in its plane, as a standard deviation and a share of the cell's edge.
const LEAST_EXTENT: f64 = 0.12;
/// Cells within this many edges of each other, whose normals agree within [`SAME_PLANE_COSINE`], share their
/// mean normal.
const NORMAL_REACH: f64 = 4.0;
const SAME_PLANE_COSINE: f64 = 0.97;
/// Surfaces farther apart than this share of a cell's edge are two.
const GAP: f64 = 0.3;

/// The observations of all cells.
///
/// `sigma_m`: noise of single points.
pub(super) fn stable_observations(
    list: &[StablePoints],
    sigma_m: f64,
    params: &StableParams,
) -> Vec<Observation> {
    let systematic_m = params.systematic_share * sigma_m;
    let max_scatter_m = (NOISE_SLACK * sigma_m).hypot(ROUGHNESS_M);
    let cells = columns(list, params.cell_m);
    let planes: Vec<(usize, CellPlane)> = cells
        .par_iter()
        .filter_map(|(area, points)| Some((*area, CellPlane::fit(points, max_scatter_m, params)?)))
        .collect();
    let numbers = plane_numbers(&planes, params);
    planes
        .par_iter()
        .zip(numbers)
        .filter_map(|((area, plane), number)| {
            let normal = mean_normal(plane, &planes, params);
            let of = StablePlane { area: *area, number };
            plane.observe(&normal, systematic_m, of)
        })
        .collect()
}

/// For each cell the number of the plane that it is part of: the first in its area that has its direction and
/// holds its centre.
fn plane_numbers(cells: &[(usize, CellPlane)], params: &StableParams) -> Vec<usize> {
    let mut heads: Vec<usize> = Vec::new();
    let is_part = |head: usize, k: usize| {
        let ((area_of_head, head), (area, cell)) = (&cells[head], &cells[k]);
        let off = (cell.centre - head.centre).dot(&head.normal).abs();
        area_of_head == area && head.normal.dot(&cell.normal).abs() > SAME_PLANE_COSINE && off < params.cell_m
    };
    let number = |k: usize| {
        let found = heads.iter().position(|&head| is_part(head, k));
        found.unwrap_or_else(|| {
            heads.push(k);
            heads.len() - 1
        })
    };
    (0..cells.len()).map(number).collect()
}

/// Cuts the areas into pieces of surface, with the area of each.
///
/// Cells are cut only across the two axes along which their surface lies: a boundary along it would cut off
/// the noise of its points on one side, and so pull their mean.
fn columns(list: &[StablePoints], cell_m: f64) -> Vec<(usize, Vec<CellPoint>)> {
    let key = |p: &Point3<f64>| [0, 1, 2].map(|a| (p[a] / cell_m).floor() as i64);
    let mut cubes: BTreeMap<(usize, [i64; 3]), Vec<CellPoint>> = BTreeMap::new();
    for part in list {
        for i in 0..part.points.len() {
            let place = part.points.world(i);
            cubes
                .entry((part.area, key(&place)))
                .or_default()
                .push(CellPoint {
                    source: part.source,
                    place,
                    time_s: part.times_s.get(i).copied().unwrap_or(0.0),
                });
        }
    }

    let mut columns: BTreeMap<(usize, usize, [i64; 2]), Vec<CellPoint>> = BTreeMap::new();
    for ((area, cube), points) in cubes {
        let Some((_, normal, _)) = plane_of(&points) else {
            continue;
        };
        let across = normal.iamax();
        let along = [(across + 1) % 3, (across + 2) % 3].map(|a| cube[a]);
        columns.entry((area, across, along)).or_default().extend(points);
    }

    columns
        .into_iter()
        .flat_map(|((area, across, _), points)| {
            split(points, across, GAP * cell_m)
                .into_iter()
                .map(move |p| (area, p))
        })
        .collect()
}

/// Parts points where nothing lies within `gap_m` along an axis.
fn split(mut points: Vec<CellPoint>, axis: usize, gap_m: f64) -> Vec<Vec<CellPoint>> {
    points.sort_by(|a, b| {
        a.place[axis]
            .total_cmp(&b.place[axis])
            .then(a.source.cmp(&b.source))
    });
    let mut parts: Vec<Vec<CellPoint>> = Vec::new();
    for point in points {
        match parts.last_mut() {
            Some(part)
                if part
                    .last()
                    .is_some_and(|p| point.place[axis] - p.place[axis] < gap_m) =>
            {
                part.push(point)
            }
            _ => parts.push(vec![point]),
        }
    }
    parts
}

#[derive(Clone, Copy)]
struct CellPoint {
    source: usize,
    place: Point3<f64>,
    time_s: f64,
}

/// A cell's plane and its points without outliers, in the order of their sources.
struct CellPlane {
    centre: Point3<f64>,
    normal: Vector3<f64>,
    points: Vec<CellPoint>,
}

impl CellPlane {
    /// `None` where fewer than two sources have points, or the points are no plane.
    fn fit(points: &[CellPoint], max_scatter_m: f64, params: &StableParams) -> Option<Self> {
        let mut kept = points.to_vec();
        let mut plane = plane_of(&kept)?;
        for _ in 0..3 {
            let distances: Vec<f64> = kept.iter().map(|p| (p.place - plane.0).dot(&plane.1)).collect();
            let mut sizes: Vec<f64> = distances.iter().map(|d| d.abs()).collect();
            let limit = OUTLIER_MADS * upper_median(&mut sizes)?;
            let before = kept.len();
            let mut distance = distances.iter();
            kept.retain(|_| distance.next().is_some_and(|d| d.abs() <= limit));
            if kept.len() == before {
                break;
            }
            plane = plane_of(&kept)?;
        }

        let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
        for p in &kept {
            *counts.entry(p.source).or_default() += 1;
        }
        counts.retain(|source, n| *n >= params.min_points && shows_plane(&kept, *source, &plane.1, params));
        kept.retain(|p| counts.contains_key(&p.source));
        let (centre, normal, spread) = plane_of(&kept)?;
        let is_plane = spread[0].sqrt() <= params.max_scatter_m
            && scatter(&kept, &normal) <= max_scatter_m
            && spread[1].sqrt() >= LEAST_EXTENT * params.cell_m
            && spread[0] < 0.25 * spread[1];
        kept.sort_by_key(|p| p.source);

        (counts.len() >= 2 && is_plane).then_some(Self {
            centre,
            normal,
            points: kept,
        })
    }

    /// Offsets of the further sources against the first along the normal, with the plane's height and tilt
    /// eliminated.
    fn observe(&self, normal: &Vector3<f64>, systematic_m: f64, of: StablePlane) -> Option<Observation> {
        let frame = FaceFrame::from_normal(normal);
        let mut sources: Vec<usize> = self.points.iter().map(|p| p.source).collect();
        sources.dedup();
        let unknowns = 2 + sources.len();
        let mut information = DMatrix::<f64>::zeros(unknowns, unknowns);
        let mut vector = DVector::<f64>::zeros(unknowns);

        let row = |p: &CellPoint| {
            let d = p.place - self.centre;
            let mut row = DVector::<f64>::zeros(unknowns);
            row[0] = 1.0;
            row[1] = d.dot(&frame.along);
            row[2] = d.dot(&frame.up);
            if let Ok(k) = sources.binary_search(&p.source)
                && k > 0
            {
                row[2 + k] = 1.0;
            }
            (row, d.dot(normal))
        };

        for p in &self.points {
            let (row, height) = row(p);
            information.syger(1.0, &row, &row, 1.0);
            vector.axpy(height, &row, 1.0);
        }

        information.fill_upper_triangle_with_lower_triangle();
        let factor = Cholesky::new(information)?;
        let solution = factor.solve(&vector);
        let squares: f64 = self
            .points
            .iter()
            .map(|p| {
                let (row, height) = row(p);
                (height - row.dot(&solution)).powi(2)
            })
            .sum();
        let freedom = self.points.len().saturating_sub(unknowns).max(1) as f64;
        let others = sources.len() - 1;
        let noise = factor.inverse().view((3, 3), (others, others)) * (squares / freedom);

        // The first source's own error is in every difference.
        let systematic = DMatrix::from_fn(others, others, |r, c| {
            systematic_m * systematic_m * if r == c { 2.0 } else { 1.0 }
        });
        let covariance = noise + systematic;
        Some(Observation {
            sights: sources.iter().map(|&s| self.sight(s, of)).collect(),
            directions: vec![*normal],
            values: solution.rows(3, others).into_owned(),
            covariance,
            face_from_world: frame.face_from_world(),
            weight: 1.0,
        })
    }

    fn sight(&self, source: usize, of: StablePlane) -> Sight {
        let own: Vec<f64> = self
            .points
            .iter()
            .filter(|p| p.source == source)
            .map(|p| p.time_s)
            .collect();
        Sight {
            source,
            time_s: own.iter().sum::<f64>() / own.len().max(1) as f64,
            place: self.centre,
            target: Target::Plane(of),
        }
    }
}

/// Scatter of the points along a normal, each source about its own mean, metres.
fn scatter(points: &[CellPoint], normal: &Vector3<f64>) -> f64 {
    let mut sums: BTreeMap<usize, [f64; 3]> = BTreeMap::new();
    for p in points {
        let height = (p.place - points[0].place).dot(normal);
        let sum = sums.entry(p.source).or_default();
        *sum = [sum[0] + 1.0, sum[1] + height, sum[2] + height * height];
    }
    let squares: f64 = sums.values().map(|[n, h, hh]| hh - h * h / n).sum();
    (squares.max(0.0) / points.len().max(1) as f64).sqrt()
}

/// Whether the points of a source extend over a plane of that normal by themselves: those at an edge, or on
/// another thing, show another.
fn shows_plane(points: &[CellPoint], source: usize, normal: &Vector3<f64>, params: &StableParams) -> bool {
    let own: Vec<CellPoint> = points.iter().copied().filter(|p| p.source == source).collect();
    plane_of(&own).is_some_and(|(_, direction, spread)| {
        direction.dot(normal).abs() > SAME_PLANE_COSINE && spread[1].sqrt() >= LEAST_EXTENT * params.cell_m
    })
}

/// Mean normal of the cells around that lie in the same plane: a single cell's tilts with the noise of its points, and
/// would then show displacements along the plane that are not observable.
fn mean_normal(plane: &CellPlane, planes: &[(usize, CellPlane)], params: &StableParams) -> Vector3<f64> {
    let reach = NORMAL_REACH * params.cell_m;
    let sum: Vector3<f64> = planes
        .iter()
        .map(|(_, p)| p)
        .filter(|p| (p.centre - plane.centre).norm() < reach)
        .filter(|p| p.normal.dot(&plane.normal).abs() > SAME_PLANE_COSINE)
        .map(|p| p.normal * (p.normal.dot(&plane.normal).signum() * p.points.len() as f64))
        .sum();
    sum.try_normalize(0.0).unwrap_or(plane.normal)
}

/// Centre, normal and ascending variances along the principal axes, of each source's points about their own mean: what
/// lies between the sources is what is measured, and would tilt the plane.
fn plane_of(points: &[CellPoint]) -> Option<(Point3<f64>, Vector3<f64>, [f64; 3])> {
    if points.len() < 8 {
        return None;
    }
    let count = points.len() as f64;
    let centre = Point3::from(points.iter().map(|p| p.place.coords).sum::<Vector3<f64>>() / count);
    let mut sums: BTreeMap<usize, (f64, Vector3<f64>)> = BTreeMap::new();
    let mut spread = Matrix3::zeros();
    for p in points {
        let d = p.place - centre;
        spread += d * d.transpose() / count;
        let (n, sum) = sums.entry(p.source).or_insert((0.0, Vector3::zeros()));
        *n += 1.0;
        *sum += d;
    }
    for (n, sum) in sums.values() {
        spread -= sum * sum.transpose() / (n * count);
    }
    let eigen = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let normal = eigen.eigenvectors.column(order[0]).into_owned();
    Some((centre, normal, order.map(|k| eigen.eigenvalues[k].max(0.0))))
}
