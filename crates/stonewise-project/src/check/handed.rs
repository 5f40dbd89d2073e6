//! Do clouds stand upright, and do they show the wall and not its mirror image?
//!
//! Walls are steep: a cloud in which nearly everything lies flat has another axis than Z pointing up. The relief of the
//! wall is unlike its own mirror image: a later epoch whose relief fits that of the first epoch only when it is mirrored
//! has an axis that points the wrong way, or two that are exchanged.

use super::clouds::read;
use super::finding::{Finding, Verdict};
use super::sample::Sample;
use crate::Project;
use nalgebra::{Point3, Vector3};
use std::collections::HashMap;
use stonewise_base::messages::Said;
use stonewise_base::messages::findings::{CLOUDS, LIES_FLAT, MIRRORED, NORTH_FIRST};
use stonewise_base::settings::Align;
use stonewise_core::geometry::{Bounds, Plane, cell_of};
use stonewise_core::statistics::{median, split_mix};

/// Edge of the cells whose points are taken for a piece of a surface, metres, and the points in one at least.
const PIECE_M: f64 = 0.25;
const PIECE_POINTS: usize = 12;
/// Cosines between a normal and the vertical: of surfaces that lie flat, and of those that are steep.
const FLAT: f64 = 0.866;
const STEEP: f64 = 0.707;
/// Shares of the points of all pieces on flat and on steep ones from which on a cloud lies flat.
const MOST_FLAT: f64 = 0.8;
const LEAST_STEEP: f64 = 0.02;

/// Northings between 46 and 56 degrees, and eastings of a zone (UTM), metres.
const NORTHINGS_M: std::ops::Range<f64> = 5.1e6..6.2e6;
const EASTINGS_M: std::ops::Range<f64> = 1.6e5..8.4e5;

/// Points among which the plane of the wall is sought, planes that are tried, and how far off it its points lie, metres.
const SOUGHT: usize = 4000;
const TRIES: u64 = 300;
const DEPTH_M: f64 = 0.15;
/// Cells along the longer side of the relief, and the edge of a cell at least, metres.
const CELLS: f64 = 96.0;
const CELL_M: f64 = 0.03;
/// Half width of the window whose mean is taken away, cells.
const WINDOW: i64 = 6;
/// Reliefs are compared where they have this share of the smaller one's cells in common, and so many cells.
const COMMON: f64 = 0.5;
const LEAST_CELLS: f64 = 400.0;
/// Correlation with the mirror image from which on it is one, and how much less that with the relief itself must be. On the
/// regular courses of the demo the image of the wall has 0.98, and the best shift of the wall itself 0.75.
const ALIKE: f64 = 0.6;
const LESS: f64 = 0.15;

pub(super) fn look(project: &Project, surveys: &[Option<Sample>]) -> Vec<Finding> {
    let mut found = Vec::new();
    let mut first: Option<(Wall, Relief)> = None;
    for (epoch, survey) in read(project, surveys) {
        if let Some(share) = steep_share(&survey.points).filter(|share| *share < LEAST_STEEP) {
            let share = Said::numbers(format!("{:.1}", 100.0 * share));
            // What was not looked at may be the wall.
            let verdict = match survey.is_whole() {
                true => Verdict::Doubt,
                false => Verdict::Note,
            };
            found.push(Finding::new(
                &epoch.name,
                &CLOUDS,
                verdict,
                LIES_FLAT.say(&[("share", share)]),
            ));
        }
        found.extend(
            northings_first(survey)
                .then(|| Finding::new(&epoch.name, &CLOUDS, Verdict::Note, NORTH_FIRST.say(&[]))),
        );
        // Epochs that their stones bring together need not lie beside each other.
        if project.settings.registration.align != Align::None {
            continue;
        }
        let Some((wall, relief)) = &first else {
            first = Wall::find(&survey.points).map(|wall| {
                let relief = wall.relief(&survey.points);
                (wall, relief)
            });
            continue;
        };
        if let Some([plain, mirrored]) = relief.compare(&wall.relief(&survey.points))
            && mirrored > ALIKE
            && plain < mirrored - LESS
        {
            let values = [("mirrored", mirrored), ("plain", plain)];
            let text = MIRRORED.say(&values.map(|(name, r)| (name, Said::numbers(format!("{r:.2}")))));
            found.push(Finding::new(&epoch.name, &CLOUDS, Verdict::Doubt, text));
        }
    }
    found
}

/// Whether X is where northings of central Europe are and Y where eastings are (UTM), in clouds that name no system.
fn northings_first(survey: &Sample) -> bool {
    let lies =
        |low: f64, high: f64, range: &std::ops::Range<f64>| range.contains(&low) && range.contains(&high);
    survey.crs.iter().all(Option::is_none)
        && survey.bounds.is_some_and(|Bounds { min, max }| {
            lies(min.x, max.x, &NORTHINGS_M) && lies(min.y, max.y, &EASTINGS_M)
        })
}

/// Share of the points on pieces of surfaces that are steep, where most pieces lie flat; `None` elsewhere.
fn steep_share(points: &[Point3<f64>]) -> Option<f64> {
    let mut pieces: HashMap<[i64; 3], Vec<Point3<f64>>> = HashMap::new();
    let step = (points.len() / 200_000).max(1);
    for p in points.iter().step_by(step) {
        pieces.entry(cell_of(p, PIECE_M)).or_default().push(*p);
    }
    // Whole numbers, so that the map's order does not matter.
    let (mut all, mut flat, mut steep) = (0, 0, 0);
    for piece in pieces.values().filter(|piece| piece.len() >= PIECE_POINTS) {
        let Some(plane) = Plane::fit(piece) else { continue };
        all += piece.len();
        match plane.normal.z.abs() {
            z if z > FLAT => flat += piece.len(),
            z if z < STEEP => steep += piece.len(),
            _ => {}
        }
    }
    (flat as f64 > MOST_FLAT * all as f64).then(|| steep as f64 / all as f64)
}

/// The plane of the wall, and cells in it.
struct Wall {
    middle: Point3<f64>,
    /// Along, up and out.
    axes: [Vector3<f64>; 3],
    cell_m: f64,
}

/// How far the wall stands out of its surroundings, by cells of its plane; bounded.
struct Relief(HashMap<[i64; 2], f64>);

impl Wall {
    /// The steep plane near which most points lie (Fischler and Bolles 1981).
    fn find(points: &[Point3<f64>]) -> Option<Self> {
        let few: Vec<Point3<f64>> = points
            .iter()
            .step_by((points.len() / SOUGHT).max(1))
            .copied()
            .collect();
        let near = |plane: &(Point3<f64>, Vector3<f64>)| {
            let (at, normal) = *plane;
            let is_near = move |p: &&Point3<f64>| (*p - at).dot(&normal).abs() < DEPTH_M;
            few.iter().filter(is_near).copied().collect::<Vec<_>>()
        };
        let pick = |n: u64| few.get(split_mix(n) as usize % few.len().max(1)).copied();
        let planes = (0..TRIES).filter_map(|n| {
            let [a, b, c] = [3 * n, 3 * n + 1, 3 * n + 2].map(pick);
            let (a, b, c) = (a?, b?, c?);
            let normal = (b - a).cross(&(c - a)).try_normalize(1e-9)?;
            (normal.z.abs() < STEEP).then_some((a, normal))
        });
        let best = planes.max_by_key(|plane| near(plane).len())?;
        let plane = Plane::fit(&near(&best))?;
        let along = Vector3::z().cross(&plane.normal).try_normalize(1e-9)?;
        let axes = [along, plane.normal.cross(&along), plane.normal];
        let mut wall = Self {
            middle: plane.centroid,
            axes,
            cell_m: CELL_M,
        };
        let on_wall = near(&(plane.centroid, plane.normal));
        let reach = |axis: usize| {
            let places = on_wall.iter().map(|p| (p - wall.middle).dot(&wall.axes[axis]));
            places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| {
                [low.min(x), high.max(x)]
            })
        };
        let longer = [0, 1].map(|axis| reach(axis)[1] - reach(axis)[0]);
        wall.cell_m = CELL_M.max(longer[0].max(longer[1]) / CELLS);
        Some(wall)
    }

    fn relief(&self, points: &[Point3<f64>]) -> Relief {
        let mut sums: HashMap<[i64; 2], (f64, f64)> = HashMap::new();
        for p in points {
            let [along, up, out] = self.axes.map(|axis| (p - self.middle).dot(&axis));
            if out.abs() < 2.0 * DEPTH_M {
                let cell = [along, up].map(|x| (x / self.cell_m).floor() as i64);
                let sum = sums.entry(cell).or_default();
                *sum = (sum.0 + out, sum.1 + 1.0);
            }
        }
        let heights: HashMap<[i64; 2], f64> =
            sums.into_iter().map(|(cell, (sum, n))| (cell, sum / n)).collect();
        let around = |&[x, y]: &[i64; 2]| {
            let window = (-WINDOW..=WINDOW).flat_map(|j| (-WINDOW..=WINDOW).map(move |i| [x + i, y + j]));
            let (sum, n) = window
                .filter_map(|cell| heights.get(&cell))
                .fold((0.0, 0.0), |(sum, n), h| (sum + h, n + 1.0));
            sum / n
        };
        let mut relief: Vec<([i64; 2], f64)> = heights
            .iter()
            .map(|(cell, h)| (*cell, h - around(cell)))
            .collect();
        let mut sizes: Vec<f64> = relief.iter().map(|(_, h)| h.abs()).collect();
        // Plants and edges stand out by much more than stones do.
        let most = 3.0 * median(&mut sizes).unwrap_or(0.0);
        relief.iter_mut().for_each(|(_, h)| *h = h.clamp(-most, most));
        Relief(relief.into_iter().collect())
    }
}

impl Relief {
    /// The greatest correlations with another relief, and with its mirror images, wherever they lie; `None` where too
    /// little can be compared.
    fn compare(&self, other: &Self) -> Option<[f64; 2]> {
        let (Some(own), Some(others)) = (Grid::of(self), Grid::of(other)) else {
            return None;
        };
        let plain = own.best(&others)?;
        // About a vertical and a level line of the wall, through its plane, and all three.
        let images = [[-1, 1, 1], [1, -1, 1], [1, 1, -1], [-1, -1, -1]];
        let mirrored = images
            .iter()
            .filter_map(|signs| own.best(&others.mirrored(*signs)));
        Some([plain, mirrored.fold(-1.0, f64::max)])
    }
}

/// A relief as a raster; NaN where nothing is known.
struct Grid {
    size: [usize; 2],
    values: Vec<f64>,
}

impl Grid {
    fn of(relief: &Relief) -> Option<Self> {
        let [low, high] = [i64::min, i64::max].map(|pick| {
            let cells = relief.0.keys().copied();
            cells.reduce(|a, b| [pick(a[0], b[0]), pick(a[1], b[1])])
        });
        let (low, high) = (low?, high?);
        // The other epoch may reach beyond the wall of the first.
        let size = [0, 1].map(|k| (high[k] - low[k] + 1).min(3 * CELLS as i64) as usize);
        let mut values = vec![f64::NAN; size[0] * size[1]];
        for (cell, h) in &relief.0 {
            let [x, y] = [0, 1].map(|k| (cell[k] - low[k]) as usize);
            if x < size[0] && y < size[1] {
                values[y * size[0] + x] = *h;
            }
        }
        Some(Self { size, values })
    }

    fn mirrored(&self, [along, up, out]: [i8; 3]) -> Self {
        let [w, h] = self.size;
        let value = |k: usize| {
            let (x, y) = (k % w, k / w);
            let x = if along < 0 { w - 1 - x } else { x };
            let y = if up < 0 { h - 1 - y } else { y };
            f64::from(out) * self.values[y * w + x]
        };
        Self {
            size: self.size,
            values: (0..w * h).map(value).collect(),
        }
    }

    fn known(&self) -> f64 {
        self.values.iter().filter(|v| v.is_finite()).count() as f64
    }

    /// The greatest correlation over all shifts at which enough cells are common.
    fn best(&self, other: &Self) -> Option<f64> {
        let least = LEAST_CELLS.max(COMMON * self.known().min(other.known()));
        let [w, h] = self.size.map(|n| n as i64);
        let [v, g] = other.size.map(|n| n as i64);
        let shifts = (1 - g..h).flat_map(|dy| (1 - v..w).map(move |dx| [dx, dy]));
        let all = shifts.filter_map(|shift| self.correlation(other, shift, least));
        all.max_by(f64::total_cmp)
    }

    fn correlation(&self, other: &Self, [dx, dy]: [i64; 2], least: f64) -> Option<f64> {
        let [w, h] = self.size.map(|n| n as i64);
        let [v, g] = other.size.map(|n| n as i64);
        let (x, y) = (0.max(dx)..w.min(v + dx), 0.max(dy)..h.min(g + dy));
        if ((x.end - x.start).max(0) * (y.end - y.start).max(0)) < least as i64 {
            return None;
        }
        let (mut n, mut product, mut own, mut others) = (0.0, 0.0, 0.0, 0.0);
        for row in y {
            let a = &self.values[(row * w + x.start) as usize..(row * w + x.end) as usize];
            let at = (row - dy) * v - dx;
            let b = &other.values[(at + x.start) as usize..(at + x.end) as usize];
            for (a, b) in a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite()) {
                n += 1.0;
                product += a * b;
                own += a * a;
                others += b * b;
            }
        }
        (n >= least).then(|| product / (own * others).sqrt().max(1e-12))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall of 3 x 1.5 m of stones of random height, scanned at random places; at a place on a map.
    fn wall(seed: u64) -> Vec<Point3<f64>> {
        let unit = |n: u64| split_mix(n) as f64 / u64::MAX as f64;
        let point = |n: u64| {
            let [along, up] = [3.0 * unit(3 * n), 1.5 * unit(3 * n + 1)];
            let row = (up / 0.25).floor();
            let stone = ((along + 0.17 * row) / 0.4).floor();
            let height = 0.03 * unit(1_000_003 + (row * 100.0 + stone) as u64);
            let noise = 0.002 * (unit(3 * n + 2) - 0.5);
            Point3::new(4e5 + 0.6 * along, 5.6e6 + 0.8 * along, 300.0 + up)
                + Vector3::new(0.8, -0.6, 0.0) * (height + noise)
        };
        (0..60_000).map(|n| point(seed * 1_000_000 + n)).collect()
    }

    fn compared(first: &[Point3<f64>], second: &[Point3<f64>]) -> [f64; 2] {
        let found = Wall::find(first).unwrap();
        found.relief(first).compare(&found.relief(second)).unwrap()
    }

    #[test]
    fn a_mirror_image_is_told_from_the_wall() {
        let (first, second) = (wall(1), wall(2));
        let [plain, mirrored] = compared(&first, &second);
        assert!(plain > 0.8 && mirrored < plain - LESS, "{plain} {mirrored}");
        // Householder's reflections about the middle of the wall: along it, up and out of it.
        let middle = Point3::new(4e5 + 0.9, 5.6e6 + 1.2, 300.75);
        for axis in [
            Vector3::new(0.6, 0.8, 0.0),
            Vector3::z(),
            Vector3::new(0.8, -0.6, 0.0),
        ] {
            let image: Vec<_> = second
                .iter()
                .map(|p| p - axis * (2.0 * (p - middle).dot(&axis)))
                .collect();
            let [plain, mirrored] = compared(&first, &image);
            assert!(
                mirrored > 0.8 && plain < mirrored - LESS,
                "{axis:?}: {plain} {mirrored}"
            );
        }
    }

    #[test]
    fn a_wall_with_y_up_lies_flat() {
        let points = wall(1);
        assert_eq!(steep_share(&points), None);
        let lying: Vec<_> = points
            .iter()
            .map(|p| Point3::new(p.x, p.z, 0.8 * (p.x - 4e5) - 0.6 * (p.y - 5.6e6)))
            .collect();
        assert!(steep_share(&lying).unwrap() < LEAST_STEEP);
    }
}
